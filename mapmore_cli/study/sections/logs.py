"""Which files are read and how: the keys that `data` and each entry of `join` share, and which
samples are kept.
"""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import datetime
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
    """Samples to keep: those whose quantity fulfils exactly one condition.

    - `quantity`: the quantity, as `force`
    - `abs_below`: its absolute value is below, as `5 N`
    - `below`: it is below, as `500 N`
    - `above`: it is above, as `0 N`
    - `between`: it lies between, both ends kept, as `[0, 500]`
    - `outside`: it lies outside, both ends left out, as `[-1, 1]`
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
        ends = {name: getattr(self, name) or (0.0, 1.0) for name in ("between", "outside")}
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
                    f"`{name}`: the lower end {low:g} lies above the upper end {high:g}",
                    "put the lower end first",
                    name,
                )
                for name, (low, high) in ends.items()
            ),
        ]


def _is_encoding(name: str) -> bool:
    """Return whether Python knows an encoding."""
    try:
        return bool("a".encode(name))
    except (LookupError, ValueError):  # ValueError: a zero byte in the name
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
"""The readers that have a use for a key."""


Thousands = Annotated[str, Field(pattern=f"^[{THOUSANDS}]$")]
TableNumber = Annotated[int, Field(ge=1, le=10_000)]


def fault_of_format(text: str, in_parts: bool = False) -> tuple[str, str] | None:
    """Return what is wrong with a format of stamps, and the remedy: `strptime` cannot read it, or
    it leaves doubts. None if it is right.
    """
    remedy = f"write it as {FORMAT}"
    if in_parts:
        remedy = "say the unit of a number, as `ms`, or the codes of a date, as `%Y-%m-%d`"
    try:
        with catch_warnings(action="ignore"):  # of days without a year
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
    """Where a quantity comes from: `value * scale + offset` in `unit`.

    - `column`: name, 0-based index or address: an address leads into MAT and HDF5 files, as `run.P`
      or `y[:,0]`, and a TDMS channel is `Group/Channel`, as `P [bar]`
    - `unit`: the column's unit; the model's by default, as `bar`
    - `scale`: factor of the values, as `-1`
    - `offset`: what is added to them, as `-101.3 kPa`
    - `rest`: how long every recording rests at its beginning: the mean over that time is taken off,
      as `2 s`
    - `unwrap`: the number at which an encoder begins anew: jumps by more than half of it are such a
      turn; of `time`, `true` goes on where the clock begins anew, at midnight, after an hour, or at
      2^32 of its unit, as `4096`
    - `thousands`: what stands between thousands in this column alone; where that is the decimal
      point of the others, the decimal point here is the other mark, as `"."`
    - `texts`: whether its cells are texts, as `T01`: each text gets a number, from 1 on, in the
      order in which they stand; for `recordings` and `groups`, as `true`
    - `columns`: of `time`, the columns of a clock in parts, which are added, as `[date, hour, min]`
    - `format`: of `time`, how its stamps are written, in the codes of Python's `strptime`; of a
      clock in parts for each, in their order, its unit or these codes, as
      `"%m/%d/%Y %I:%M:%S.%f %p"`
    """

    column: Annotated[str | int, Either()] = ""
    unit: str | None = None
    scale: float = 1.0
    offset: InColumnUnit = 0.0
    rest: Seconds | None = None
    unwrap: Annotated[Annotated[float, Field(gt=0)] | Literal[True], Either()] | None = None
    thousands: Thousands | None = None
    texts: bool = False
    columns: list[Annotated[str | int, Either()]] = []
    format: Annotated[str | list[str], Either()] | None = None

    @property
    def places(self) -> Sequence[str | int]:
        """The columns of the file."""
        return self.columns or [self.column]

    @property
    def _formats(self) -> Sequence[str]:
        """What `format` says of each column."""
        if isinstance(self.format, list):
            return self.format
        return self.format.split() if self.format and self.columns else [self.format or ""]

    @property
    def formats(self) -> dict[str | int, str]:
        """The codes of the columns whose cells are stamps."""
        pairs = zip(self.places, self._formats, strict=False)
        return {place: text for place, text in pairs if "%" in text and text not in CODES}

    @property
    def units_of_parts(self) -> dict[str | int, str]:
        """The unit of each part of a clock; stamps are in s."""
        pairs = zip(self.columns, self._formats, strict=False)
        return {place: CODES.get(text, "s" if "%" in text else text) for place, text in pairs}

    def _contradictions(self) -> Sequence[Row]:
        formats = self._formats if self.format is not None else []
        faults = [fault for text in formats if (fault := self._fault_of(text))]
        return [
            (
                (self.column == "") == (not self.columns),
                "a quantity comes from one `column`, and a clock in parts from `columns`",
                "give one of both, as `column: t`",
                "column",
                "columns",
            ),
            (
                bool(self.columns) and len(self._formats) != len(self.columns),
                f"`format` has {len(self._formats)} parts, and `columns` has {len(self.columns)}",
                'say of each column its unit or the codes of its stamps, as `format: "h min s ms"`',
                "format",
                "columns",
            ),
            (
                bool(self.columns) and self.unit is not None,
                "the parts of a clock have units of their own",
                "remove `unit`: `format` has them",
                "unit",
            ),
            *((True, *fault, "format") for fault in faults[:1]),
        ]

    def _fault_of(self, text: str) -> tuple[str, str] | None:
        """Return what is wrong with a format, or a part of one, and the remedy; None if nothing."""
        if self.columns and (text in CODES or can_convert(text, "s")):
            return None
        return fault_of_format(text, in_parts=bool(self.columns))


CODES = {"%H": "h", "%M": "min", "%S": "s"}
"""Codes of `strptime` of which a column holds nothing but the number."""


class FileEntry(Section):
    """Files with what no column holds.

    - `path`: a glob, as `cycle_*.csv`
    - `set`: quantities that are the same throughout, as `{pressure: 2 bar}`
    - `id`: the recording's id, where one file matches, as `first`
    - `sheet`: the sheet of these workbooks, as `Data`
    - `table`: which one of the tables that stand below each other in these files, from 1, as `2`
    - `columns`: columns that these files call otherwise than `data.columns`, or hold in another
      unit, as `{pressure: {column: "P [bar]", unit: bar}}`
    - `keep`: samples of these files to keep, besides the `keep` of all, as `[{quantity: time,
      above: 2 s}]`
    """

    path: SpecPath
    set: dict[Quantity, OfKey] = {}
    id: str | None = None
    sheet: str | None = None
    table: TableNumber | None = None
    columns: dict[Quantity, SourceColumn] = {}
    keep: list[Keep] = []


class Logs(Section):
    """Files of one kind and the columns in them.

    - `files`: globs that start at the folder of the spec, as `["cycle_*.csv"]`
    - `reader`: the format, as `xlsx`
    - `header`: number of header lines, the first with the names; `true` is one, as `2`
    - `skip_rows`: lines before the header, as `5`
    - `delimiter`: what separates fields: a character, `tab` or `whitespace`, as `";"`
    - `decimal`: the decimal point, as `","`
    - `thousands`: what stands between the thousands of a number, as `"."`
    - `comment`: how lines begin that are comments, which are left out, as `"#"`
    - `encoding`: encoding of the text, as `latin-1`
    - `sheet`: sheet of a workbook, the first that is not hidden by default; of a glob, every sheet
      that matches is a recording of its own, as `"*"`
    - `hidden`: whether rows of a sheet that are hidden, as by a filter, are kept, which is told, or
      left out (`drop`), as `drop`
    - `root`: place in a MAT or HDF5 file from which columns are addressed; with `[*]` at its end
      every element is a recording of its own, except members that have none of the columns; in a
      TDMS file a group, or `[*]` for all, as `runs[*]`
    - `table`: which one of the tables that stand below each other in a file, counted from 1; the
      whole file is one by default, as `2`
    - `columns`: which column holds which quantity, as `{pressure: {column: P, unit: bar}}`
    - `sample_time`: time between samples, which makes the time where no column holds it, as `1 ms`
    - `every`: reads one sample in so many, as `10`
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
    table: TableNumber | None = None
    columns: Annotated[dict[Quantity, SourceColumn], Field(min_length=1)]
    sample_time: Seconds | None = None
    every: Annotated[int, Field(ge=1, le=1_000_000_000)] = 1

    def clocks(self) -> frozenset[str | int]:
        """Return the columns whose cells may be stamps: that of `time`, if no other quantity has
        it.
        """
        others = {at for name, one in self.columns.items() if name != "time" for at in one.places}
        return frozenset({at for one in self.columns.values() for at in one.places} - others)

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
                and any(isinstance(at, int) for one in self.columns.values() for at in one.places),
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
                any(one.format or one.columns or one.unwrap is True for one in others),
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
    """Two quantities that change together, one of each log; `shift: auto` compares them.

    - `first`: the quantity of the first log, as `pressure`
    - `second`: that of the second, as `valve`
    """

    first: Quantity
    second: Quantity


class Join(Logs):
    """A second log of the same tests; its quantities are added to the samples of the first log.

    Samples outside the second log are `missing`. One file serves all recordings; several are
    paired with those of `data.files` in order.

    - `on`: `time` interpolates linearly after `shift` is added; `row` puts row beside row, as `row`
    - `shift`: what is added to the time of the second log; `auto` finds it by the cross-correlation
      of the quantities in `match`, and refuses where it is not sure, as `120 ms`
    - `match`: the quantities that `shift: auto` goes by, as `{first: pressure, second: valve}`
    - `max_gap`: gap of the second log from which on its samples are `missing`, as `0.1 s`
    """

    on: Literal["time", "row"] = "time"
    shift: Annotated[Literal["auto"] | SignedSeconds, Either()] = 0.0
    match: Match | None = None
    max_gap: Seconds | None = None

    @property
    def quantities(self) -> tuple[str, ...]:
        """What it adds to the recording."""
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
