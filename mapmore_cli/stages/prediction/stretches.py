"""Stretches of a table that belong together: a recording without a gap, over which rates and directions are known."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.signals.sampling import find_gaps, pieces, typical_step
from mapmore_cli.stages.prediction.records import Row

RECORDING = "recording"
"""The column that tells recordings apart, where a table has it."""

GAP = 10
"""Times the usual step: a longer one is a gap, after which nothing of the past is known."""


def recordings(rows: Iterator[Row], names: Sequence[str]) -> Iterator[list[Row]]:
    """Yield the rows of one recording at a time: it ends where the column `recording` changes, or where time is set back."""
    mark = names.index(RECORDING) if RECORDING in names else None
    clock = names.index("time")
    block: list[Row] = []
    last: tuple[str | None, float] = (None, -np.inf)
    for row in rows:
        if len(row.cells) == len(names):
            name, time = None if mark is None else row.cells[mark], _time(row.cells[clock])
            if block and (name != last[0] or time < last[1]):
                yield block
                block = []
            last = (name, last[1] if np.isnan(time) and block else time)
        block.append(row)
    if block:
        yield block


def _time(cell: str) -> float:
    """The time in a field; NaN for what the later, strict reading will report."""
    try:
        return float(cell)
    except ValueError:
        return np.nan


def stretches(time: Array) -> list[slice]:
    """The parts of a recording between its gaps, by its finite times, (n,) and never decreasing."""
    if len(time) < 2:
        return [slice(0, len(time))]
    return pieces(len(time), find_gaps(time, GAP * typical_step(time)).after)
