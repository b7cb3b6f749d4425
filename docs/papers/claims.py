"""What papers claim, and what explains a difference, as inequalities of our numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from statistics import fmean

from our_numbers import Row, Runs, as_float, cell_value
from paper import REFERENCE, RELATION, PaperError, Shown, Source

CLOSE = 1.25
"""Within which factor numbers are of each other that `~` stands between."""

TAKEN: Mapping[str, Callable[[list[float]], float]] = {"least": min, "greatest": max, "mean": fmean}


@dataclass(frozen=True)
class Judge:
    """Says of inequalities whether they hold: each number is that of a row of a source, which is
    read once.
    """

    runs: Runs
    sources: Mapping[str, Source]
    root: Path
    _rows: dict[str, dict[str, Row]] = field(default_factory=dict)

    def judged(self, shown: Shown) -> tuple[bool, str]:
        """Return whether all inequalities hold, and the numbers that they come to.

        Raises PaperError for a number that is not there.
        """
        chains = [self._chain(text) for text in shown.inequalities]
        return all(holds for holds, _ in chains), "; ".join(numbers for _, numbers in chains)

    def _chain(self, text: str) -> tuple[bool, str]:
        first, *others = RELATION.split(text)
        value = self.number(first)
        holds, told = True, f"{value:.4g}"
        for relation, side in zip(others[::2], others[1::2], strict=True):
            before, value = value, self.number(side)
            holds &= related(before, relation, value)
            told += f" {relation} {value:.4g}"
        return holds, told

    def number(self, text: str) -> float:
        """Return the value of one side: references and numbers with arithmetic between them."""
        found = [*REFERENCE.finditer(text)]
        cells = {
            f"number_{place}": self._referred(*match.groups()) for place, match in enumerate(found)
        }
        names = iter(cells)
        return as_float(cell_value(REFERENCE.sub(lambda _: next(names), text), cells))

    def _referred(self, way: str | None, name: str, row: str, column: str) -> float:
        if name not in self._rows:
            self._rows[name] = self.runs.source_rows(self.sources[name], self.root)
        rows = self._rows[name]
        asked = row.split("|")
        matching = [
            cells for text, cells in rows.items() if any(fnmatchcase(text, one) for one in asked)
        ]
        if not matching or (way is None and len(matching) > 1):
            raise PaperError(
                f"{name}[{row}]: {len(matching)} rows of ours; name one of {', '.join(rows)}, or "
                "write least, greatest or mean before it"
            )
        values = [as_float(cell_value(column, cells)) for cells in matching]
        known = [value for value in values if not math.isnan(value)] if way else values
        return TAKEN[way](known) if way and known else known[0] if known else math.nan


def related(left: float, relation: str, right: float) -> bool:
    """Return whether a relation holds; a number that is missing stands in none."""
    if relation == "~":
        return left * right > 0 and 1 / CLOSE <= left / right <= CLOSE
    return left < right if relation == "<" else left > right
