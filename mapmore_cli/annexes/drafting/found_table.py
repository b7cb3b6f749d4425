"""Find a table in the first rows of a file: its titles, its units, and its columns of numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise, takewhile
from typing import Any

from mapmore_cli.annexes.drafting.first_lines import COMMENT
from mapmore_cli.annexes.drafting.layout import FileLayout
from mapmore_cli.annexes.drafting.rows import (
    Row,
    are_units,
    filled_by_column,
    nonempty,
    without_brackets,
)
from mapmore_cli.storage.tables import Top
from mapmore_cli.storage.tables.below import MAP_COLUMNS, names_its_line
from mapmore_cli.storage.tables.cells import stamp_of
from mapmore_cli.study.units import is_quantity

REMARKS = ("#", "%", "//", "!")  # beginnings of lines that are remarks instead of data


@dataclass(frozen=True)
class FoundTable:
    """A table in the first rows of a file. From the row with index `first` on, `rows` have `wide`
    cells, with numbers in the columns `numeric`. The first cell of each row in `labelled` says what
    the other cells of the row hold.
    """

    top: Top
    rows: Sequence[Row]
    wide: int
    numeric: tuple[int, ...]
    first: int
    labelled: Sequence[Row] = ()

    @property
    def columns(self) -> list[list[Any]]:
        """The filled cells below the header, one list for each column."""
        return filled_by_column(self.rows[self.first :], self.wide)

    @property
    def top_of_map(self) -> int | None:
        """The index of the first line of a map; None if the table is no map. In a map, the first
        line holds ordered values of one quantity, and the first column holds ordered values of
        another. The corner between them holds no number. If the numbers in the first line are
        consecutive, they are titles, and the table is no map.
        """
        above = [at for at in range(self.first) if nonempty(self.rows[at])]
        if self.labelled:
            return None
        top = self.first if self._is_without_corner(self.first) or not above else above[-1]
        if not self._is_without_corner(top):
            return None
        across = self.rows[top][1:]
        down = [row[0] for row in self.rows[top + 1 :] if len(row) == self.wide]
        steps = [_steps_of(cells) for cells in (across, down)]
        is_ordered = all(len(one) > 1 and (min(one) > 0 or max(one) < 0) for one in steps)
        return top if is_ordered and {*steps[0]} != {1.0} else None

    def _is_without_corner(self, at: int) -> bool:
        """Return True if the row has `wide` cells and the first of them holds no number."""
        row = self.rows[at]
        return len(row) == self.wide and not self.top.is_number(row[0])

    @property
    def rank(self) -> tuple[int, int]:
        """Sort key by which one of several tables is chosen. The best table has the smallest number
        of text columns whose first text contains a digit. Among equals, it has the most rows.
        """
        texts = (cells for place, cells in enumerate(self.columns) if place not in self.numeric)
        doubtful = sum(any(map(str.isdigit, str(cells[0]))) for cells in texts if cells)
        return -doubtful, len(self.rows) - self.first

    def layout(self, reader: str) -> FileLayout:
        """Return the layout of a table in which one line above the numbers has the titles and
        another line the units, or the layout of a map.
        """
        if (top := self.top_of_map) is not None:
            as_map = {**self.top.settings, **({"skip_rows": top} if top else {}), "table": "map"}
            return FileLayout(reader, MAP_COLUMNS, MAP_COLUMNS, as_map, (), (0, 1, 2))
        lines = self.header_lines()
        titled = self.line_of_titles(lines)
        titles = [] if titled is None else lines[titled]
        others = [cells for line, cells in lines.items() if line != titled]
        units = next(filter(self.holds_units, others), [])
        width = 1 + max([*self.numeric, *(place for place, title in enumerate(titles) if title)])
        titles = _padded(titles, width)
        spelt = self._units(_padded(self.top.units, width), _padded(units, width))
        header, skipped = self._header(titled)
        settings = dict(self.top.settings)
        if not self.top.addresses:
            settings |= {} if header == 1 else {"header": header or False}
            settings |= {"skip_rows": skipped} if skipped else {}
        counts = Counter(filter(None, titles)) if header else Counter[str]()
        columns = [title if counts[title] == 1 else at for at, title in enumerate(titles)]
        if header and titled is not None:
            words = {at: line for at, line in lines.items() if line != units}
            titles = _told_apart(titles, counts, words, titled)
        return FileLayout(
            reader,
            self.top.addresses or tuple(columns),
            tuple(titles) if titled is not None else (),
            settings,
            tuple(spelt) if any(spelt) else (),
            self.numeric,
        )

    def _units(self, stored: Sequence[str], written: Sequence[str]) -> list[str]:
        """Return the unit of each column: the unit in `stored` if it is not empty, otherwise the
        unit in the line of units. The unit of a column of time stamps is always `s`, because they
        are read in seconds.
        """
        units = [without_brackets(unit or line) for unit, line in zip(stored, written, strict=True)]
        for place in self.numeric:
            if stamp_of(str(self.columns[place][0]).strip()) is not None:
                units[place] = "s"
        return units

    def _header(self, titled: int | None) -> tuple[int, int]:
        """Return the number of lines in the header, and the number of lines above the header. A
        line of titles that is wider than the table is no header, because it is a remark.
        """
        if titled is None or len(self.rows[titled]) > self.wide:
            return 0, self.first
        last = max(at for at in range(titled, self.first) if nonempty(self.rows[at]))
        return last - titled + 1, titled

    def holds_units(self, line: Sequence[str]) -> bool:
        """Return True for a line of units. Cells above empty columns are ignored, because they may
        say what the line holds, for example `Unit:`.
        """
        return are_units([cell for cell, below in zip(line, self.columns, strict=False) if below])

    def header_lines(self) -> dict[int, list[str]]:
        """Return the lines above the numbers that may be titles or units, by their index, from top
        to bottom. Such a line has a cell above the last column with values, and no filled cell
        beyond the last column of the table.

        Lines are examined from the numbers upwards until one does not fit:

        - Blank lines are skipped as long as no line of titles was found.
        - If a line has one cell more than the table, and its first cell contains only the beginning
          of a remark, for example `#`, this cell is removed.
        - A line with numbers does not fit, unless its cell above an empty column says what the
          numbers are, for example `Count:`.
        - A line that does not fit, but begins like a remark, is skipped.
        """
        lines: dict[int, list[str]] = {}
        last = max(place for place, cells in enumerate(self.columns) if cells)
        labels = [place for place, cells in enumerate(self.columns) if not cells]
        for place in reversed(range(self.first)):
            filled = nonempty(self.rows[place])
            if not filled and all(map(are_units, lines.values())):
                continue
            cells = ["" if cell is None else str(cell).strip() for cell in self.rows[place]]
            if any(self.rows[place] is line for line in self.labelled):
                lines[place] = ["", *cells[1:]]
                continue
            if len(cells) == self.wide + 1 and cells[0] in REMARKS:
                cells = cells[1:]
            has_number = any(map(self.top.is_number, filled)) and not are_units(cells)
            has_number &= not any(cells[place] for place in labels if place < len(cells))
            if filled and not has_number and len(cells) > last and not any(cells[self.wide :]):
                lines[place] = cells
            elif not filled or not str(filled[0]).strip().startswith(REMARKS):
                break
        return dict(sorted(lines.items()))

    def line_of_titles(self, lines: Mapping[int, list[str]]) -> int | None:
        """Return the index of the line that holds the titles of the columns. Return None if no line
        has titles of at least half of the columns of numbers. A line of units is returned only if
        there is no other line.

        If several lines have titles, lines that are no remarks are preferred. Among them, the line
        with the largest number of different texts is returned. (A number with a unit, as in a line
        of settings, is not counted as a text.) If several lines have equally many texts, the first
        of them is returned. If all lines are remarks, the last of them is returned instead.
        """

        def rank(line: int) -> tuple[bool, int, int]:
            is_remark = str(self.rows[line][0]).strip().startswith(REMARKS)
            cells = nonempty(lines[line])
            texts = {
                cell for cell in cells if not self.top.is_number(cell) and not is_quantity(cell)
            }
            return not is_remark, len(texts), line if is_remark else -line

        names = {
            line: nonempty([cells[at] for at in self.numeric]) for line, cells in lines.items()
        }
        naming = [line for line, some in names.items() if 2 * len(some) >= len(self.numeric)]
        titles = [line for line in naming if len(lines) == 1 or not are_units(lines[line])]
        return max(titles or naming[:1], key=rank, default=None)


def table_in(top: Top) -> FoundTable | None:
    """Return the table at the end of the examined rows; None if fewer than two of its columns hold
    numbers.

    Some cells may be empty, a word may stand for a missing number, and whole columns may hold
    words. The very last row may be incomplete, so it is not used; remarks below the table are left
    out.
    """
    rows = top.rows[:-1] if len(top.rows) > 1 else top.rows
    widths = Counter(len(row) for row in rows[len(rows) // 2 :] if nonempty(row))
    if not widths:
        return None
    wide = widths.most_common(1)[0][0]
    rows = rows[: 1 + max(i for i, row in enumerate(rows) if len(row) == wide and nonempty(row))]
    lower = filled_by_column(rows[len(rows) // 2 :], wide)
    numeric = tuple(
        place
        for place, cells in enumerate(lower)
        if 2 * sum(map(top.is_number, cells)) > len(cells)
    )
    labelled = _labelled_lines(rows, wide, top)

    def has_numbers(row: Row) -> bool:
        if len(row) != wide or any(row is line for line in labelled):
            return False
        cells = nonempty([row[place] for place in numeric])
        count = sum(map(top.is_number, cells))
        # a line of units may contain a number too, for example `kPa;1`
        return count > 0 and (count == len(cells) or not are_units([*map(str, cells)]))

    def is_between(place: int) -> bool:
        """Return True for a comment between two rows of the table, and for a row of the table that
        has a remark after its numbers.
        """
        around = rows[max(place - 1, 0)], rows[min(place + 1, len(rows) - 1)]
        is_comment = COMMENT.match(str(rows[place][0]).encode()) is not None
        return all(map(has_numbers, around)) and (is_comment or has_numbers(rows[place][:wide]))

    filled = [place for place, row in enumerate(rows) if nonempty(row)]
    words = (place for place in filled if not has_numbers(rows[place]))
    above = max((place for place in words if not is_between(place)), default=-1)
    first = next((place for place in filled if place > above), None)
    if first is None:
        return None
    below = filled_by_column(rows[first:], wide)
    numeric = tuple(place for place in numeric if below[place])
    return FoundTable(top, rows, wide, numeric, first, labelled) if len(numeric) > 1 else None


def _labelled_lines(rows: Sequence[Row], wide: int, top: Top) -> list[Row]:
    """Return the rows that have `wide` cells and begin with a label: a text that says what the row
    holds, for example `Name:`, `Unit:` or `Count:`.

    Whether a text is a label depends on the first cells in the lower half of the rows. If all of
    these cells are empty, each text is a label, but only if at least three rows at the beginning
    have one. If all of these cells hold numbers, a label must end with a colon or an equals sign.
    Otherwise, there are no labels.
    """
    firsts = nonempty([row[0] for row in rows[len(rows) // 2 :] if len(row) == wide])
    filled = [row for row in rows if nonempty(row)]
    if firsts and all(map(top.is_number, firsts)):
        return [row for row in filled if len(row) == wide and names_its_line(row[0])]
    labelled = [*takewhile(lambda row: nonempty(row[:1]) and len(row) == wide, filled)]
    return labelled if len(labelled) > 2 and not firsts else []


def _told_apart(
    titles: Sequence[str],
    counts: Mapping[str, int],
    lines: Mapping[int, Sequence[str]],
    titled: int,
) -> list[str]:
    """Return titles that are unique as far as possible. `counts` says how often each title occurs.

    A title that occurs several times is replaced by the words of all header `lines` in its column.
    An empty title is replaced by the words in its column below the line of titles, which has the
    index `titled`. The words above this line are not used, because they may be about the whole
    file.
    """
    whole = list[str]()
    for place, title in enumerate(titles):
        words = (cells[place : place + 1] for at, cells in lines.items() if title or at > titled)
        parts = dict.fromkeys(part for cells in words for part in cells if part)
        whole.append(title if counts[title] == 1 else " ".join(parts))
    return whole


def _padded(cells: Sequence[str], width: int) -> list[str]:
    """Return the first `width` cells. If there are fewer cells, append empty ones."""
    return [*cells, *[""] * width][:width]


def _steps_of(cells: Sequence[Any]) -> list[float]:
    """Return the differences between consecutive numbers in cells; an empty list if a cell holds no
    number.
    """
    with suppress(ValueError):
        numbers = [float(str(cell).replace(",", ".")) for cell in cells]
        return [after - before for before, after in pairwise(numbers)]
    return []
