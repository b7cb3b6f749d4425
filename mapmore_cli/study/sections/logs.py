"""Define the keys that `data` and each entry of `join` share: which files are read, how they are
read, and which samples are kept.
"""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from math import inf
from typing import TYPE_CHECKING, Annotated, Literal
from warnings import catch_warnings

from pydantic import Field

from mapmore_cli.domain.declared import (
    Difference,
    Either,
    OfKey,
    Seconds,
    of_sibling,
)
from mapmore_cli.storage.readers import READERS
from mapmore_cli.storage.tables.cells import FORMAT, THOUSANDS
from mapmore_cli.study.fields import InColumnUnit, Quantity, Row, Section, SignedSeconds, SpecPath
from mapmore_cli.study.tree import quoted
from mapmore_cli.study.units import can_convert

OfQuantity = Annotated[float, of_sibling("quantity")]
Interval = Annotated[tuple[OfQuantity, OfQuantity], Field(strict=False)]


class Keep(Section):
    """A condition that samples must fulfil to be kept. Give exactly one of the conditions.

    - `quantity`: The quantity that is compared. Example: `force`
    - `abs_below`: Keep samples whose absolute value is below this. Example: `5 N`
    - `below`: Keep samples below this value. Example: `500 N`
    - `above`: Keep samples above this value. Example: `0 N`
    - `between`: Keep samples between these two values, including both. Example: `[0, 500]`
    - `outside`: Keep samples below the first or above the second value; both values themselves are
      left out. Example: `[-1, 1]`
    """

    quantity: str
    abs_below: Annotated[float, Field(gt=0), of_sibling("quantity", Difference)] | None = None
    below: OfQuantity | None = None
    above: OfQuantity | None = None
    between: Interval | None = None
    outside: Interval | None = None

    def _contradictions(self) -> Sequence[Row]:
        conditions = [name for name in type(self).model_fields if name != "quantity"]
        used = [name for name in conditions if getattr(self, name) is not None]
        count = (
            f"only one condition is possible in an entry, and there are two: {quoted(used)}"
            if used
            else "no condition"
        )
        ends = {name: getattr(self, name) or (-inf, inf) for name in ("between", "outside")}
        return [
            (
                len(used) != 1,
                f"`keep` has {count}",
                f"use one of {quoted(conditions)}",
                *[*used[1:], "quantity"],
            ),
            *(
                (
                    low >= high,
                    f"`{name}`: the lower end {low:g} must lie below the upper end {high:g}",
                    "put the lower end first",
                    name,
                )
                for name, (low, high) in ends.items()
            ),
        ]


def _is_encoding(name: str) -> bool:
    """Return True if Python knows an encoding by this name."""
    try:
        return bool("a".encode(name))
    # `codecs.lookup` raises ValueError for a zero byte in the name
    except (LookupError, ValueError):
        return False


if TYPE_CHECKING:
    ReaderName = str
else:
    ReaderName = Literal[tuple(READERS)]

READERS_OF: Mapping[str, tuple[str, ...]] = {
    key: tuple(name for name, reader in READERS.items() if key in reader.keys)
    for key in (
        *("header", "skip_rows", "table", "delimiter", "decimal", "thousands", "comment"),
        *("encoding", "sheet", "hidden", "root"),
    )
}
"""Names of the readers that use a key."""


Thousands = Annotated[str, Field(pattern=f"^[{THOUSANDS}]$")]
TableOfFile = Annotated[Annotated[int, Field(ge=1, le=10_000)] | Literal["map"], Either()]


def fault_of_format(text: str, in_parts: bool) -> tuple[str, str] | None:
    """Return a description of the fault in a format of time stamps, and the remedy. Return None if
    the format is correct. A format is faulty if `strptime` cannot read it, or if it is ambiguous.
    """
    remedy = f"write it, for example, as {FORMAT}"
    if in_parts:
        remedy = (
            "give the unit of a number, for example `ms`, or the codes of a date, for example "
            "`%Y-%m-%d`"
        )
    try:
        # here, it is no fault if a format has a day but no year, about which `strptime` warns
        with catch_warnings(action="ignore"):
            datetime.strptime(datetime(2026, 3, 1).strftime(text), text)
    except (ValueError, re.error) as fault:
        return f"{text!r} is not a format of time stamps: {fault}", remedy
    if (
        "%" not in text
        or (in_parts and text == "%f")
        or ("%I" in text) != ("%p" in text)
        or ("%d" in text and "%y" not in text.lower())
    ):
        words = (
            "a format needs codes such as %H; a 12-hour clock also needs AM or PM (%p), and a day "
            "its year"
        )
        return words, remedy
    return None


class SourceColumn(Section):
    """Source of a quantity: the quantity is `value * scale + offset` in `unit`.

    - `column`: Name of the column, its index counted from 0, or an address. An address leads to an
      array inside a MAT or HDF5 file (`run.P`, `y[:,0]`) or to a TDMS channel (`Group/Channel`).
      Example: `P [bar]`
    - `unit`: Unit of the column; the model's unit of the quantity by default. Example: `bar`
    - `scale`: Factor by which the values are multiplied. Example: `-1`
    - `offset`: Value that is added afterwards. Example: `-101.3 kPa`
    - `rest`: Time at the beginning of every recording in which nothing moves. The mean of the
      values over this time is subtracted. Example: `2 s`
    - `unwrap`: Value at which a counter restarts from zero. A jump by more than half of it counts
      as a restart, so that the values continue. For `time`, `true` lets the time continue when the
      clock restarts: at midnight, after one hour, or after 2^32 units. Example: `4096`
    - `thousands`: Thousands separator of this column only. If the other columns use the same
      character as their decimal separator, the decimal separator of this column is the other one of
      point and comma. Example: `"."`
    - `texts`: Whether the cells are texts, such as `T01`. Every text then gets a number, counted
      from 1 in the order in which the texts first occur. With `down`, an empty cell has the text of
      the cell above it, as in a workbook that names a specimen only in the first of its rows. Use
      the quantity only in `recordings` and `groups`, because its numbers have no meaning as an
      input of a model. Example: `true`
    - `columns`: For `time` only: the columns of a clock that is spread over several columns. Their
      values are added. Example: `[date, hour, min]`
    - `format`: For `time` only: the format of the time stamps, in the codes of Python's `strptime`.
      For a clock in several columns, a list with the unit or the format of each column, in the
      order of `columns`. Example: `"%m/%d/%Y %I:%M:%S.%f %p"`
    """

    column: Annotated[str | int, Either()] = ""
    unit: str | None = None
    scale: float = 1.0
    offset: InColumnUnit = 0.0
    rest: Seconds | None = None
    unwrap: Annotated[Annotated[float, Field(gt=0)] | Literal[True], Either()] | None = None
    thousands: Thousands | None = None
    texts: Annotated[Literal["down"] | bool, Either()] = False
    columns: list[Annotated[str | int, Either()]] = []
    format: Annotated[str | list[str], Either()] | None = None

    @property
    def places(self) -> Sequence[str | int]:
        """The columns of the file that are read for this quantity."""
        return self.columns or [self.column]

    @property
    def _formats(self) -> Sequence[str]:
        """Formats of the columns in `places`, in the same order; an empty text for a column without
        a format.
        """
        if isinstance(self.format, list):
            return self.format
        return self.format.split() if self.format and self.columns else [self.format or ""]

    @property
    def formats(self) -> dict[str | int, str]:
        """Formats of time stamps, by column. Columns that contain plain numbers are left out."""
        pairs = zip(self.places, self._formats, strict=False)
        return {place: text for place, text in pairs if "%" in text and text not in CODES}

    @property
    def units_of_parts(self) -> dict[str | int, str]:
        """Unit of each part of a clock, by column. It is `s` for a part that consists of time
        stamps, because they are converted to seconds.
        """
        pairs = zip(self.columns, self._formats, strict=False)
        return {place: CODES.get(text, "s" if "%" in text else text) for place, text in pairs}

    def _contradictions(self) -> Sequence[Row]:
        formats = self._formats if self.format is not None else []
        faults = [fault for text in formats if (fault := self._fault_of(text))]
        return [
            (
                (self.column == "") == (not self.columns),
                "a quantity comes from one `column`, and a clock in parts from `columns`",
                "give one of the two, for example `column: t`",
                "column",
                "columns",
            ),
            (
                bool(self.columns) and len(self._formats) != len(self.columns),
                f"`format` has {len(self._formats)} parts, and `columns` has {len(self.columns)}",
                (
                    "give the unit of each column, or the codes of its stamps, for example "
                    '`format: "h min s ms"`'
                ),
                "format",
                "columns",
            ),
            (
                bool(self.columns) and self.unit is not None,
                "the parts of a clock already have their units in `format`",
                "remove `unit`",
                "unit",
            ),
            *((True, *fault, "format") for fault in faults),
        ]

    def _fault_of(self, text: str) -> tuple[str, str] | None:
        """Return a description of the fault in a format of time stamps, or in the format of one
        part of a clock, and the remedy; None if there is no fault.
        """
        if self.columns and (text in CODES or can_convert(text, "s")):
            return None
        return fault_of_format(text, in_parts=bool(self.columns))


CODES = {"%H": "h", "%M": "min", "%S": "s"}
"""Unit of the number in a column whose format is a single code of `strptime`."""


class FileEntry(Section):
    """Files, with settings and values that apply to these files only.

    - `path`: Path of the files, with wildcards. Example: `cycle_*.csv`
    - `set`: Quantities that have the same value in all samples of these files. Example: `{pressure:
      2 bar}`
    - `id`: Id of the recording, if `path` matches one file only. Example: `first`
    - `sheet`: Sheet to read, if the files are workbooks. Example: `Data`
    - `table`: Which table to read if a file holds several tables below each other or side by side,
      counted from 1. In a `map`, the first line and the first column hold values of two quantities;
      its columns are called `row`, `column` and `cell`. Example: `2`
    - `columns`: Columns whose name or unit in these files differs from `data.columns`. Example:
      `{pressure: {column: "P [bar]", unit: bar}}`
    - `keep`: Conditions that the samples of these files must fulfil, in addition to `data.keep`.
      Example: `[{quantity: time, above: 2 s}]`
    """

    path: SpecPath
    set: dict[Quantity, OfKey] = {}
    id: str | None = None
    sheet: str | None = None
    table: TableOfFile | None = None
    columns: dict[Quantity, SourceColumn] = {}
    keep: list[Keep] = []


class Logs(Section):
    """Files of one kind, and the columns in them.

    - `files`: Paths of the files, relative to the folder of the spec, with wildcards. Example:
      `["cycle_*.csv"]`
    - `reader`: Format of the files. A reader refuses the keys that it cannot use, for example
      `xlsx` refuses `delimiter`. Example: `xlsx`
    - `header`: Number of header lines, of which the first holds the names of the columns. `true`
      means 1; `false` means that there is none. Example: `2`
    - `skip_rows`: Number of lines above the header that are skipped. Example: `5`
    - `delimiter`: Separator of the fields: a character, `tab` or `whitespace`. Example: `";"`
    - `decimal`: Decimal separator. Example: `","`
    - `thousands`: Thousands separator. Example: `"."`
    - `comment`: Text with which comment lines begin; they are skipped. Example: `"#"`
    - `encoding`: Encoding of the text. Example: `latin-1`
    - `sheet`: Sheet of a workbook. By default, the first sheet that is not hidden is read. With
      wildcards, every sheet that matches is a separate recording. Example: `"*"`
    - `hidden`: What to do with hidden rows of a sheet, for example filtered ones: `keep` them, with
      a warning, or `drop` them. Example: `drop`
    - `root`: Place inside a MAT or HDF5 file from which the columns are addressed. With `[*]` at
      its end, every element with one of the columns is a separate recording. In a TDMS file, the
      name of a group, or `[*]` for all groups. Example: `runs[*]`
    - `table`: Which table to read if a file holds several tables below each other or side by side,
      counted from 1. In a `map`, the first line and the first column hold values of two quantities,
      and every other cell is a sample; its columns are called `row`, `column` and `cell`. By
      default, the whole file is one table. Example: `2`
    - `columns`: Which column holds which quantity. Example: `{pressure: {column: P, unit: bar}}`
    - `sample_time`: Constant time between samples. Give it if no column holds the time. Example: `1
      ms`
    - `every`: Read only every n-th sample. Example: `10`
    """

    files: Annotated[list[Annotated[SpecPath | FileEntry, Either()]], Field(min_length=1)]
    reader: ReaderName = "csv"
    header: Annotated[bool | Annotated[int, Field(ge=1, le=1000)], Either()] = True
    skip_rows: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    delimiter: str = ","
    decimal: Literal[".", ","] = "."
    thousands: Thousands | None = None
    comment: Annotated[str, Field(pattern=r"^[^\w\s\"'+.,-][^\w\s\"']?$")] | None = None
    encoding: str = "utf-8"
    sheet: str | None = None
    hidden: Literal["keep", "drop"] = "keep"
    root: str | None = None
    table: TableOfFile | None = None
    columns: Annotated[dict[Quantity, SourceColumn], Field(min_length=1)]
    sample_time: Seconds | None = None
    every: Annotated[int, Field(ge=1, le=1_000_000_000)] = 1

    def clocks(self) -> frozenset[str | int]:
        """Return the columns that may contain time stamps. These are the columns of `time`, except
        a column from which another quantity is read.
        """
        others = {
            at for name, column in self.columns.items() if name != "time" for at in column.places
        }
        return frozenset({at for column in self.columns.values() for at in column.places} - others)

    def _contradictions(self) -> Sequence[Row]:
        reader, has_time = READERS[self.reader], "time" in self.columns
        others = [column for name, column in self.columns.items() if name != "time"]
        unused = [
            (key, key) for key in READERS_OF if getattr(self, key) != Logs.model_fields[key].default
        ]
        if any(isinstance(entry, FileEntry) and entry.sheet is not None for entry in self.files):
            unused.append(("sheet", "files"))
        return [
            *(
                (
                    key not in reader.keys,
                    f"reader `{self.reader}` cannot use `{key}`",
                    f"remove it: only {quoted(READERS_OF[key], ' and ')} can use it",
                    place,
                )
                for key, place in unused
            ),
            (
                not reader.by_index
                and any(
                    isinstance(at, int) for column in self.columns.values() for at in column.places
                ),
                f"reader `{reader.name}` finds columns by name, not by number",
                f"write `column: {reader.column}`",
                "columns",
            ),
            (
                self.sample_time is not None and has_time,
                "`time` is a column, and `sample_time` also creates it",
                "keep one of the two",
                "sample_time",
            ),
            (
                self.sample_time is None
                and not has_time
                and any(column.rest is not None for column in others),
                "`rest` needs the time",
                "add `time` to `columns`, or `sample_time`",
                "columns",
            ),
            (
                not re.fullmatch(r"tab|whitespace|[^\w\s\"'.+-]|[\t ]", self.delimiter),
                f"{self.delimiter!r} cannot separate fields",
                'write one character, for example `";"`, or `tab`, or `whitespace`',
                "delimiter",
            ),
            (
                self.comment is not None and self.comment.startswith(self.delimiter),
                "a comment begins with the character that also separates the fields",
                'name two different characters, for example `comment: "#"` and `delimiter: ";"`',
                "comment",
            ),
            (
                any(column.format or column.columns or column.unwrap is True for column in others),
                "`format`, `columns` and `unwrap: true` can be used for `time` only",
                "remove them elsewhere",
                "columns",
            ),
            (
                self.thousands in (self.decimal, self.delimiter)
                or (self.delimiter == "whitespace" and (self.thousands or "0").isspace()),
                "the separator of thousands has another meaning too",
                (
                    'use three different characters, for example `decimal: "."`, `thousands: '
                    '","` and `delimiter: ";"`'
                ),
                "thousands",
            ),
            (
                not _is_encoding(self.encoding),
                f"encoding {self.encoding!r} is unknown",
                "write `utf-8`, `utf-16`, `latin-1`, `cp1252`, ...",
                "encoding",
            ),
        ]


class Match(Section):
    """Two quantities, one of each log, that change at the same time. If `shift` is `auto`, the
    shift between the clocks is estimated from the changes of the two quantities.

    - `first`: The quantity in the first log. Example: `pressure`
    - `second`: The quantity in the second log. Example: `valve`
    """

    first: Quantity
    second: Quantity


class Join(Logs):
    """A second log of the same tests. The quantities of the second log are added to the samples of
    the first log.

    At times outside the second log, the values of its quantities are missing. A single file is
    joined to all recordings; several files are paired with the files of `data.files` in their
    order.

    - `on`: How the logs are joined. `time` interpolates the second log linearly, after `shift` was
      added to its time. `row` pairs the rows by their number. Example: `row`
    - `shift`: Time that is added to the clock of the second log, for `on: time` only. `auto`
      estimates it from the cross-correlation of the two quantities in `match`, and stops with an
      error if the estimate is uncertain. Example: `120 ms`
    - `match`: The two quantities from which `shift: auto` estimates the shift. Example: `{first:
      pressure, second: valve}`
    - `max_gap`: Longest gap of the second log that is interpolated, for `on: time` only. In a
      longer gap, the values are missing. Example: `0.1 s`
    """

    on: Literal["time", "row"] = "time"
    shift: Annotated[Literal["auto"] | SignedSeconds, Either()] = 0.0
    match: Match | None = None
    max_gap: Seconds | None = None

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the quantities that the second log adds."""
        return tuple(name for name in self.columns if name != "time")

    def _contradictions(self) -> Sequence[Row]:
        has_time = "time" in self.columns or self.sample_time is not None
        by_row, is_found = self.on == "row", self.shift == "auto"
        second = self.match.second if self.match is not None else ""
        return [
            *super()._contradictions(),
            (
                self.on == "time" and not has_time,
                "a join on time needs the time of the second log",
                "add `time` to its `columns`, or write `on: row`",
                "on",
                "columns",
            ),
            (
                by_row and (self.shift != 0 or self.max_gap is not None),
                "`shift` and `max_gap` need the time, but this join pairs rows",
                "remove them",
                "shift",
                "max_gap",
            ),
            (
                by_row and has_time,
                (
                    "a join on rows takes the time from the first log, so that the second must "
                    "not have one"
                ),
                "remove the second",
                "columns",
            ),
            (
                is_found and self.match is None,
                "`shift: auto` needs two quantities from which the shift can be computed",
                (
                    "add two quantities that change together: `match: "
                    "{first: QUANTITY, second: QUANTITY}`"
                ),
                "shift",
            ),
            (
                not is_found and self.match is not None,
                "`match` has no effect without `shift: auto`",
                "add `shift: auto`, or remove `match`",
                "match",
            ),
            (
                self.match is not None and second not in self.quantities,
                f"the second log has no quantity `{second}`",
                f"name one of {quoted(self.quantities)}",
                "match",
            ),
            (
                not self.quantities,
                "the join adds no quantity",
                "name a column other than `time`",
                "columns",
            ),
            (
                any(
                    isinstance(entry, FileEntry) and (entry.set or entry.id or entry.keep)
                    for entry in self.files
                ),
                "`set`, `id` and `keep` can be used in `data.files` only",
                "move them there",
                "files",
            ),
        ]
