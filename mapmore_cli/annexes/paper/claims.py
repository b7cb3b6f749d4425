"""What papers claim, and what explains a difference, as inequalities of our numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from statistics import fmean

from mapmore_cli.annexes.paper.runs import Row, Runs, as_float, cell_value
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.spec.paper import REFERENCE, RELATION, Shown, Source

CLOSE = 1.25
"""Within which factor numbers are of each other that `~` stands between."""

TAKEN: Mapping[str, Callable[[list[float]], float]] = {"least": min, "greatest": max, "mean": fmean}


class Judge:
    """Says of inequalities whether they hold: each number is that of a row of a source, which is
    read once.
    """

    def __init__(self, runs: Runs, sources: Mapping[str, Source], root: Path) -> None:
        self._runs, self._sources, self._root = runs, sources, root
        self._rows: dict[str, dict[str, Row]] = {}

    def judged(self, shown: Shown) -> tuple[bool, str]:
        """Return whether all inequalities hold, and the numbers that they come to.

        Raises SpecError for a number that is not there.
        """
        chains = [self._chain(text) for text in shown.holds]
        return all(holds for holds, _ in chains), "; ".join(numbers for _, numbers in chains)

    def _chain(self, text: str) -> tuple[bool, str]:
        first, *others = RELATION.split(text)
        value = self.number(first)
        holds, told = True, f"{value:.4g}"
        for relation, side in zip(others[::2], others[1::2], strict=True):
            following = self.number(side)
            holds &= related(value, relation, following)
            told += f" {relation} {following:.4g}"
            value = following
        return holds, told

    def number(self, text: str) -> float:
        """Return the value of one side: references and numbers with arithmetic between them."""
        cells: dict[str, float] = {}

        def named(found: Sequence[str]) -> str:
            name = f"number_{len(cells)}"
            cells[name] = self._referred(*found)
            return name

        written = REFERENCE.sub(lambda match: named(match.groups()), text)
        return as_float(cell_value(written, cells))

    def _referred(self, way: str | None, name: str, row: str, column: str) -> float:
        if name not in self._rows:
            self._rows[name] = self._runs.source_rows(self._sources[name], self._root)
        rows = self._rows[name]
        asked = row.split("|")
        matching = [
            cells for text, cells in rows.items() if any(fnmatchcase(text, one) for one in asked)
        ]
        if not matching or (way is None and len(matching) > 1):
            raise SpecError(
                f"{name}[{row}]: {len(matching)} rows of ours",
                f"name one of {', '.join(rows)}, or write least, greatest or mean before it",
            )
        values = [as_float(cell_value(column, cells)) for cells in matching]
        known = [value for value in values if not math.isnan(value)] if way else values
        return TAKEN[way](known) if way and known else known[0] if known else math.nan


def related(left: float, relation: str, right: float) -> bool:
    """Return whether a relation holds; a number that is missing stands in none."""
    if relation == "~":
        return left * right > 0 and 1 / CLOSE <= left / right <= CLOSE
    return left < right if relation == "<" else left > right
