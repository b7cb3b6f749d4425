"""What every reader is asked for and what it returns."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

from mapmore_cli.domain.arrays import Array, Rows
from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.storage.tables.cells import CellReader

SourceColumn = str | int
"""A column of a file: the name in its header, its 0-based index, or an address as `run.P`."""


@dataclass(frozen=True)
class TableRequest:
    """Which columns of a file are wanted, and what its reader has to know.

    - `label`, `columns`: how messages name the file, and the wanted columns.
    - `header`: number of header lines, the first of which holds the names (text, sheets).
    - `skip_rows`: lines before the header (text, sheets).
    - `delimiter`: one character, `tab`, or `whitespace`: any run of blanks and tabs (text).
    - `decimal`, `thousands`: what stands between the digits of the numbers (text).
    - `comment`: how lines begin that are no records (text).
    - `encoding`: of the characters (text); a byte order mark of UTF-8 is swallowed.
    - `sheet`: title of the sheet, or a glob of which every match is a recording; the first that is
      not hidden where None (workbooks).
    - `hidden`: `keep` or `drop` the rows that are hidden (workbooks).
    - `root`: where the columns start; `train[*]` makes every element a recording (MAT, HDF5).
    - `missing`: texts, besides the usual ones, that stand where there is no value (text, sheets).
    - `clocks`: the columns whose cells may be time stamps; `formats`: how `strptime` reads those of
      some; `second`: in their unit.
    - `thousands_of`: what stands between thousands in some columns.
    - `texts`: the columns that hold texts, with the number of each text that was read so far.
    - `table`: which one is read of tables that stand below each other, from 1 (text, sheets).
    - `incomplete`: true where records that break off are missing values, False where they are
      errors.
    - `progress`: told now and then how many bytes of the file have been read (text, the only format
      of which a long file takes long).
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
    table: int | None = None
    texts: Mapping[SourceColumn, dict[str, float]] = field(default_factory=dict)
    thousands_of: Mapping[SourceColumn, str] = field(default_factory=dict)

    @property
    def marks_of_thousands(self) -> set[str]:
        """What stands between thousands in any column."""
        return {*filter(None, [self.thousands, *self.thousands_of.values()])}

    def cells(self, column: SourceColumn) -> CellReader:
        """Return what reads the cells of a column."""
        thousands = self.thousands_of.get(column, self.thousands)
        # where the decimal point stands between thousands, the other mark is the decimal point
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

    - `unit`: as the file spells it, empty where it says nothing.
    - `step`, `start`: seconds between samples, 0 where it says nothing, and when the first one was
      taken.
    - `is_scaled`: True where the numbers were multiplied as the file says.
    - `shown`: how its program shows the numbers, where that is what the unit follows from.
    - `never_written`: how many values the file has room for, and nobody wrote.
    """

    unit: str = ""
    step: float = 0.0
    start: float = 0.0
    is_scaled: bool = False
    never_written: int = 0
    shown: str = ""


@dataclass(frozen=True)
class Cut:
    """Evidence that a file breaks off.

    - `said`, `remedy`: in words, where that is an error.
    - `done`: what is done about it where missing values are left out.
    - `rows`: how many rows at the end cannot be trusted.
    """

    said: str
    remedy: str
    done: str
    rows: int = 0

    def refuse(self, where: str, request: TableRequest) -> None:
        """Raise DataError where missing values are errors."""
        if not request.incomplete:
            raise DataError(f"{where}: {self.said}", self.remedy)


@dataclass(frozen=True)
class OpenEnd:
    """The cells of the last rows of a text whose last line has no end, and the decimal point."""

    rows: Sequence[Sequence[str]]
    decimal: str = "."


IN_MEMORY = "row from 0"
"""The place of samples that came as arrays: nobody wrote a file of them."""


@dataclass(frozen=True)
class RawTable:
    """Columns as the file holds them, before scaling and units.

    `columns` has one `(n,)` array for each column of the request, NaN where a cell is empty.
    `label` names the table in messages (the file, and the part of it), `titles` the columns where
    they were renamed, and `doubts` are warnings of its reader. `rows` is `(n,)`, where each sample
    stands: its `place` is a `row` (line of a text file, row of a sheet, both from 1), an `index`
    (of an array, from 0) or `IN_MEMORY`. `element` tells the recordings of one file apart, by
    number or by the title of their sheet; None where it holds a single one. `noted` is what the
    file says of its columns. `breaks_off`, `open_end` and `padding`, a number of characters, are
    what its reader found at the end of the file, which the gate judges (`tables/gate.py`).
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
        """Where a sample stands, for messages: `a.csv:row 17`."""
        if self.place == IN_MEMORY:
            return f"{self.label}, row {self.rows[sample]} (from 0)"
        return f"{self.label}:{self.place} {self.rows[sample]}"

    def is_empty_at(self, sample: int) -> bool:
        """Whether a sample has no value at all, or there is no sample."""
        return not self.size or all(x[sample] != x[sample] for x in self.columns.values())


@dataclass(frozen=True)
class Top:
    """The first rows of a file, read in one way: with these `settings` of `data`, under which
    `is_number` tells cells that hold numbers.

    `addresses` are how the spec names the columns, where these lie in a tree; `sheet` is the title
    of the sheet, in a workbook; `units` are those of all columns, where the file says them apart
    from its rows.
    """

    rows: Sequence[Sequence[Any]]
    is_number: Callable[[Any], bool]
    settings: Mapping[str, Any] = field(default_factory=dict)
    addresses: tuple[str, ...] = ()
    sheet: str | None = None
    units: tuple[str, ...] = ()


@dataclass(frozen=True)
class Reader:
    """A format of recordings. Everything that the program knows of it is declared in one file of
    `storage/readers/`, as its `READER`.

    - `name`: the word of `data.reader`.
    - `read`: reads the wanted columns of a file: one table for every recording in it. What it
      reports is judged by the gate behind all readers (`tables/gate.py`).
    - `suffixes`: how the names of such files end, lower case.
    - `keys`: the keys of `data` that it has a use for, besides those of every reader.
    - `column`: how the spec names a column, as an example.
    - `by_index`: whether columns also go by their 0-based index.
    - `peek`: reads the first rows of a file in every way that it may be meant, the likeliest first;
      without it, `read` is asked for no columns, which are then all.
    - `below`: returns the tables that stand below each other in a file, by a request without
      columns; none where it is one table.
    - `begins`: how such files begin, whatever their names; empty where that is no sign.
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

    `names` are those of the header, None where there is none; `hint` replaces the usual remedy
    where the reader knows better. Raises DataError for a column that does not exist, or whose name
    stands twice in the header.
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
                f"{label}: column '{column}' is asked for by name, but the spec says that the "
                "file has no header"
            )
            raise DataError(what, f"Give its index (0 to {width - 1}), or set `header: true`.")
        elif column not in names:
            raise DataError(
                f"{label}: there is no column '{column}'",
                hint or known_names(column, list(filter(None, names)), "The header has"),
            )
        else:
            remedy = "Give its 0-based index instead."
            refuse_namesakes(column, names, f"{label}: column '{column}'", "the header", remedy)
            places[column] = names.index(column)
    return places


def refuse_namesakes(name: str, names: Sequence[str], what: str, where: str, remedy: str) -> None:
    """Raise DataError where a name stands more than once among the `names` of a file, since nobody
    can tell which is meant; blanks around a name do not count.
    """
    count = sum(other.strip() == name.strip() for other in names)
    if count > 1:
        raise DataError(f"{what} stands {count} times in {where}", remedy)


def known_names(name: str, known: Sequence[str], introduction: str, most: int = 12) -> str:
    """Return a remedy for a name that does not exist: the nearest one, and which there are."""
    near = [other for other in known if other.lower() == name.lower()] or difflib.get_close_matches(
        name, known, n=1
    )
    guess = f"Did you mean '{near[0]}'? " if near else ""
    more = ", ..." if len(known) > most else ""
    return f"{guess}{introduction}: {', '.join(known[:most])}{more}."


Faults = type[Exception] | tuple[type[Exception], ...]


@contextmanager
def reading(label: str, kind: str, damage: Faults = Exception) -> Iterator[None]:
    """Turn what a parser raises on a damaged file into a DataError that names the file; one that
    lacks the name gets it.

    The parsers of binary formats raise a dozen kinds (KeyError, struct.error, zlib.error, XML
    errors, MemoryError for a length that is nonsense), all of which mean the same to the user. A
    NameError or an ImportError is a fault of the program, and passes.
    """
    try:
        yield
    except MapmoreError as error:
        if label not in error.message:
            error.message = f"{label}: {error.message}"
        raise
    except damage as error:
        # SciPy has an UnboundLocalError for some damaged files
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
"""Bytes unpacked from which on it matters how many times larger they are than packed: logs shrink
to a tenth, at most to a fiftieth.
"""


def refuse_bombs(where: str, unpacked: float, packed: int, size: int | None = None) -> None:
    """Raise DataError for what unpacks, or declares to, to far more than a log that was packed, and
    to more than a `size`, `BOMB_SIZE` where None.
    """
    if unpacked > max(BOMB_SIZE if size is None else size, BOMB_RATIO * packed):
        sizes = f"from {packed / 1e6:.2g} MB to {unpacked / 1e6:.0f} MB or more"
        raise DataError(
            f"{where} unpacks {sizes}",
            "save the measurements alone, or unpack them, if that is right",
        )


def optional_library(module: str, package: str, label: str) -> ModuleType:
    """Import a library that only some formats need; DataError with the command that installs it
    where it is absent.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        what = f"{label}: reading this file needs {package}, which is not installed"
        raise DataError(what, "install it with: pip install 'mapmore[formats]'") from error
