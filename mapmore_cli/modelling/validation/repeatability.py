"""What recordings and cycles that repeat each other say: the floor below which no model can be
asked to go, and what limits one.

Errors on repeated cycles are parted by projections, so that squares add up. The mean of each cycle
is `drift`. Of what is left, the mean over cycles at the same place of the same stroke is an error
that every cycle of the split repeats: as far as it is the one that training left, it is the model's
`shape`; what differs from that is `change`, loops that are no longer those of the training cycles.
The `rest` is repeated by no other cycle: noise, and drift within a cycle. Of a single held-out
cycle, all that its places have and training did not leave is `change`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.cycles import SWING, bin_means, cycle_starts, turning_points

# over the range of a curve: the samples of a branch are averaged in each, so that a dwell counts no
# more than a passage
BINS = 200


@dataclass(frozen=True)
class _Branch:
    """Samples of one recording in one direction, at one set of values of what was held; places
    along the input and `means` there.
    """

    log: str
    kind: tuple[bool | float, ...]
    rows: IntArray
    means: tuple[Array, Array]


def repeats(
    curves: Sequence[Curve], target: str, inputs: Sequence[str], logs: Mapping[str, str]
) -> tuple[Array, ...] | None:
    """Return the mean of the other recordings at the level, coordinate and direction of each
    sample, `(n_c,)` for every curve.

    Recordings of one curve repeat each other where they agree in every input that was held in them.
    Each is parted into its rising and its falling branch along the one input that varies; a branch
    is averaged in bins and interpolated between them, never beyond its ends. NaN where no other
    recording has a value. Pieces of one log do not repeat each other; `logs` names the log of each
    recording.

    None where nothing repeats: with no or several varying inputs, or where the recordings of the
    samples are unknown.
    """
    spans = {
        name: [
            np.ptp(curve.columns[name][rows]) for curve in curves for _, rows in _recordings(curve)
        ]
        for name in inputs
    }
    along = [name for name in inputs if any(span > 0 for span in spans[name])]
    if len(along) != 1:
        return None
    held = [name for name in inputs if name != along[0]]
    found = tuple(_of_curve(curve, target, along[0], held, logs) for curve in curves)
    return found if any(np.isfinite(values).any() for values in found) else None


def rising(values: Array) -> BoolArray:
    """Return True where `values` `(n,)`, in order of time, rise; reversals smaller than a tenth of
    their range do not count.
    """
    turns = turning_points(values, SWING * float(np.ptp(values)))
    if len(turns) < 2:
        return np.ones(len(values), dtype=np.bool_)
    run = np.searchsorted(turns[1:-1], np.arange(len(values)), side="right")
    return np.asarray(np.diff(values[turns])[run] > 0)


def _recordings(curve: Curve) -> Iterator[tuple[str, IntArray]]:
    """Yield the id of each recording with its rows, in order of time."""
    if curve.origin is not None:
        for number, name in enumerate(curve.recordings):
            yield name, np.flatnonzero(curve.origin == number)


def _of_curve(
    curve: Curve, target: str, along: str, held: Sequence[str], logs: Mapping[str, str]
) -> Array:
    x, y = curve.columns[along], curve.columns[target]
    edges = np.linspace(x.min(), x.max(), BINS + 1)
    branches = []
    for name, rows in _recordings(curve):
        up, at = (
            rising(x[rows]),
            tuple(float(curve.columns[quantity][rows[0]]) for quantity in held),
        )
        for direction in (True, False):
            members = rows[up == direction]
            if len(members):
                places, means = bin_means(x[members], {"y": y[members]}, edges)
                branches.append(
                    _Branch(logs[name], (direction, *at), members, (places, means["y"]))
                )
    found = np.full(curve.size, np.nan)
    for branch in branches:
        others = [
            other for other in branches if other.kind == branch.kind and other.log != branch.log
        ]
        values = np.array(
            [np.interp(x[branch.rows], *other.means, left=np.nan, right=np.nan) for other in others]
        )
        known = np.isfinite(values)
        count, total = known.sum(axis=0), np.where(known, values, 0.0).sum(axis=0)
        found[branch.rows] = np.divide(
            total, count, out=np.full(len(branch.rows), np.nan), where=count > 0
        )
    return found


# root mean square difference of two cycles' courses, as a part of the range, up to which one
# repeats the other in time
SAME_COURSE = 0.05


def repeated_cycles(
    curves: Sequence[Curve], target: str, driven: str, logs: Mapping[str, str]
) -> tuple[Array, ...] | None:
    """Return the target of the last training cycle of `driven`, again from the beginning of every
    held-out cycle, `(n_c,)` for every curve.

    Where the quantity takes the same course in time again, as in a programme of steps, the same
    moment of that cycle stands beside each sample; else, as in loops driven by hand, the same place
    on the same stroke, rise or fall. NaN in the training data, and where a held-out cycle lasts
    longer or reaches further. None where no log has cycles of both kinds, or curves are no
    recordings but levels.
    """
    if any(curve.level is not None for curve in curves):
        return None
    found = [np.full(curve.size, np.nan) for curve in curves]
    for pieces, x, y, held_out in _by_log(curves, logs, driven, target):
        ends = np.cumsum([curves[number].size for number in pieces])[:-1]
        for number, values in zip(pieces, np.split(_again(x, y, held_out), ends), strict=True):
            found[number] = values
    return tuple(found) if any(np.isfinite(values).any() for values in found) else None


def _by_log(
    curves: Sequence[Curve], logs: Mapping[str, str], driven: str, target: str
) -> Iterator[tuple[list[int], Array, Array, BoolArray]]:
    """Yield the numbers of the curves that are pieces of each log, with `driven`, target and
    `held_out` of them one after the other.
    """
    pieces: dict[str, list[int]] = {}
    for number, curve in enumerate(curves):
        pieces.setdefault(logs[curve.recordings[0]], []).append(number)
    for numbers in pieces.values():
        x, y = (
            np.concatenate([curves[number].columns[name] for number in numbers])
            for name in (driven, target)
        )
        yield numbers, x, y, np.concatenate([curves[number].held_out for number in numbers])


def _again(x: Array, y: Array, held_out: BoolArray) -> Array:
    starts = cycle_starts(x)
    again = np.full(len(y), np.nan)
    ends = np.append(starts[1:], len(y))
    held = held_out[starts]
    trained = (
        np.flatnonzero(~held[: int(np.argmax(held))]) if held.any() else np.empty(0, dtype=np.int64)
    )
    if not len(trained):
        return again
    last = slice(starts[trained[-1]], ends[trained[-1]])
    for start, end in zip(starts[held], ends[held], strict=True):
        n = min(end - start, last.stop - last.start)
        difference = x[start : start + n] - x[last][:n]
        if np.sqrt(np.mean(difference**2)) <= SAME_COURSE * np.ptp(x):
            again[start : start + n] = y[last][:n]
        else:
            again[start:end] = _on_strokes(x[start:end], x[last], y[last])
    again[~held_out] = np.nan
    return again


def _on_strokes(x: Array, x_last: Array, y_last: Array) -> Array:
    """Return the target of the last cycle at `x`, (n,), on the rise for samples before the highest
    of `x`, else on the fall.
    """
    values = np.empty(len(x))
    peak, peak_last = int(np.argmax(x)), int(np.argmax(x_last))
    for rows, rows_last in (
        (slice(peak), slice(peak_last + 1)),
        (slice(peak, None), slice(peak_last, None)),
    ):
        order = np.argsort(x_last[rows_last], kind="stable")
        values[rows] = np.interp(
            x[rows], x_last[rows_last][order], y_last[rows_last][order], left=np.nan, right=np.nan
        )
    return values


WORTH = 0.02  # of the largest target, from which a floor is worth a word


def floors(x: Sequence[Array], y: Sequence[Array]) -> list[float]:
    """Return the `monotone_floor` of every curve y(x) as a part of the largest target of all;
    nothing where none is worth a word.

    Samples that all lie near some monotone curve need no nearest one: that takes a solver, which
    takes long to load.
    """
    largest = max(float(np.abs(values).max()) for values in y)
    if all(
        _least_error(*curve, _between_extremes) <= WORTH * largest
        for curve in zip(x, y, strict=True)
    ):
        return []
    found = [monotone_floor(*curve) / largest for curve in zip(x, y, strict=True)]
    return found if max(found) > WORTH else []


def monotone_floor(x: Array, y: Array) -> float:
    """Return the RMSE of the best monotone single-valued curve y(x) through samples `(n,)`: what no
    static model of x alone goes below.

    Isotonic regression, rising or falling, whichever is nearer; samples of one x count together. A
    loop has such a floor, and so has noise.
    """
    from scipy.optimize import isotonic_regression

    return _least_error(
        x, y, lambda means, counts: np.asarray(isotonic_regression(means, weights=counts).x)
    )


def _least_error(x: Array, y: Array, rising: Callable[[Array, IntArray], Array]) -> float:
    """Return the RMSE of a rising or of a falling curve through the mean targets at each x,
    whichever is nearer.
    """
    _, inverse, counts = np.unique(x, return_inverse=True, return_counts=True)
    means = np.bincount(inverse, y) / counts
    curves = rising(means, counts), rising(means[::-1], counts[::-1])[::-1]
    return min(float(np.sqrt(np.mean((y - curve[inverse]) ** 2))) for curve in curves)


def _between_extremes(means: Array, _counts: IntArray) -> Array:
    """Return some rising curve near the means: halfway between the highest so far and the lowest
    from there on.
    """
    return np.asarray(
        0.5 * (np.maximum.accumulate(means) + np.minimum.accumulate(means[::-1])[::-1])
    )


PLACES = 20  # parts of a stroke at which cycles are compared
WHOLE = 0.25  # of the usual number of samples: a cycle with fewer is a remainder, and left out
PARTS = ("drift", "change", "shape", "rest")  # what errors are parted in


@dataclass(frozen=True)
class ErrorParts:
    """Parts of the errors on the samples of a split: `rms` by `PARTS`, whose squares add up to the
    mean square error.

    `offsets` are the mean errors of the cycles, (cycles,), in order of time.
    """

    split: str
    samples: int
    rms: Mapping[str, float]
    offsets: Array

    @property
    def limit(self) -> str:
        """The largest part."""
        return max(self.rms, key=lambda part: self.rms[part])


def error_parts(
    curves: Sequence[Curve],
    predicted: Sequence[Array],
    target: str,
    driven: str,
    logs: Mapping[str, str],
) -> tuple[ErrorParts, ...]:
    """Return the parts of the errors on training and on held-out samples; nothing of training where
    no log has two cycles of `driven`, nor of held-out samples where there is not one beside these.

    `curves` are pieces of recordings, with (n,) predictions of each; `logs` names the log of each
    recording: cycles go on over gaps.
    """
    columns, count = [], 0
    for pieces, x, y, held in _by_log(curves, logs, driven, target):
        cycle = np.searchsorted(cycle_starts(x), np.arange(len(x)), side="right") - 1
        error = np.concatenate([predicted[number] for number in pieces]) - y
        columns.append((held, error, np.where(cycle < 0, -1, cycle + count), _places(x)))
        count += int(cycle.max(initial=-1)) + 1
    held_out, *samples = (np.concatenate(parts) for parts in zip(*columns, strict=True))
    trained = _means(*_left(~held_out, *samples)[:2])
    found: list[ErrorParts] = []
    for split, rows in (("train", ~held_out), ("validate", held_out)):
        left = _left(rows, *samples)
        if len(left[-1]) > (0 if found else 1):
            found.append(_of_split(split, trained, *left))
    return tuple(found)


def _places(x: Array) -> IntArray:
    """(n,) where a sample lies on its stroke: a part of the range, and whether x rises."""
    low, high = float(x.min()), float(x.max())
    part = np.clip((PLACES * (x - low) / (high - low or 1.0)).astype(np.int64), 0, PLACES - 1)
    return np.asarray(part + PLACES * rising(x))


def _left(
    rows: BoolArray, error: Array, cycle: IntArray, place: IntArray
) -> tuple[Array, IntArray, Array, Array]:
    """Errors less the mean of their cycle, their places, that mean, each (n,); and the mean of
    every cycle.
    """
    rows = rows & np.isfinite(error) & (cycle >= 0)
    counts = np.bincount(cycle[rows], minlength=int(cycle.max(initial=0)) + 1)
    rows &= (counts >= WHOLE * (np.median(counts[counts > 0]) if counts.any() else 1))[
        np.maximum(cycle, 0)
    ]
    cycles, of_cycle = np.unique(cycle[rows], return_inverse=True)
    offsets = _means(error[rows], of_cycle)[: len(cycles)]
    return error[rows] - offsets[of_cycle], place[rows], offsets[of_cycle], offsets


def _of_split(
    split: str, trained: Array, left: Array, place: IntArray, drift: Array, offsets: Array
) -> ErrorParts:
    repeated, known = _means(left, place)[place], trained[place]
    power = float(known @ known)
    again = float(np.clip(repeated @ known / power, 0.0, 1.0)) if power > 0 else 0.0
    shape = again**2 * np.mean(known**2)
    squares = (
        np.mean(drift**2),
        max(np.mean(repeated**2) - shape, 0.0),
        shape,
        np.mean((left - repeated) ** 2),
    )
    return ErrorParts(
        split,
        len(left),
        dict(zip(PARTS, np.sqrt(np.array(squares)).tolist(), strict=True)),
        offsets,
    )


def _means(values: Array, groups: IntArray) -> Array:
    """Mean of each group, (2 `PLACES`,) or more; zero of an empty one."""
    counts = np.bincount(groups, minlength=2 * PLACES)
    sums = np.bincount(groups, values, minlength=2 * PLACES)
    return np.asarray(np.divide(sums, counts, out=np.zeros(len(counts)), where=counts > 0))
