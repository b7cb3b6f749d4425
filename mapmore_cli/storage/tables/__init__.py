"""Define the requests that every reader of recordings receives, and the tables that it returns."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

from mapmore_cli.domain.arrays import Array, Rows
from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.storage.tables.cells import CellReader

SourceColumn = str | int
"""A column of a file: its name in the header, its 0-based index, or an address such as `run.P`."""


GET_SAMPLES = "Get the file again, or leave it out, because a recording needs samples."
"""What to do with a file that holds no samples."""

WhichTable = int | Literal["map"]
"""The number of a table in a file with several, or `map`."""


@dataclass(frozen=True)
class TableRequest:
    """The wanted columns of a file, and the information that its reader needs.

    - `label`, `columns`: name of the file in messages, and the wanted columns.
    - `header`: number of header lines, the first of which holds the names (text, sheets).
    - `skip_rows`: lines above the header (text, sheets).
    - `delimiter`: one character, `tab`, or `whitespace`: any run of blanks and tabs (text).
    - `decimal`, `thousands`: separators in numbers (texts, and cells that hold texts).
    - `comment`: beginning of lines that are no records (text).
    - `encoding`: encoding of the characters (text); a UTF-8 byte order mark is skipped.
    - `sheet`: title of the sheet, or a glob whose matches are one recording each; None for the
      first visible sheet (workbooks).
    - `hidden`: `keep` or `drop` hidden rows (workbooks).
    - `root`: place from which columns are addressed; `train[*]` makes every element a recording
      (MAT, HDF5).
    - `missing`: texts that mean a missing value, besides the usual ones (text, sheets).
    - `clocks`: columns whose cells may be time stamps; `formats`: formats for `strptime` of some of
      them; `second`: one second in the unit of the clock.
    - `thousands_of`: the mark between thousands, for columns in which it differs from that of the
      table.
    - `texts`: the columns that hold texts, with the number of each text that was read so far.
    - `table`: which of several tables below each other or side by side is read, counted from 1;
      `map` for a map of cells, see `tables/below.py` (text, sheets).
    - `incomplete`: True if incomplete last records count as missing values, False if they are
      errors.
    - `progress`: function that is called from time to time with the number of bytes read (only for
      text, in which long files take long).
    """

    label: str
    columns: tuple[SourceColumn, ...]
    header: int = 1
    skip_rows: int = 0
    delimiter: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    sheet: str | None = None
    root: str | None = None
    missing: frozenset[str] = frozenset()
    incomplete: bool = False
    progress: Callable[[int], None] = lambda _bytes: None
    thousands: str | None = None
    comment: str | None = None
    hidden: str = "keep"
    clocks: frozenset[SourceColumn] = frozenset()
    formats: Mapping[SourceColumn, str] = field(default_factory=dict)
    second: float = 1.0
    table: WhichTable | None = None
    texts: Mapping[SourceColumn, dict[str, float]] = field(default_factory=dict)
    thousands_of: Mapping[SourceColumn, str] = field(default_factory=dict)

    @property
    def marks_of_thousands(self) -> set[str]:
        """Return the thousands separators that occur in any column."""
        return {*filter(None, [self.thousands, *self.thousands_of.values()])}

    def cells(self, column: SourceColumn) -> CellReader:
        """Return the reader of the cells of a column."""
        thousands = self.thousands_of.get(column, self.thousands)
        # if one of point and comma separates thousands, the other is the decimal mark
        other = "," if thousands == "." else "."
        return CellReader(
            self.missing,
            other if thousands == self.decimal else self.decimal,
            thousands,
            column in self.clocks,
            self.formats.get(column),
            self.second,
            texts=self.texts.get(column),
        )


@dataclass(frozen=True)
class Noted:
    """Information that a file contains about one of its columns.

    - `unit`: the unit in the file's spelling; empty if there is none.
    - `step`, `start`: seconds between samples, 0 if unknown, and the time of the first sample.
    - `is_scaled`: True if the numbers were scaled as the file says.
    - `shown`: how the program that wrote the file shows the numbers, if the unit follows from that.
    - `never_written`: number of values for which the file has space, but which were never written.
    """

    unit: str = ""
    step: float = 0.0
    start: float = 0.0
    is_scaled: bool = False
    never_written: int = 0
    shown: str = ""


@dataclass(frozen=True)
class Cut:
    """Evidence that a file is incomplete at its end.

    - `said`, `remedy`: message and remedy if an incomplete file is an error.
    - `done`: how the end of the file is treated if missing values are left out.
    - `rows`: number of rows at the end that cannot be trusted.
    """

    said: str
    remedy: str
    done: str
    rows: int = 0

    def refuse(self, where: str, request: TableRequest) -> None:
        """Raise DataError for an incomplete file, unless missing values are to be left out."""
        if not request.incomplete:
            raise DataError(f"{where}: {self.said}", self.remedy)


@dataclass(frozen=True)
class OpenEnd:
    """End of a text whose last line has no line end. `row` is the number of this line, `rows` are
    the cells of the last lines, and `decimal` is the decimal separator of the text.
    """

    row: int
    rows: Sequence[Sequence[str]]
    decimal: str = "."


IN_MEMORY = "row from 0"
"""Value of `RawTable.place` for samples that were passed as arrays, without a file."""


@dataclass(frozen=True)
class RawTable:
    """Columns as stored in the file, before scaling and conversion.

    `columns` has one array, (n,), for each column of the request, NaN for an empty cell. `label` is
    the name of the table in messages (the file, and the part of it). `titles` holds the titles of
    columns that were renamed, and `doubts` the warnings of the reader. `rows`, (n,), is the number
    of each sample in the file; `place` says what is counted: `row` (line of a text file or row of a
    sheet, counted from 1), `index` (of an array, counted from 0) or `IN_MEMORY`. `element`
    identifies a recording within the file, by a number or the title of its sheet; None if the file
    has only one. `noted` is the information in the file about its columns. `breaks_off`, `open_end`
    and `padding` (a number of characters) describe the end of the file; the gate (`tables/gate.py`)
    decides what follows from them.
    """

    columns: Mapping[Any, Array]
    rows: Rows
    label: str
    place: str = "row"
    element: int | str | None = None
    doubts: tuple[str, ...] = ()
    noted: Mapping[Any, Noted] = field(default_factory=dict)
    breaks_off: Cut | None = None
    open_end: OpenEnd | None = None
    padding: int = 0
    titles: Mapping[str, str] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of samples, n."""
        return len(self.rows)

    def at(self, sample: int) -> str:
        """Return the place of a sample for messages: `a.csv:row 17`."""
        if self.place == IN_MEMORY:
            return f"{self.label}, row {self.rows[sample]} (from 0)"
        return f"{self.label}:{self.place} {self.rows[sample]}"

    def is_empty_at(self, sample: int) -> bool:
        """Return True if a sample has no value at all, or if there is no sample."""
        return not self.size or all(x[sample] != x[sample] for x in self.columns.values())


@dataclass(frozen=True)
class Top:
    """The first rows of a file, read with certain `settings` of `data`. `is_number` returns True
    for cells with numbers.

    `addresses` are the names by which a spec addresses the columns, if the file is a tree of
    arrays. `sheet` is the title of the sheet in a workbook. `units` are the units of all columns,
    if the file gives them outside its rows.
    """

    rows: Sequence[Sequence[Any]]
    is_number: Callable[[Any], bool]
    settings: Mapping[str, Any] = field(default_factory=dict)
    addresses: tuple[str, ...] = ()
    sheet: str | None = None
    units: tuple[str, ...] = ()


@dataclass(frozen=True)
class Reader:
    """A format of recordings. Everything that the program knows about it is declared as `READER` in
    one file of `storage/readers/`.

    - `name`: value of `data.reader`.
    - `read`: function that reads the wanted columns of a file, with one table for every recording
      in it. The gate (`tables/gate.py`) checks its result.
    - `suffixes`: suffixes of such files, in lower case.
    - `keys`: keys of `data` that this reader uses, besides the keys that every reader uses.
    - `column`: example of the name of a column in a spec.
    - `by_index`: True if columns can also be addressed by their 0-based index.
    - `peek`: function that reads the first rows of a file in every way that may be meant, the most
      probable first; without it, `read` is called without columns, which means all columns.
    - `below`: function that returns the tables below each other or side by side in a file, for a
      request without columns.
    - `begins`: regular expression of the first bytes of such files, whatever their names, in which
      a dot is any byte; empty if the format cannot be recognised by them.
    """

    name: str
    read: Callable[[Path, TableRequest], list[RawTable]]
    suffixes: tuple[str, ...]
    keys: tuple[str, ...] = ()
    column: str = "force"
    by_index: bool = True
    peek: Callable[[Path, int], Iterable[Top]] | None = None
    begins: bytes = b""
    below: Callable[[Path, TableRequest], Sequence[Any]] | None = None


def locate_columns(
    request: TableRequest, names: Sequence[str] | None, width: int, hint: str | None = None
) -> dict[SourceColumn, int]:
    """Return the 0-based index of every wanted column in a file of `width` columns.

    `names` are the names in the header, or None if there is no header; `hint` replaces the usual
    remedy if the reader knows a better one. Raises DataError for a column that does not exist, or
    whose name occurs twice in the header. Blanks around a name are ignored.
    """
    label, places = request.label, dict[SourceColumn, int]()
    for column in request.columns:
        if isinstance(column, int):
            if not 0 <= column < width:
                remedy = hint or f"The file has {width} columns, numbered from 0 to {width - 1}."
                raise DataError(f"{label}: there is no column {column}", remedy)
            places[column] = column
        elif names is None:
            what = (
                f"{label}: column '{column}' is given by name, but the spec says that the "
                "file has no header"
            )
            raise DataError(what, f"Give its index (0 to {width - 1}), or set `header: true`.")
        elif column not in names:
            raise DataError(
                f"{label}: there is no column '{column}'",
                hint or known_names(column, list(filter(None, names)), "The header has"),
            )
        else:
            if (count := [name.strip() for name in names].count(column.strip())) > 1:
                what = f"{label}: column '{column}' occurs {count} times in the header"
                raise DataError(what, "Give its 0-based index instead.")
            places[column] = names.index(column)
    return places


def known_names(name: str, known: Sequence[str], introduction: str, most: int = 12) -> str:
    """Return a remedy for a name that does not exist: the most similar name, and the existing
    ones.
    """
    near = [other for other in known if other.lower() == name.lower()] or difflib.get_close_matches(
        name, known, n=1
    )
    guess = f"Did you mean '{near[0]}'? " if near else ""
    more = ", ..." if len(known) > most else ""
    return f"{guess}{introduction}: {', '.join(known[:most])}{more}."


Faults = type[Exception] | tuple[type[Exception], ...]


@contextmanager
def reading(label: str, kind: str, damage: Faults = Exception) -> Iterator[None]:
    """Convert errors that a parser raises for a damaged file into a DataError with the name of the
    file; the name is added to a DataError that lacks it.

    Parsers of binary formats raise a dozen types (KeyError, struct.error, zlib.error, XML errors,
    MemoryError for a length that is nonsense), which all mean the same to the user. A NameError or
    an ImportError is a fault of the program and is passed on.
    """
    try:
        yield
    except MapmoreError as error:
        if label not in error.message:
            error.message = f"{label}: {error.message}"
        raise
    except damage as error:
        # SciPy raises an UnboundLocalError, which is a NameError, for some damaged files
        if isinstance(error, ImportError) or type(error) is NameError:
            raise
        if isinstance(error, OSError) and error.errno is not None:
            raise DataError(
                f"{label}: cannot be read: {error.strerror or error}", "check the path"
            ) from error
        reason = " ".join(str(error).split()) or type(error).__name__
        raise DataError(
            f"{label}: the file is damaged, or is no {kind}: {reason[:150]}",
            "open it in the program that wrote it and save it again; if it was cut off while "
            "copying, get it again",
        ) from error


BOMB_SIZE, BOMB_RATIO = 100_000_000, 200
"""Unpacked size in bytes above which the compression ratio is checked, and the largest ratio that
is allowed. Logs shrink to a tenth, or to a fiftieth at most.
"""


def refuse_bombs(where: str, unpacked: float, packed: int, size: int | None = None) -> None:
    """Raise DataError for data that unpack, or claim to unpack, to more than `size` bytes
    (default `BOMB_SIZE`) and also to more than `BOMB_RATIO` times their packed size.
    """
    if unpacked > max(BOMB_SIZE if size is None else size, BOMB_RATIO * packed):
        sizes = f"from {packed / 1e6:.2g} MB to {unpacked / 1e6:.0f} MB or more"
        raise DataError(
            f"{where} unpacks {sizes}, which could fill the memory",
            "save the measurements only, or unpack the file yourself if this size is right",
        )


def optional_library(module: str, package: str, label: str) -> ModuleType:
    """Import a library that only some formats need. Raises DataError with the command that installs
    it if it is missing.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        what = f"{label}: reading this file needs {package}, which is not installed"
        raise DataError(what, "install it with: pip install 'mapmore[formats]'") from error
