"""Find a clock whose time is divided into several columns, for example hours, minutes and
seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mapmore_cli.annexes.drafting.columns import Table, TitledColumn
from mapmore_cli.annexes.drafting.draft import Column
from mapmore_cli.annexes.drafting.spelling import words
from mapmore_cli.ingestion.clock import MOST_GLITCHES

PARTS = {
    "h": ("h hh hr hrs hour hours std stunde stunden heure heures hora horas ora ore", 3600.0),
    "min": ("m mm min mins minute minutes minuten minuto minutos minuti", 60.0),
    "s": ("s ss sec secs second seconds sek sekunde sekunden segundo segundos secondi", 1.0),
    "ms": ("ms msec millis milli millisecond milliseconds millisekunden milisegundos", 1e-3),
    "us": ("us usec micros microsecond microseconds mikrosekunden", 1e-6),
    "ns": ("ns nsec nsecs nanos nanosec nanosecs nanosecond nanoseconds nanosekunden", 1e-9),
}
"""For each unit of time, from the coarsest to the finest: the words with which titles of columns in
this unit end, and the length of the unit in seconds.
"""


@dataclass(frozen=True)
class ClockPart:
    """A column that may be one part of a clock, for example the seconds, and the unit of its
    numbers.
    """

    column: TitledColumn
    unit: str

    @property
    def second(self) -> float:
        """Length of the unit, in seconds."""
        return PARTS[self.unit][1]

    @property
    def restarts(self) -> bool:
        """Return True if the numbers decrease somewhere."""
        return any((np.diff(x) < 0).any() for x in self.column.values)

    def follows(self, coarser: ClockPart) -> bool:
        """Return True if the numbers suit a part that follows the `coarser` part. For example,
        seconds that follow minutes must all be smaller than 60; if they restart from zero, the
        largest must be at least 30. The same rule holds for other units, with the number of units
        in the coarser unit instead of 60.
        """
        turn = round(coarser.second / self.second)
        highest = max(float(x.max()) for x in self.column.values)
        return highest < turn and (2 * highest >= turn or not self.restarts)


def clock_in_parts(table: Table) -> dict[Column, str]:
    """Return the columns of a clock in parts (for example seconds and nanoseconds) and their units.
    Return an empty dictionary if the titles name no such parts, or if the values do not suit them.
    The numbers of the coarsest part may be any numbers from zero on.
    """
    found: dict[str, ClockPart] = {}
    for one in table.values():
        last = {*words(one.title)[-1:]}
        unit = next((unit for unit, (titles, _) in PARTS.items() if last & {*titles.split()}), "")
        if unit and one.values and all((x >= 0).all() for x in one.values):
            found.setdefault(unit, ClockPart(one, unit))
    parts = [found[unit] for unit in PARTS if unit in found]
    fits = [finer.follows(coarser) for coarser, finer in pairwise(parts)]
    parts = parts[: 1 + [*fits, False].index(False)]
    # only the finest part may have decimal places
    is_whole = all((x == np.round(x)).all() for part in parts[:-1] for x in part.column.values)
    if is_whole and any(part.restarts for part in parts[1:]) and _increases(parts):
        return {part.column.column: part.unit for part in parts}
    return {}


def _increases(parts: Sequence[ClockPart]) -> bool:
    """Return True if the sum of all parts of the clock increases in every file, except for a few
    steps back.
    """
    for numbers in zip(*(part.column.values for part in parts), strict=True):
        if len({*map(len, numbers)}) > 1:
            return False
        times = sum(part.second * x for part, x in zip(parts, numbers, strict=True))
        if np.mean(np.diff(times) < 0) > MOST_GLITCHES:
            return False
    return True
