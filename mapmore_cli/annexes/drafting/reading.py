"""Read the recordings of a draft, and a few files of a study before the meaning of their columns is
known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from mapmore_cli.annexes.drafting.columns import (
    FEWEST_ROWS,
    Table,
    Texts,
    TitledColumn,
    read_titles,
)
from mapmore_cli.annexes.drafting.draft import Column, Draft, address
from mapmore_cli.annexes.drafting.finding import find
from mapmore_cli.annexes.drafting.names import told_by_names
from mapmore_cli.annexes.drafting.sources import started
from mapmore_cli.annexes.drafting.studies import FolderStudy
from mapmore_cli.checking.evidence import MUCH
from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.errors import DataError, SpecError, Warn
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import IngestSlice, Meter, find_sources
from mapmore_cli.ingestion.reading import read_tables
from mapmore_cli.ingestion.samples import Samples
from mapmore_cli.storage.tables.cells import NotANumber
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.units import default_unit, unit_of

MOST_FILES = 5  # largest number of files from which the columns are found
MOST_SHOWN = 12  # largest number of columns that are named in one line
# largest number of different words that may stand for missing numbers; a column that holds more
# different words is a column of words
MOST_WORDS = 3
_OF_NUMBERS = "+-.,0123456789 "
_OF_FORMULAS = ("#", "err:")  # beginnings of the errors that a formula leaves in its cell

T = TypeVar("T")


class _Columns(Data):
    """Columns of a file before their meaning is known. Each of them may hold time stamps."""

    def clocks(self) -> frozenset[Column]:
        return frozenset(column.column for column in self.columns.values())


def read_draft(draft: Draft, folder: Path, measured: str, warn: Warn = lambda _: None) -> Dataset:
    """Return the dataset that a draft describes, in the units of the draft. Raises DataError if the
    recordings cannot be read.
    """
    data = Data.model_validate(draft.data)
    units = {name: default_unit(name) for name in data.quantities} | draft.spec.get("units", {})
    try:
        return build_dataset(IngestSlice(data, measured, "static", units), folder, warn=warn)
    except SpecError as fault:
        raise DataError(fault.message, fault.remedy) from fault


def with_words(read: Callable[[object], T], known: Sequence[str] = ()) -> tuple[object, T]:
    """Call `read` with a rule for missing values; return the rule that was needed, and the result.
    The rule lists words that mean a missing value, for example `---`: the `known` words, and at
    most `MOST_WORDS` others that were found in cells.

    Raises DataError if there are too many different words, or if a cell holds something else than a
    word, for example a date.
    """
    words = [*known]
    while True:
        rule: object = {"tokens": words} if words else "drop"
        try:
            return rule, read(rule)
        except NotANumber as fault:
            if len(words) == MOST_WORDS + len(known) or fault.known:
                raise
            words = [*words, fault.cell]


def table_of(study: FolderStudy, folder: Path) -> Table:
    """Return the columns of a few files of a study. Columns of text and empty columns have no
    values.

    If the files cannot be read as a whole, every column is read separately. Raises DataError if no
    column is left.
    """
    layout, section = study.layout, started(study.of_layout, folder).data
    remedy = "a recording needs at least one column of numbers: leave the file out, or correct it"
    last = DataError(f"{study.files[0].name}: no column has numbers", remedy)
    unread: dict[Column, str] = {}
    try:
        raw = _read_columns(section, folder, layout.columns)
    except DataError:
        raw = {}
        for place, column in enumerate(layout.columns):
            try:
                raw |= _read_columns(section, folder, (column,))
            except DataError as fault:
                if isinstance(fault, NotANumber) and fault.known and place in layout.numeric:
                    raise
                if isinstance(fault, NotANumber) and fault.known:
                    # a cell without a text lacks its number, for example a formula never computed
                    is_formula = not fault.cell or fault.cell.lower().startswith(_OF_FORMULAS)
                    if is_formula or unit_of(fault.cell.lstrip(_OF_NUMBERS)) is not None:
                        unread[column] = f"{fault.message}; {fault.remedy}"
                last = fault
    if not raw:
        raise last
    texts: dict[Column, Texts] = {}
    for column in [place for place in layout.columns if place not in raw]:
        with suppress(DataError, SpecError):
            texts |= _read_texts(section, folder, column)
    table = read_titles(layout, raw, texts)
    return {name: replace(column, unread=unread.get(name, "")) for name, column in table.items()}


def _read_texts(section: Mapping[str, Any], folder: Path, column: Column) -> dict[Column, Texts]:
    """Return the different texts of a column, and for each cell the number of its text, as a
    mapping with the column as its only key. If most texts would otherwise occur only once, an empty
    cell gets the text of the next filled cell above it. The mapping is empty if the texts still
    seldom repeat.
    """
    for how in (True, "down"):
        entry = {"column": column, "texts": how}
        data = Data.model_validate(
            {**section, "columns": {"label": entry}, "recordings": {"of": "label"}}
        )
        some = some_of(find_sources(data.files, folder, bad=data.skip_bad_files))
        meter = Meter(some, lambda *_: None)
        tables = [
            table_of_source
            for source in some
            for table_of_source in read_tables(source, data, data, {"label": "1"}, meter)
        ]
        cells = [np.asarray(table_of_source.columns["label"]) for table_of_source in tables]
        numbers = [x[np.isfinite(x)] for x in cells]
        words, is_down = [*meter.texts["label"]], how == "down"
        is_again = (FEWEST_ROWS if is_down else 2) * len(words) <= sum(map(len, numbers))
        # texts are no names of blocks if the first cells of the column are empty
        is_everywhere = len(words) > 1 and [*map(len, cells)] == [*map(len, numbers)]
        if is_again and all(map(len, numbers)) and (is_everywhere or not is_down):
            return {column: (words, numbers, how)}
    return {}


def some_of(sources: Sequence[T]) -> Sequence[T]:
    """Return a few of the files, which are enough to know the columns, because all files have the
    same columns. Of numbers in the names of all files, return those of the same few files.
    """
    return sources[:: -(-len(sources) // MOST_FILES)]


def described(study: FolderStudy, folder: Path) -> str:
    """Describe a study in words: its numbers of files, rows and columns, and what the names of its
    files say.
    """
    try:
        table = table_of(study, folder)
    except (DataError, SpecError) as fault:
        return f"{study}, which cannot be read: {fault.message}"
    values = [column.values for column in table.values() if column.values]
    sizes = [max(map(len, x)) for x in zip(*values, strict=True)]
    looked_at = "" if len(study.files) <= MOST_FILES else f" in {len(sizes)} of them"
    columns = ", ".join(column.called for column in [*table.values()][:MOST_SHOWN])
    more = ", ..." if len(table) > MOST_SHOWN else ""
    conditions, _ = told_by_names(study.names)
    names = "".join(f"; names say {condition.why}" for condition in conditions)
    return f"{study}, {sum(sizes)} rows{looked_at}, {len(table)} columns ({columns}{more}){names}"


def split_by(table: Table, references: Sequence[str]) -> Table:
    """Return a table with one array of values for each recording. The columns that a person names
    distinguish the recordings. The table is unchanged if one of these columns has missing values.
    Raises UsageError for an unknown column.
    """
    keys = [find(table, address(text), "--recordings", texts=True) for text in references]
    series = {name: x for name, column in table.items() if (x := column.values or column.numbered)}
    sizes = {name: [*map(len, x)] for name, x in series.items()}
    if not keys or any(sizes[key.column] != sizes[keys[0].column] for key in keys):
        return table
    rows_of: list[list[IntArray]] = []  # the rows of each recording, for each file
    for labels in zip(*(series[key.column] for key in keys), strict=True):
        member = np.unique(np.column_stack(labels), axis=0, return_inverse=True)[1].ravel()
        rows_of.append([np.flatnonzero(member == kind) for kind in range(member.max() + 1)])

    def divided(column: TitledColumn) -> TitledColumn:
        if not column.values or sizes[column.column] != sizes[keys[0].column]:
            return column
        files = zip(column.values, rows_of, strict=True)
        return replace(column, values=[x[rows] for x, parts in files for rows in parts])

    return {name: divided(column) for name, column in table.items()}


def _read_columns(
    section: Mapping[str, Any], folder: Path, columns: Sequence[Column]
) -> dict[Column, list[Array]]:
    """Return the numbers of every column, except columns that are empty in a file, or that hold
    mostly words.
    """
    names = {f"column_{place}": column for place, column in enumerate(columns)}
    entries = {name: {"column": column} for name, column in names.items()}
    units = {**dict.fromkeys(names, "1"), "time": "s"}

    def read(missing: object) -> list[Samples]:
        data = _Columns.model_validate({**section, "columns": entries, "missing": missing})
        some = some_of(find_sources(data.files, folder, bad=data.skip_bad_files))
        meter = Meter(some, lambda *_: None)
        tables: list[Samples] = []
        faults: list[DataError] = []
        for source in some:
            try:
                tables += read_tables(source, data, data, units, meter)
            except NotANumber:
                raise
            except DataError as fault:
                faults.append(fault)
        if faults and 2 * len(faults) >= len(some):
            raise faults[0]
        return _without_bad(tables)

    missing, tables = with_words(read)
    raw: dict[Column, list[Array]] = {}
    for name, column in names.items():
        cells = [np.asarray(table.columns[name]) for table in tables]
        values = [numbers[np.isfinite(numbers)] for numbers in cells]
        least = 0.0 if missing == "drop" else MUCH * sum(map(len, cells))
        if all(map(len, values)) and sum(map(len, values)) >= least:
            raw[column] = values
    return raw


def _without_bad(tables: Sequence[Samples]) -> list[Samples]:
    """Return the tables without the bad ones. A table is bad if a column in it is empty, although
    it has values in most other tables.
    """
    empty = [
        {name for name, x in table.columns.items() if not np.isfinite(x).any()} for table in tables
    ]
    often = [name for names in empty for name in names]
    usual = {name for name in often if 2 * often.count(name) >= len(tables)}
    return [table for table, names in zip(tables, empty, strict=True) if names <= usual]
