"""How well a measurement repeats itself: the floor below which no model can be asked to go."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.cycles import SWING, bin_means, cycle_starts, turning_points

BINS = 200
"""Over the range of a curve: the samples of a branch are averaged in each, so that a dwell counts no more than a passage."""


@dataclass(frozen=True)
class _Branch:
    """Samples of one recording that were measured in one direction, at one set of values of what was held."""

    log: str
    kind: tuple[bool | float, ...]
    rows: IntArray
    means: tuple[Array, Array]  # places along the varying input and mean targets there, (m,) each


def repeats(curves: Sequence[Curve], target: str, inputs: Sequence[str], logs: Mapping[str, str]) -> tuple[Array, ...] | None:
    """Return the mean of the other recordings at the level, coordinate and direction of each sample, `(n_c,)` for every curve.

    Recordings of one curve repeat each other where they agree in every input that was held in them. Each is parted into its rising and its
    falling branch along the one input that varies; a branch is averaged in bins and interpolated between them, never beyond its ends. NaN
    where no other recording has a value. Pieces of one log do not repeat each other; `logs` names the log of each recording.

    None where nothing repeats: with no or several varying inputs, or where the recordings of the samples are unknown.
    """
    along = _varying(curves, inputs)
    if len(along) != 1:
        return None
    held = [name for name in inputs if name != along[0]]
    found = tuple(_of_curve(curve, target, along[0], held, logs) for curve in curves)
    return found if any(np.isfinite(values).any() for values in found) else None


def rising(values: Array) -> BoolArray:
    """Return True where `values` `(n,)`, in order of time, rise; reversals smaller than a tenth of their range do not count."""
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


def _varying(curves: Sequence[Curve], inputs: Sequence[str]) -> list[str]:
    """Return the inputs that move within a recording."""
    spans = {name: [np.ptp(curve.columns[name][rows]) for curve in curves for _, rows in _recordings(curve)] for name in inputs}
    return [name for name in inputs if any(span > 0 for span in spans[name])]


def _of_curve(curve: Curve, target: str, along: str, held: Sequence[str], logs: Mapping[str, str]) -> Array:
    x, y = curve.columns[along], curve.columns[target]
    edges = np.linspace(x.min(), x.max(), BINS + 1)
    branches = list(_branches(curve, x, y, held, edges, logs))
    found = np.full(curve.size, np.nan)
    for branch in branches:
        others = [other for other in branches if other.kind == branch.kind and other.log != branch.log]
        values = np.array([np.interp(x[branch.rows], *other.means, left=np.nan, right=np.nan) for other in others])
        known = np.isfinite(values)
        count = known.sum(axis=0)
        total = np.where(known, values, 0.0).sum(axis=0)
        found[branch.rows] = np.divide(total, count, out=np.full(len(branch.rows), np.nan), where=count > 0)
    return found


def _branches(curve: Curve, x: Array, y: Array, held: Sequence[str], edges: Array, logs: Mapping[str, str]) -> Iterator[_Branch]:
    for name, rows in _recordings(curve):
        up = rising(x[rows])
        at = tuple(float(curve.columns[quantity][rows[0]]) for quantity in held)
        for direction in (True, False):
            members = rows[up == direction]
            if len(members):
                places, means = bin_means(x[members], {"y": y[members]}, edges)
                yield _Branch(logs[name], (direction, *at), members, (places, means["y"]))


SAME_COURSE = 0.05
"""Root mean square difference of two cycles' courses, as a part of the range, up to which one repeats the other in time."""


def repeated_cycles(curves: Sequence[Curve], target: str, driven: str, logs: Mapping[str, str]) -> tuple[Array, ...] | None:
    """Return the target of the last training cycle of `driven`, again from the beginning of every held-out cycle, `(n_c,)` for every curve.

    Where the quantity takes the same course in time again, as in a programme of steps, the same moment of that cycle stands beside each
    sample; where it does not, as in loops driven by hand, the same place on the same stroke, rise or fall, which leaves out what a slower
    or faster stroke changes. NaN in the training data, and where a held-out cycle lasts longer or reaches further than that one. None where
    no log has cycles of both kinds, or where curves are no recordings but levels.
    """
    if any(curve.level is not None for curve in curves):
        return None
    found = [np.full(curve.size, np.nan) for curve in curves]
    names = [logs[curve.recordings[0]] for curve in curves]
    for log in dict.fromkeys(names):
        pieces = [number for number, name in enumerate(names) if name == log]
        x, y = (np.concatenate([curves[number].columns[name] for number in pieces]) for name in (driven, target))
        again = _again(x, y, np.concatenate([curves[number].held_out for number in pieces]))
        ends = np.cumsum([curves[number].size for number in pieces])[:-1]
        for number, values in zip(pieces, np.split(again, ends), strict=True):
            found[number] = values
    return tuple(found) if any(np.isfinite(values).any() for values in found) else None


def _again(x: Array, y: Array, held_out: BoolArray) -> Array:
    starts = cycle_starts(x)
    again = np.full(len(y), np.nan)
    ends = np.append(starts[1:], len(y))
    held = held_out[starts]
    trained = np.flatnonzero(~held[: int(np.argmax(held))]) if held.any() else np.empty(0, dtype=np.int64)
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
    """Return the target of the last cycle at `x`, (n,), on the rise for samples before the highest of `x`, else on the fall."""
    values = np.empty(len(x))
    peak, peak_last = int(np.argmax(x)), int(np.argmax(x_last))
    for rows, rows_last in ((slice(peak), slice(peak_last + 1)), (slice(peak, None), slice(peak_last, None))):
        order = np.argsort(x_last[rows_last], kind="stable")
        values[rows] = np.interp(x[rows], x_last[rows_last][order], y_last[rows_last][order], left=np.nan, right=np.nan)
    return values


WORTH = 0.02
"""Of the largest target, from which a floor is worth a word."""


def floors(x: Sequence[Array], y: Sequence[Array]) -> list[float]:
    """Return the `monotone_floor` of every curve y(x) as a part of the largest target of all; nothing where none is worth a word.

    Samples that all lie near some monotone curve need no nearest one: that takes a solver, which takes long to load.
    """
    largest = max(float(np.abs(values).max()) for values in y)
    if all(_least_error(*curve, _between_extremes) <= WORTH * largest for curve in zip(x, y, strict=True)):
        return []
    found = [monotone_floor(*curve) / largest for curve in zip(x, y, strict=True)]
    return found if max(found) > WORTH else []


def monotone_floor(x: Array, y: Array) -> float:
    """Return the RMSE of the best monotone single-valued curve y(x) through samples `(n,)`: what no static model of x alone goes below.

    Isotonic regression, rising or falling, whichever is nearer; samples of one x count together. A loop has such a floor, and so has noise.
    """
    from scipy.optimize import isotonic_regression

    return _least_error(x, y, lambda means, counts: np.asarray(isotonic_regression(means, weights=counts).x))


def _least_error(x: Array, y: Array, rising: Callable[[Array, IntArray], Array]) -> float:
    """Return the RMSE of a rising or of a falling curve through the mean targets at each x, whichever is nearer."""
    places, inverse, counts = np.unique(x, return_inverse=True, return_counts=True)
    if len(places) == 1:
        return float(np.std(y))
    means = np.bincount(inverse, y) / counts
    curves = rising(means, counts), rising(means[::-1], counts[::-1])[::-1]
    return min(float(np.sqrt(np.mean((y - curve[inverse]) ** 2))) for curve in curves)


def _between_extremes(means: Array, _counts: IntArray) -> Array:
    """Return some rising curve near the means: halfway between the highest so far and the lowest from there on."""
    return np.asarray(0.5 * (np.maximum.accumulate(means) + np.minimum.accumulate(means[::-1])[::-1]))
