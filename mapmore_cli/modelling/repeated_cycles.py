"""How well cycles repeat themselves: each held-out cycle beside the last one that trains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.strokes import cycle_starts

SAME_COURSE = 0.05
"""Root mean square difference of two cycles' courses, as a part of the range, up to which one repeats the other in time."""


def repeated_cycles(curves: Sequence[Curve], target: str, driven: str) -> tuple[Array, ...] | None:
    """The target of the last training cycle of `driven`, again from the beginning of every held-out cycle, `(n_c,)` for every curve.

    Where the quantity takes the same course in time again, as in a programme of steps, the same moment of that cycle stands beside each
    sample; where it does not, as in loops driven by hand, the same place on the same stroke, rise or fall, which leaves out what a slower
    or faster stroke changes. NaN in the training data, and where a held-out cycle lasts longer or reaches further than that one. None where
    no log has cycles of both kinds, or where curves are no recordings but levels.
    """
    if any(curve.level is not None for curve in curves):
        return None
    found = [np.full(curve.size, np.nan) for curve in curves]
    logs = [curve.recordings[0].partition("#")[0] for curve in curves]
    for log in dict.fromkeys(logs):
        pieces = [number for number, name in enumerate(logs) if name == log]
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
    """The target of the last cycle where it was at `x`, (n,), on the rise for samples before the highest of `x`, else on the fall."""
    values = np.empty(len(x))
    peak, peak_last = int(np.argmax(x)), int(np.argmax(x_last))
    for rows, rows_last in ((slice(peak), slice(peak_last + 1)), (slice(peak, None), slice(peak_last, None))):
        order = np.argsort(x_last[rows_last], kind="stable")
        values[rows] = np.interp(x[rows], x_last[rows_last][order], y_last[rows_last][order], left=np.nan, right=np.nan)
    return values
