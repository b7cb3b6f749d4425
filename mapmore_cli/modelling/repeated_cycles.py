"""How well cycles repeat themselves: each held-out cycle beside the last one that trains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.strokes import cycle_starts


def repeated_cycles(curves: Sequence[Curve], target: str, driven: str) -> tuple[Array, ...] | None:
    """The target of the last training cycle of `driven`, again from the beginning of every held-out cycle, `(n_c,)` for every curve.

    Sample stands beside sample, over all pieces of a log in the order of time; NaN in the training data and where a held-out cycle takes
    longer than that one. None where no log has cycles of both kinds, or where curves are no recordings but levels.
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
    trained, held = starts[~held_out[starts]], starts[held_out[starts]]
    if not len(trained) or not len(held):
        return again
    last = y[trained[-1] : held[0]]
    for start, end in zip(held, [*held[1:], len(y)], strict=True):
        n = min(end - start, len(last))
        again[start : start + n] = last[:n]
    return again
