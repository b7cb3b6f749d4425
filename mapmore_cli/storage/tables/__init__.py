"""Define what readers of recordings receive and return: a request for columns of a file, and tables
with the values of these columns.
"""

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
"""Number of the table to read in a file with several tables, or `map` for a map of cells."""


@dataclass(frozen=True)
class TableRequest:
    """The wanted columns of a file, and the information that its reader needs. If a field applies
    only to some formats, they are named in parentheses.

    - `label`, `columns`: name of the file in messages, and the wanted columns.
    - `header`: number of header lines, the first of which holds the names (text, sheets).
    - `skip_rows`: number of lines above the header (text, sheets).
    - `delimiter`: character between fields, or `tab`, or `whitespace` for one or more blanks and
      tabs (text).
    - `decimal`, `thousands`: decimal mark and thousands separator of numbers that are stored as
      text.
    - `comment`: characters with which a comment line begins (text).
    - `encoding`: encoding of the characters (text); a UTF-8 byte order mark is skipped.
    - `sheet`: title of the sheet to read; None for the first visible sheet. A glob selects several
      sheets, and each of them is a recording (workbooks).
    - `hidden`: `keep` or `drop` hidden rows (workbooks).
    - `root`: address below which columns are searched; `train[*]` makes every element of `train` a
      recording (trees of arrays such as MAT and HDF5).
    - `missing`: texts that mean a missing value, besides the usual ones (text, sheets).
    - `clocks`: columns whose cells may be time stamps.
    - `formats`: formats of the time stamps of some of these columns, as for `strptime`.
    - `second`: length of one second in the unit of the time column.
    - `thousands_of`: thousands separators of columns in which it differs from `thousands`.
    - `texts`: the columns that hold texts, with the number that represents each text read so far.
    - `table`: number of the table to read, counted from 1, if several stand below each other or
      side by side; `map` for a map of cells, see `tables/below.py` (text, sheets).
    - `incomplete`: True if incomplete records at the end are treated as missing values, False if
      they are errors.
    - `progress`: function that is called from time to time with the number of bytes read (only for
      text, because reading long text files takes long).
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
        """Return the thousands separators of all columns."""
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
    - `step`: time between samples in s; 0 if unknown.
    - `start`: time of the first sample in s.
    - `is_scaled`: True if the reader has already scaled the numbers as the file demands.
    - `shown`: for messages, how the program that wrote the file shows the numbers, if their unit is
      known only from this (for example per cent); otherwise empty.
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

    - `said`, `remedy`: text and remedy of the error that is raised if missing values are errors.
    - `done`: text for the warning if missing values are left out; it says how the end of the file
      is treated.
    - `rows`: number of rows at the end that may be wrong.
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
    """The last lines of a text that does not end with a line break, so that its last line may be
    incomplete. `row` is the number of the last line, `rows` are the cells of the last lines, and
    `decimal` is the decimal mark.
    """

    row: int
    rows: Sequence[Sequence[str]]
    decimal: str


IN_MEMORY = "row from 0"
"""Value of `RawTable.place` for samples that were passed as arrays, without a file."""


@dataclass(frozen=True)
class RawTable:
    """Columns as stored in the file, before scaling and conversion.

    - `columns`: array of each column of the request, (n,), with NaN for an empty cell.
    - `rows`: number of each sample in the file, (n,).
    - `label`: name of the table in messages (the file, and the part of it).
    - `place`: what `rows` counts: `row` (lines of a text file or rows of a sheet, from 1), `index`
      (elements of an array, from 0) or `IN_MEMORY`.
    - `element`: number or title of the recording in the file; None if the file has only one.
    - `doubts`: warnings of the reader.
    - `noted`: information in the file about its columns.
    - `breaks_off`, `open_end`, `padding`: evidence that the file is incomplete, its last lines, and
      the number of fill characters at its end. The gate (`tables/gate.py`) uses them to decide
      whether rows at the end are left out or an error is raised.
    - `titles`: titles of columns that were renamed.
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
        """Return True if all values of a sample are missing, or if the table has no samples."""
        return not self.size or all(x[sample] != x[sample] for x in self.columns.values())


@dataclass(frozen=True)
class Top:
    """The first rows of a file, and how they were read.

    - `rows`: the rows of cells, including the header.
    - `is_number`: function that returns True for cells with numbers.
    - `settings`: settings of the section `data` with which the file was read.
    - `addresses`: addresses of the columns in a spec, if the file is a tree of arrays.
    - `sheet`: title of the sheet in a workbook.
    - `units`: units of all columns, if the file gives them outside its rows.
    """

    rows: Sequence[Sequence[Any]]
    is_number: Callable[[Any], bool]
    settings: Mapping[str, Any] = field(default_factory=dict)
    addresses: tuple[str, ...] = ()
    sheet: str | None = None
    units: tuple[str, ...] = ()


@dataclass(frozen=True)
class Reader:
    """A format of recordings. Everything that the program knows about a format is declared as
    `READER` in one file of `storage/readers/`.

    - `name`: value of `data.reader`.
    - `read`: function that reads the wanted columns of a file, and returns one table for every
      recording in it. The gate (`tables/gate.py`) checks its result.
    - `suffixes`: suffixes of such files, in lower case.
    - `keys`: keys of `data` that this reader uses, besides the keys that every reader uses.
    - `column`: example of the name of a column in a spec.
    - `by_index`: True if columns can also be addressed by their 0-based index.
    - `peek`: function that reads the first rows of a file in every way in which the file can be
      read, the most probable way first. If it is None, `read` is called with a request without
      columns, which means all columns.
    - `below`: function that returns all tables that stand below each other or side by side in a
      file. Its request has no columns.
    - `begins`: regular expression for the first bytes of such files, in which a dot is any byte;
      empty if the format cannot be recognised by its first bytes.
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
            message = (
                f"{label}: column '{column}' is given by name, but the spec says that the "
                "file has no header"
            )
            raise DataError(message, f"Give its index (0 to {width - 1}), or set `header: true`.")
        elif column not in names:
            raise DataError(
                f"{label}: there is no column '{column}'",
                hint or known_names(column, list(filter(None, names)), "The header has"),
            )
        else:
            if (count := [name.strip() for name in names].count(column.strip())) > 1:
                message = f"{label}: column '{column}' occurs {count} times in the header"
                raise DataError(message, "Give its 0-based index instead.")
            places[column] = names.index(column)
    return places


def known_names(name: str, known: Sequence[str], introduction: str, most: int = 12) -> str:
    """Return the remedy for an error about a name that does not exist: it suggests the most similar
    existing name, and lists at most `most` existing names.
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
    file. If a DataError does not contain this name, it is added.

    Parsers of binary formats raise many types of errors for a damaged file: KeyError, struct.error,
    zlib.error, XML errors, or MemoryError for a wrong length. For the user, they all mean the same.
    A NameError or an ImportError is a fault of the program and is not converted.
    """
    try:
        yield
    except MapmoreError as error:
        if label not in error.message:
            error.message = f"{label}: {error.message}"
        raise
    except damage as error:
        # an UnboundLocalError, which is a NameError too, is converted, because SciPy raises it for
        # some damaged files
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
"""If data unpack to more than `BOMB_SIZE` bytes, their compression ratio is checked: it must be at
most `BOMB_RATIO`. Recordings are usually compressed to a tenth, and at most to a fiftieth, of their
size.
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
        message = f"{label}: reading this file needs {package}, which is not installed"
        raise DataError(message, "install it with: pip install 'mapmore[formats]'") from error
