"""Read LabVIEW measurement files (.lvm): texts that state their own separator and decimal point,
with one or several segments. The first column is the time `X_Value`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, pairwise
from pathlib import Path

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import (
    GET_SAMPLES,
    Noted,
    OpenEnd,
    RawTable,
    Reader,
    TableRequest,
    Top,
    locate_columns,
    reading,
)
from mapmore_cli.storage.tables.cells import holds_number, number_of, stamp_of
from mapmore_cli.storage.tables.lines import LAST_LINES, guess_encoding, open_lines
from mapmore_cli.storage.tables.members import refuse_other_clocks
from mapmore_cli.storage.tables.rows import Row, table_of_rows

BEGINS, TIME = "LabVIEW Measurement", "X_Value"
KIND = f"{BEGINS} file"


@dataclass(frozen=True)
class LvmSegment:
    """A segment of a file: a header and the rows of cells below it.

    - `entries`: entries of the header for each channel, by keyword.
    - `titles`: titles of all columns.
    - `rows`: rows of cells, each with its line number.
    - `open_end`: last lines of the file, if the last line has no line break at its end. Only the
      last segment has it.
    - `padding`: number of fill characters at the end of the file. Only the last segment has it.
    """

    entries: Mapping[str, Sequence[str]]
    titles: list[str]
    rows: Sequence[Row]
    open_end: OpenEnd | None = None
    padding: int = 0

    def of_channel(self, keyword: str, channel: int = 0) -> str:
        """Return the entry of the header with this keyword for a channel; an empty text if there is
        none.
        """
        return next(iter(self.entries.get(keyword, ())[channel:]), "").strip()

    @property
    def decimal(self) -> str:
        """Decimal mark of the numbers."""
        return self.of_channel("Decimal_Separator") or "."

    def number(self, keyword: str, channel: int = 0) -> float:
        """Return the number that stands behind `keyword` in the header, for the given channel.
        Return 0 if the header has no such number.
        """
        number = number_of(self.of_channel(keyword, channel), self.decimal)
        return number if number is not None and np.isfinite(number) else 0.0

    def noted(self, place: int) -> Noted:
        """Return the information in the file about the column with the index `place`."""
        if self.titles[place] == TIME:
            return Noted("s")
        # a column of times stands either before every channel or before the first channel only
        channel = place // 2 if self.of_channel("X_Columns") == "Multi" else place - 1
        step, start = self.number("Delta_X", channel), self.number("X0", channel)
        return Noted(self.of_channel("Y_Unit_Label", channel), step, start)

    @property
    def began(self) -> float:
        """Time at which `X_Value` is zero, in seconds since 1970. It is 0 if the header gives no
        date, or if `X_Value` itself is an absolute time.
        """
        stamp = stamp_of(f"{self.of_channel('Date')} {self.of_channel('Time')}")
        return 0.0 if stamp is None or self.of_channel("Time_Pref") == "Absolute" else stamp[1]

    def timed_rows(self, since: float) -> list[Row]:
        """Return the rows with their times in seconds after `since`. If no column holds the times,
        they are computed from the start and the time step in the header.
        """
        first, step = self.number("X0"), self.number("Delta_X")
        places = [place for place, title in enumerate(self.titles) if title == TIME]
        later, is_told = self.began - since, self.of_channel("X_Columns") == "No"
        rows = list[Row]()
        for count, (number, row) in enumerate(self.rows):
            cells = [first + count * step, *row[1:]] if is_told else list(row)
            for place in places:
                time = number_of(cells[place], self.decimal) if place < len(cells) else None
                if time is not None:
                    cells[place] = time + later
            rows.append((number, cells))
        return rows


def read_lvm(path: Path, request: TableRequest) -> list[RawTable]:
    """Read the wanted columns. Consecutive segments with the same titles and increasing time are
    one recording.

    `X_Value` is in seconds since the first segment began. Raises DataError if the file is of
    another kind, a column is missing, or a cell is not a number.
    """
    label = request.label
    with reading(label, KIND):
        segments = [segment for segment in _lvm_segments(path, label) if segment.rows]
        if not segments:
            raise DataError(f"{label}: has no samples", GET_SAMPLES)
        recordings: list[tuple[LvmSegment, list[Row]]] = []
        for segment in segments:
            rows = segment.timed_rows(segments[0].began)
            if recordings and _goes_on(*recordings[-1], segment, rows):
                whole = recordings.pop()[1]
                # the list is extended, because copying all rows for each segment would take long
                whole.extend(rows)
                rows = whole
            recordings.append((segment, rows))
        tables = [_one_recording(segment, rows, request) for segment, rows in recordings]
    if len(tables) > 1:
        tables = [replace(table, element=number) for number, table in enumerate(tables)]
    announced, there = int(segments[-1].number("Samples")), len(segments[-1].rows)
    doubt = (
        f"{label}: its header announces {announced} samples, of which {there} are there; get the "
        "complete file if you can"
    )
    return [replace(tables[0], doubts=(doubt,) if there < announced else ()), *tables[1:]]


def _goes_on(
    before: LvmSegment, rows: Sequence[Row], segment: LvmSegment, further: Sequence[Row]
) -> bool:
    """Return True if a segment continues the segment before it: both have the same titles, and all
    times in the later segment are larger.
    """
    if before.titles != segment.titles:
        return False
    last, first = rows[-1][1][0], further[0][1][0]
    return isinstance(last, float) and isinstance(first, float) and last < first


def _one_recording(segment: LvmSegment, rows: Sequence[Row], request: TableRequest) -> RawTable:
    names, request = segment.titles, replace(request, decimal=segment.decimal)
    places = locate_columns(request, names, len(names))
    noted = {column: segment.noted(place) for column, place in places.items()}
    refuse_other_clocks(noted, request.label)
    table = table_of_rows(rows, places, names, request, request.label)
    return replace(table, noted=noted, open_end=segment.open_end, padding=segment.padding)


def peek_lvm(path: Path, most: int) -> Iterable[Top]:
    """Return the titles and the first rows of the first segment."""
    with reading(path.name, KIND):
        for segment in _lvm_segments(path, path.name, most)[:1]:
            rows, width = segment.timed_rows(segment.began), len(segment.titles)
            return [
                Top(
                    [segment.titles, *([*cells, *[""] * width][:width] for _, cells in rows)],
                    partial(holds_number, decimal=segment.decimal),
                    units=tuple(segment.noted(place).unit for place in range(width)),
                )
            ]
    return []


def _lvm_segments(path: Path, label: str, most: int | None = None) -> list[LvmSegment]:
    """Return the segments in the first `most` lines of a file, or all segments if `most`
    is None.
    """
    with open_lines(path, guess_encoding(path), label, errors="replace") as (whole, _):
        lines = [line.rstrip("\r\n") for line in islice(whole, most)]
    if not lines or not lines[0].startswith(BEGINS):
        raise ValueError(f"it does not begin with '{BEGINS}'")
    marks = (line[len("Separator")] for line in lines if re.match(r"Separator\W", line))
    mark = next(marks, "\t")
    numbered = enumerate((line.split(mark) for line in lines), start=1)
    rows = [(number, cells) for number, cells in numbered if any(map(str.strip, cells))]
    starts = [place for place, (_, cells) in enumerate(rows) if cells[0] == "Channels"] or [0]
    general = {cells[0]: cells[1:] for _, cells in rows[: starts[0]]}
    segments = []
    for begin, end in pairwise([*starts, len(rows)]):
        ends = [at for at in range(begin, end) if rows[at][1][0] == "***End_of_Header***"]
        if ends and ends[-1] + 1 < end:
            entries = general | {cells[0]: cells[1:] for _, cells in rows[begin : ends[-1]]}
            titles = [title.strip() for title in rows[ends[-1] + 1][1]]
            segments.append(LvmSegment(entries, titles, rows[ends[-1] + 2 : end]))
    for last in segments[-1:]:
        cells = [cells for _, cells in last.rows[-LAST_LINES:]]
        cut = OpenEnd(len(lines), cells, last.decimal) if whole.is_open else None
        segments[-1] = replace(last, open_end=cut, padding=whole.padding)
    return segments


READER = Reader("lvm", read_lvm, suffixes=(".lvm",), peek=peek_lvm, begins=BEGINS.encode())
