"""LabVIEW measurement files (.lvm): text that says its own separator and decimal point, in one
segment or several; the first column is the time `X_Value`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, takewhile
from pathlib import Path

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import (
    Noted,
    RawTable,
    Reader,
    TableRequest,
    Top,
    locate_columns,
    reading,
)
from mapmore_cli.storage.tables.cells import holds_number, number_of, stamp_of
from mapmore_cli.storage.tables.lines import guess_encoding, open_lines
from mapmore_cli.storage.tables.members import refuse_other_clocks
from mapmore_cli.storage.tables.rows import Row, table_of_rows

BEGINS = "LabVIEW Measurement"
KIND, END, TIME = f"{BEGINS} file", "***End_of_Header***", "X_Value"


@dataclass(frozen=True)
class Segment:
    """Rows below one header: what was `said` there of each channel by keyword, the decimal point,
    the titles of all columns, and the rows of cells.
    """

    said: Mapping[str, Sequence[str]]
    decimal: str
    titles: list[str]
    rows: list[Row]

    def of_channel(self, keyword: str, channel: int = 0) -> str:
        """Return what the header says of a channel; empty where it says nothing."""
        return next(iter(self.said.get(keyword, ())[channel:]), "").strip()

    def number(self, keyword: str, channel: int = 0) -> float:
        """Return a number that the header says of a channel; 0 where it says none."""
        number = number_of(self.of_channel(keyword, channel), self.decimal)
        return number if number is not None and np.isfinite(number) else 0.0

    def noted(self, place: int) -> Noted:
        """Return what the file says of a column: `X_Value` is in seconds, but for a spectrum."""
        is_timed = self.of_channel("X_Dimension") in ("", "Time")
        if self.titles[place] == TIME:
            return Noted("s" if is_timed else self.of_channel("X_Unit_Label"))
        # every channel has a column of times before it, or the first has
        channel = place // 2 if self.of_channel("X_Columns") == "Multi" else place - 1
        step, start = (is_timed * self.number(key, channel) for key in ("Delta_X", "X0"))
        return Noted(self.of_channel("Y_Unit_Label", channel), step, start)

    @property
    def began(self) -> float:
        """Seconds since 1970 that `X_Value` counts from; 0 where it counts from no date."""
        stamp = stamp_of(f"{self.of_channel('Date')} {self.of_channel('Time')}")
        return 0.0 if stamp is None or self.of_channel("Time_Pref") == "Absolute" else stamp[1]

    @property
    def timed_rows(self) -> Iterator[Row]:
        """The rows with their times, which the header tells where no column does."""
        first, step = self.number("X0"), self.number("Delta_X")
        for count, (number, cells) in enumerate(self.rows):
            no_column = self.of_channel("X_Columns") == "No"
            yield number, [first + count * step, *cells[1:]] if no_column else cells


def read_lvm(path: Path, request: TableRequest) -> list[RawTable]:
    """Read the wanted columns. Segments whose time goes on are one recording.

    `X_Value` is in seconds since the first segment began. Raises DataError for no such file, a
    missing column, or a cell that is not a number.
    """
    with reading(request.label, KIND):
        segments = [one for one in _segments(path, request.label) if one.rows]
        if not segments:
            raise DataError(f"{request.label}: has no samples")
        request = replace(request, decimal=segments[0].decimal)
        recordings: list[list[RawTable]] = []
        last = np.inf
        for segment in segments:
            later = segment.began - segments[0].began
            times = _table(segment, replace(request, columns=(0,)), later).columns[0]
            recordings = recordings if last < times[0] else [*recordings, []]
            recordings[-1].append(_table(segment, request, later))
            last = times[-1]
    tables = [_joined(parts) for parts in recordings]
    if len(tables) > 1:
        tables = [
            replace(table, label=f"{table.label}[{number}]", element=number)
            for number, table in enumerate(tables)
        ]
    announced, there = int(segments[-1].number("Samples")), len(segments[-1].rows)
    told = (
        f"{request.label}: {there} of the {announced} samples that its header announces are there"
    )
    return [replace(tables[0], doubts=(told,) if there < announced else ()), *tables[1:]]


def _segments(path: Path, label: str, most: int | None = None) -> list[Segment]:
    """Return the segments in the first lines of a file, all where `most` is None."""
    segments: list[Segment] = []
    with open_lines(path, guess_encoding(path), label, errors="replace") as (whole, _):
        lines = islice(whole, most)
        head = list(takewhile(lambda line: not line.startswith(END), lines))
        if not head or not head[0].startswith(BEGINS):
            raise ValueError(f"it does not begin with '{BEGINS}'")
        parts = [re.match(r"(\w+)(\W)([^\r\n]*)", line) for line in head]
        said = {part[1]: (part[2], part[3].split(part[2])) for part in parts if part}
        mark, (word, *_) = said.get("Separator", ("\t", ["Tab"]))
        separator = {"Tab": "\t", "Comma": ","}.get(word, mark)
        decimal = said.get("Decimal_Separator", ("", ["."]))[1][0] or ","
        general = {key: texts for key, (_, texts) in said.items()}
        header: dict[str, list[str]] | None = {}
        for number, line in enumerate(lines, start=len(head) + 2):
            cells = line.rstrip("\r\n").split(separator)
            if cells[0] == "Channels":
                header = {}
            if header is not None:
                header[cells[0]] = cells[1:]
                if cells[0] == END:
                    segments.append(Segment(general | header, decimal, [], []))
                    header = None
            elif any(map(str.strip, cells)):
                if segments[-1].titles:
                    segments[-1].rows.append((number, cells))
                else:
                    segments[-1].titles.extend(map(str.strip, cells))
    return segments


def _table(segment: Segment, request: TableRequest, later: float) -> RawTable:
    """Return the columns of a segment that began so many seconds later than the first."""
    names = segment.titles
    places = locate_columns(request, names, len(names))
    table = table_of_rows(segment.timed_rows, places, names, request, request.label)
    noted = {column: segment.noted(place) for column, place in places.items()}
    refuse_other_clocks(noted, request.label)
    columns = {
        column: values + later if names[places[column]] == TIME else values
        for column, values in table.columns.items()
    }
    return replace(table, columns=columns, noted=noted)


def _joined(parts: Sequence[RawTable]) -> RawTable:
    """Return the tables one behind another as one recording."""
    columns = {
        column: np.concatenate([part.columns[column] for part in parts])
        for column in parts[0].columns
    }
    rows = np.concatenate([part.rows for part in parts])
    return replace(parts[0], columns=columns, rows=rows)


def peek_lvm(path: Path, most: int) -> Iterable[Top]:
    """Return the titles and the first rows of the first segment."""
    with reading(path.name, KIND):
        for segment in _segments(path, path.name, most)[:1]:
            units = tuple(segment.noted(place).unit for place in range(len(segment.titles)))
            rows = [segment.titles, *(cells for _, cells in segment.timed_rows)]
            return [Top(rows, partial(holds_number, decimal=segment.decimal), units=units)]
    return []


READER = Reader("lvm", read_lvm, suffixes=(".lvm",), peek=peek_lvm, begins=BEGINS.encode())
