"""Compute the repeatability, from recordings and cycles that repeat each other. No model can be
expected to have a smaller error than the repeatability.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray, root_mean_square
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.cycles import SWING, bin_means, cycle_starts, turning_points

# The range of a curve is divided into this number of bins, and samples are averaged in each bin.
# A long rest at one place then has no more weight than a movement past this place.
BINS = 200


class _Branch(NamedTuple):
    """The samples of one recording in one direction, rising or falling. They have the same values
    of the inputs that are constant within a recording. `means` holds places along the varying
    input, and the mean of the target at each place.
    """

    log: str
    kind: tuple[bool | float, ...]
    rows: IntArray
    means: tuple[Array, Array]


def repeats(
    curves: Sequence[Curve], target: str, inputs: Sequence[str], logs: Mapping[str, str]
) -> tuple[Array, ...] | None:
    """Return for each sample the mean of the other recordings at the same level, at the same value
    of the varying input and in the same direction, shape (n_c,) for every curve.

    Recordings of one curve repeat each other if every constant input has the same value in them.
    Each recording is split into a rising and a falling branch along the single input that varies. A
    branch is averaged in bins, and interpolated linearly between them, but not outside its ends.
    The result is NaN if no other recording has a value there. Pieces of the same log are not
    compared with each other; `logs` gives the log of each recording.

    The result is None if no or several inputs vary, if no recordings repeat each other, or if it is
    unknown to which recordings the samples belong.
    """
    along = [
        name
        for name in inputs
        if any(
            np.ptp(curve.columns[name][rows]) > 0
            for curve in curves
            for _, rows in _rows_by_recording(curve)
        )
    ]
    if len(along) != 1:
        return None
    held = [name for name in inputs if name != along[0]]
    means = tuple(
        _means_of_others(
            list(_branches(curve, target, along[0], held, logs)), curve.columns[along[0]]
        )
        for curve in curves
    )
    return means if any(np.isfinite(values).any() for values in means) else None


def rising_samples(values: Array) -> BoolArray:
    """Return a mask, (n,), of the samples at which `values`, (n,), rise. The values are in the
    order of time. Reversals smaller than a tenth of the range are ignored.
    """
    turns = turning_points(values, SWING * float(np.ptp(values)))
    if len(turns) < 2:
        return np.ones(len(values), dtype=np.bool_)
    run = np.searchsorted(turns[1:-1], np.arange(len(values)), side="right")
    return np.diff(values[turns])[run] > 0


def _rows_by_recording(curve: Curve) -> Iterator[tuple[str, IntArray]]:
    """Yield the id of each recording with its rows, in the order of time."""
    if curve.origin is not None:
        yield from zip(curve.recordings, curve.logs, strict=True)


def _branches(
    curve: Curve, target: str, along: str, held: Sequence[str], logs: Mapping[str, str]
) -> Iterator[_Branch]:
    """Yield the rising and the falling branch of every recording of a curve, averaged in bins."""
    x, y = curve.columns[along], curve.columns[target]
    edges = np.linspace(x.min(), x.max(), BINS + 1)
    for name, rows in _rows_by_recording(curve):
        up = rising_samples(x[rows])
        at = tuple(float(curve.columns[quantity][rows[0]]) for quantity in held)
        for direction in (True, False):
            members = rows[up == direction]
            if len(members):
                places, means = bin_means(x[members], {"y": y[members]}, edges)
                yield _Branch(logs[name], (direction, *at), members, (places, means["y"]))


def _means_of_others(branches: Sequence[_Branch], x: Array) -> Array:
    """Return, for each sample of `branches`, the mean of all branches that belong to other logs,
    (n,). It is evaluated at the value `x` of the varying input at this sample.

    The sum of all branches is computed once, and the branches that belong to the same log as the
    sample are subtracted. The time for one log therefore does not grow with the number of logs.
    """
    means = np.full(len(x), np.nan)
    kinds: dict[tuple[bool | float, ...], dict[str, list[_Branch]]] = {}
    for branch in branches:
        kinds.setdefault(branch.kind, {}).setdefault(branch.log, []).append(branch)
    for logs in kinds.values():
        rows = [np.concatenate([branch.rows for branch in of_log]) for of_log in logs.values()]
        every = [branch for of_log in logs.values() for branch in of_log]
        whole, count = _sum_of(every, x[np.concatenate(rows)])
        ends = np.cumsum([len(places) for places in rows])[:-1]
        parts = zip(logs.values(), rows, np.split(whole, ends), np.split(count, ends), strict=True)
        for of_log, places, of_all, known in parts:
            of_own, own_known = _sum_of(of_log, x[places])
            others = known - own_known
            mean = (of_all - of_own) / np.maximum(others, 1)
            means[places] = np.where(others > 0, mean, np.nan)
    return means


def _sum_of(branches: Sequence[_Branch], at: Array) -> tuple[Array, Array]:
    """Add up all branches at the places `at`. Return the sum, and the number of branches that have
    a value at each place, shape (n,) each.

    A branch consists of straight lines from one mean to the next. The sum at a place is the sum of
    all lines that begin before this place, minus the sum of all lines that end before it. Both sums
    are computed for all places at once, as cumulative sums. Extended precision is used, because
    steep lines would leave rounding errors.
    """
    lines = [
        (x, np.append(x[1:], np.nextafter(x[-1], np.inf)), y, np.append(np.diff(y) / np.diff(x), 0))
        for x, y in (branch.means for branch in branches)
    ]
    begin, end, y, slope = map(np.concatenate, zip(*lines, strict=True))
    edges = np.concatenate([begin, end])
    order = np.argsort(edges, kind="stable")
    upto = np.searchsorted(edges[order], at, side="right")

    def running(values: NDArray[np.floating]) -> NDArray[np.longdouble]:
        sums = np.cumsum(np.concatenate([values, -values])[order], dtype=np.longdouble)
        return np.append(np.longdouble(0), sums)[upto]

    offset = running(y - slope.astype(np.longdouble) * begin)
    whole = offset + running(slope) * at
    return whole.astype(np.float64), running(np.ones(len(y))).astype(np.float64)


# Two cycles have the same course in time if their driven inputs differ little at equal times:
# the root mean square difference is at most this fraction of the range of the input.
SAME_COURSE = 0.05


def repeated_cycles(
    curves: Sequence[Curve], target: str, driven: str, logs: Mapping[str, str]
) -> tuple[Array, ...] | None:
    """Return the target of the last training cycle at the samples of every held-out cycle, shape
    (n_c,) for every curve. A cycle is a rise and a fall of the quantity `driven`.

    If a held-out cycle has the same course in time as the training cycle, for example in a
    programme of steps, each sample is compared with the training cycle at the same time after the
    beginning. Otherwise, for example for loops that are driven by hand, it is compared with the
    training cycle at the same value of `driven` and in the same direction (rise or fall).

    The result is NaN for training data, and for samples of a held-out cycle that lasts longer or
    reaches farther than the training cycle. Instead of arrays, None is returned if no log has both
    training and held-out cycles, or if curves are levels instead of recordings.
    """
    if any(curve.level is not None for curve in curves):
        return None
    again = [np.full(curve.size, np.nan) for curve in curves]
    for pieces, x, y, held_out in by_log(curves, logs, driven, target):
        ends = np.cumsum([curves[number].size for number in pieces])[:-1]
        for number, values in zip(pieces, np.split(_again(x, y, held_out), ends), strict=True):
            again[number] = values
    return tuple(again) if any(np.isfinite(values).any() for values in again) else None


def by_log(
    curves: Sequence[Curve], logs: Mapping[str, str], driven: str, target: str
) -> Iterator[tuple[list[int], Array, Array, BoolArray]]:
    """Yield the data of each log, which may consist of several curves: the numbers of these curves,
    and their columns `driven`, `target` and `held_out`. The columns of all curves of the log are
    joined in their order.
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
        if root_mean_square(difference) <= SAME_COURSE * np.ptp(x):
            again[start : start + n] = y[last][:n]
        else:
            again[start:end] = _on_strokes(x[start:end], x[last], y[last])
    again[~held_out] = np.nan
    return again


def _on_strokes(x: Array, x_last: Array, y_last: Array) -> Array:
    """Return the target of the last training cycle at the values `x`, (n,), of a held-out cycle.
    For samples before the maximum of `x`, the rising branch of the training cycle is interpolated.
    For later samples, the falling branch is interpolated.
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


WORTH = 0.02  # floors are reported only if the largest exceeds this fraction of the largest target


def floors(x: Sequence[Array], y: Sequence[Array]) -> list[float]:
    """Return the `monotone_floor` of every curve y(x), as a fraction of the largest target over all
    curves. Return an empty list if no floor is larger than `WORTH`.
    """
    largest = max(float(np.abs(values).max()) for values in y) or 1.0
    shares = [monotone_floor(*curve) / largest for curve in zip(x, y, strict=True)]
    return shares if max(shares) > WORTH else []


def monotone_floor(x: Array, y: Array) -> float:
    """Return the RMSE of the best monotone single-valued curve y(x) through samples, (n,). No
    static model of x alone can have a smaller error if its curve is monotone.

    The best curve is found by isotonic regression; it rises or falls, depending on which gives the
    smaller error. Samples with the same x are averaged for the fit. The floor is not zero, because
    of hysteresis and noise.
    """
    from scipy.optimize import isotonic_regression

    _, inverse, counts = np.unique(x, return_inverse=True, return_counts=True)
    means = np.bincount(inverse, y) / counts
    curves = (
        np.asarray(isotonic_regression(means, weights=counts, increasing=way).x)
        for way in (True, False)
    )
    return min(root_mean_square(y - curve[inverse]) for curve in curves)
