"""Read the recordings of a study with the settings of its draft, and add settings that are needed
to read them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from mapmore_cli.annexes.drafting.by_person import named_by_person
from mapmore_cli.annexes.drafting.by_titles import known_by_titles
from mapmore_cli.annexes.drafting.columns import Table, Texts, find, read_titles
from mapmore_cli.annexes.drafting.draft import Column, Conditions, Draft, Named, Section
from mapmore_cli.annexes.drafting.names import told_by_names
from mapmore_cli.annexes.drafting.sources import Study, started
from mapmore_cli.annexes.drafting.understanding import Understood
from mapmore_cli.checking.evidence import MUCH, two_digits
from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.ingestion.clock import REPEATS
from mapmore_cli.ingestion.dataset import BAD, build_dataset
from mapmore_cli.ingestion.files import IngestSlice, Meter, Source, find_sources
from mapmore_cli.ingestion.samples import Samples, read_tables
from mapmore_cli.storage.tables.cells import NotANumber
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.units import can_convert, convert, default_unit, is_canonical

MOST_FILES = 5  # largest number of files that are read
MOST_SHOWN = 12  # largest number of columns that a line of a description names
# largest number of words that may mean missing numbers in one column; a column with more is a
# column of words
MOST_WORDS = 3
# rule that cuts a recording at a place where its clock was set back
RESET = {"longer_than": 60.0, "action": "split"}
BREAK = 5  # a step longer than this multiple of the usual step is a gap

T = TypeVar("T")


class _Columns(Data):
    """The columns of a file before their meaning is known; any of them may hold time stamps."""

    def clocks(self) -> frozenset[Column]:
        return frozenset(column.column for column in self.columns.values())


def read_draft(
    draft: Draft, folder: Path, measured: str, warn: Callable[[str], None] = lambda _: None
) -> Dataset:
    """Return the dataset of a draft, in its units. Raises DataError if it cannot be made."""
    data = Data.model_validate(draft.data)
    units = {name: default_unit(name) for name in data.quantities} | draft.spec.get("units", {})
    try:
        return build_dataset(IngestSlice(data, measured, "static", units), folder, warn=warn)
    except SpecError as fault:
        raise DataError(fault.message, fault.remedy) from fault


def _with_words(read: Callable[[object], T], known: Sequence[str] = ()) -> tuple[object, T]:
    """Return the rule for missing values that was needed to read something, and the result. Cells
    with a few different words, for example `---`, are taken as missing values, in addition to the
    `known` words.

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


def table_of(study: Study, folder: Path) -> Table:
    """Return the columns of a few files of a study. Columns of text and empty columns have no
    values.

    If the files cannot be read as a whole, every column is read separately. Raises DataError if no
    column is left.
    """
    layout, section = study.layout, started(study.of_layout, folder).data
    last = DataError(f"{study.files[0].name}: no column has numbers", "fill its cells")
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
                last = fault
    if not raw:
        raise last
    texts: dict[Column, Texts] = {}
    for column in [one for one in layout.columns if one not in raw]:
        with suppress(DataError, SpecError):
            texts |= _read_texts(section, folder, column)
    return read_titles(layout, raw, texts)


def _read_texts(section: Mapping[str, Any], folder: Path, column: Column) -> dict[Column, Texts]:
    """Return the different texts of a column, and the numbers of its cells' texts; an empty mapping
    if texts seldom occur more than once.
    """
    entry = {"column": column, "texts": True}
    data = Data.model_validate(
        {**section, "columns": {"label": entry}, "recordings": {"of": "label"}}
    )
    some = _some_of(find_sources(data.files, folder, bad=data.skip_bad_files))
    meter = Meter(some, lambda *_: None)
    tables = [
        one for source in some for one in read_tables(source, data, data, {"label": "1"}, meter)
    ]
    numbers = [x[np.isfinite(x)] for x in (np.asarray(one.columns["label"]) for one in tables)]
    words = [*meter.texts["label"]]
    is_again = 2 * len(words) <= sum(map(len, numbers)) and all(map(len, numbers))
    return {column: (words, numbers)} if is_again else {}


def _some_of(sources: Sequence[Source]) -> Sequence[Source]:
    """Return a few of the files, which are enough to know the columns, because all files have the
    same columns.
    """
    return sources[:: -(-len(sources) // MOST_FILES)]


def described(study: Study, folder: Path) -> str:
    """Return a layout in words: numbers of files, rows and columns, and the information in
    names.
    """
    try:
        table = table_of(study, folder)
    except (DataError, SpecError) as fault:
        return f"{study}, which cannot be read: {fault.message}"
    values = [one.values for one in table.values() if one.values]
    sizes = [max(map(len, x)) for x in zip(*values, strict=True)]
    looked_at = "" if len(study.files) <= MOST_FILES else f" in {len(sizes)} of them"
    columns = ", ".join(one.called for one in [*table.values()][:MOST_SHOWN])
    more = ", ..." if len(table) > MOST_SHOWN else ""
    conditions, _ = told_by_names(study.names)
    names = "".join(f"; names say {one.why}" for one in conditions)
    return f"{study}, {sum(sizes)} rows{looked_at}, {len(table)} columns ({columns}{more}){names}"


def split_by(table: Table, said: Sequence[str]) -> Table:
    """Return a table with one array of values for each recording. The columns that a person names
    distinguish the recordings. The table is unchanged if one of them lacks values. Raises
    UsageError for an unknown column.
    """
    keys = [
        find(table, int(one) if one.isdecimal() else one, "--recordings", texts=True)
        for one in said
    ]
    series = {name: x for name, one in table.items() if (x := one.values or one.numbered)}
    sizes = {name: [*map(len, x)] for name, x in series.items()}
    if not keys or any(sizes[key.column] != sizes[keys[0].column] for key in keys):
        return table
    usual = sizes[keys[0].column]
    pieces: list[list[IntArray]] = []
    for file in range(len(usual)):
        rows = np.column_stack([series[key.column][file] for key in keys])
        member = np.unique(rows, axis=0, return_inverse=True)[1].ravel()
        pieces.append([np.flatnonzero(member == kind) for kind in range(member.max() + 1)])
    return {
        name: replace(
            one,
            values=[x[rows] for x, parts in zip(one.values, pieces, strict=True) for rows in parts],
        )
        if one.values and sizes[name] == usual
        else one
        for name, one in table.items()
    }


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
        some = _some_of(find_sources(data.files, folder, bad=data.skip_bad_files))
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

    missing, tables = _with_words(read)
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


def with_columns(draft: Draft, known: Understood, target: str, table: Table) -> Draft:
    """Return the draft with the columns for one target, the units of those that are no canonical
    quantities, and a remark on columns that are not used.
    """
    used = {place for one in known.columns.values() for place in one.places}
    left = ", ".join(
        f"{one.called} ({known.left_out[column]})" if column in known.left_out else one.called
        for column, one in table.items()
        if column not in used
    )
    columns = known.without_others(target)
    entries = {name: one.as_spec() for name, one in columns.items()}
    draft = draft.with_data("columns", entries, f"left out: {left}" if left else None)
    units = {
        name: "kPa" if can_convert(one.unit, "kPa") else one.unit
        for name, one in columns.items()
        if not is_canonical(name) and one.unit != "1"
    }
    units_in_names = {one.quantity: one.unit for one in known.conditions if one.unit}
    if units := units | {
        name: unit for name, unit in units_in_names.items() if not is_canonical(name)
    }:
        draft = draft.with_section("units", units)
    if known.apart:
        of = known.apart if len(known.apart) > 1 else known.apart[0]
        draft = draft.with_data("recordings", {"of": of}, "you; lags stay within a recording")
    if computed := [text for one in table.values() if one.column in used for text in one.summaries]:
        draft = draft.with_data("missing", {"tokens": computed})
    if "time" in columns:
        draft = draft.without_data("sample_time")
    for name, one in columns.items():
        draft = draft.noted(("data", "columns", name), one.why, one.sure)
    return replace(draft, raw={one.column: one.values for one in table.values() if one.values})


# Settings that the reader of the recordings needs
# --------------------------------------------------------------------------------------------------


def lenient(draft: Draft) -> Draft:
    """Return the draft with settings that leave out samples with faulty cells or faulty time
    stamps, if there are only a few.
    """
    for key, value in (("missing", "drop"), ("repeated_time", "spread"), ("glitches", "drop")):
        draft = draft.with_data(key, draft.data.get(key, value))
    return draft


def cleaned(draft: Draft, folder: Path, target: str) -> tuple[Draft, Dataset]:
    """Return the draft with all settings that its recordings need, and the recordings.

    A recording is cut where its clock is set back. Unreadable files are left out by name. A clock
    for which most files would be left out is itself left out. Raises DataError if no recording can
    be read, or if another log is joined by such a clock.
    """
    draft = lenient(draft)
    try:
        return _read_tolerantly(draft, folder, target)[:2]
    except DataError as fault:
        first = fault
    ways = [draft.with_data("skip_bad_files", True)]
    columns = draft.data["columns"]
    if "time" in columns:
        why = f"s: the recording is cut where its clock is set back: {first.message}"
        cut = draft.with_data("gaps", RESET, why)
        ways = [cut, *ways, cut.with_data("skip_bad_files", True)]
        if "join" not in draft.data:
            others = {key: one for key, one in columns.items() if key != "time"}
            why = f"time is left out: {first.message}"
            bare = draft.with_data("columns", others, why, False)
            ways += [bare, bare.with_data("skip_bad_files", True)]
    for way in ways:
        with suppress(DataError):
            found, dataset, is_most = _read_tolerantly(way, folder, target)
            if is_most or way is ways[-1]:
                return found, dataset
    raise first


def _read_tolerantly(draft: Draft, folder: Path, target: str) -> tuple[Draft, Dataset, bool]:
    """Return a draft that can be read, its dataset, and True if at least half of the files are in
    the dataset. The draft gets the words for missing values and the names of files that cannot be
    read.
    """
    warnings: list[str] = []
    rule = draft.data["missing"]
    missing, dataset = _with_words(
        lambda rule: read_draft(draft.with_data("missing", rule), folder, target, warnings.append),
        rule["tokens"] if isinstance(rule, dict) else (),
    )
    draft, is_most = draft.with_data("missing", missing), True
    if draft.data.get("skip_bad_files") is True:
        sources = find_sources(Data.model_validate(draft.data).files, folder, bad=True)
        names = dict.fromkeys(source.name for source in sources)
        read = {one.source for one in dataset.recordings}
        bad = [name for name in names if name not in read]
        told = [warning for warning in dict.fromkeys(warnings) if BAD in warning]
        why = "; ".join(told)
        draft = draft.with_data("skip_bad_files", bad or True, why, False)
        is_most = 2 * len(read) >= len(names)
    hidden = tuple(one for one in dict.fromkeys(warnings) if " hidden " in one)
    return _with_losses_told(replace(draft, tips=hidden), dataset), dataset, is_most


def _with_losses_told(draft: Draft, dataset: Dataset) -> Draft:
    """Return the draft with notes on empty cells and odd time stamps, if there are any; cells and
    time stamps of a joined log are not counted.
    """
    rules = {
        "missing": ("missing value", "samples have an empty cell"),
        "repeated_time": ("", f"{REPEATS}: the logger rounds them"),
        "glitches": ("glitch of the clock", "time stamps lie before an earlier one"),
    }
    for key, (reason, words) in rules.items():
        count = sum(one.dropped.get(reason, 0) for one in dataset.recordings)
        if not reason:
            told = (re.search(rf": (\d+) {REPEATS}", note) for note in dataset.notes)
            count = sum(int(match[1]) for match in told if match is not None)
        rule = draft.data[key]
        if isinstance(rule, dict):
            tokens = ", ".join(map(repr, rule["tokens"]))
            draft = draft.noted(
                ("data", key),
                f"{count} samples have a cell that is empty or holds {tokens}; it is read as a "
                "missing value",
                False,
            )
        elif count:
            draft = draft.noted(("data", key), f"{count} {words}")
        elif "join" not in draft.data:
            draft = draft.without_data(key)
    return draft


def with_strain(draft: Draft, length: float, conditions: Conditions) -> tuple[Draft, str]:
    """Return the draft with the strain computed from a length or a displacement and the muscle's
    own length in m, and the name of that column; empty if a column holds the strain, or if there is
    no such column.

    A displacement counts as contraction in the direction in which it mostly moves. `conditions` are
    values from names.
    """
    draft = draft.with_section("muscle", {"length": length})
    columns = draft.data["columns"]
    known = {*columns, *conditions}
    measured = next((one for one in ("length", "displacement") if one in known), None)
    if "strain" in known or measured is None:
        return draft, ""
    turned = ""
    if measured == "displacement":
        entry = columns.get(measured, {})
        pooled = np.concatenate(draft.raw[entry["column"]] if entry else [conditions[measured]])
        pooled = pooled * entry.get("scale", 1.0) + entry.get("offset", 0.0)
        turned = "-" if abs(pooled.min()) > abs(pooled.max()) else ""
    rules = {
        "length": f"({length:g} - length)/{length:g}",
        "displacement": f"{turned}displacement/{length:g}",
    }
    return draft.with_data(
        "derive",
        {"strain": rules[measured]},
        "computed with the length that was given; contraction is positive",
        False,
    ), measured


def with_second_log(draft: Draft, second: Study, folder: Path, target: str, said: Named) -> Draft:
    """Return the draft with the pressure of a second log, shifted so that its changes match those
    of the target, if a shift can be found.
    """
    table = table_of(second, folder)
    columns, _ = known_by_titles(table)
    columns |= named_by_person(said, table, "--columns", columns)
    if not {"time", "pressure"} <= columns.keys() or "time" not in draft.data["columns"]:
        raise DataError(
            f"{second.files[0].name}: contains the pressure, but the two logs have no common clock",
            "write `join` by hand",
        )
    steps = np.diff(table[columns["time"].column].values[0])
    usual = convert(float(np.median(steps[steps > 0])), columns["time"].unit, "s")
    entry: Section = {
        **started(second, folder).data,
        "columns": {name: columns[name].as_spec() for name in ("time", "pressure")},
        "shift": "auto",
        "match": {"first": target, "second": "pressure"},
        "max_gap": two_digits(BREAK * usual),
    }
    sure = columns["pressure"].sure
    try:
        notes = read_draft(lenient(draft.with_data("join", [entry])), folder, target).notes
        how_shifted = next((note for note in notes if ": shift " in note), "").partition(": ")[2]
    except DataError:  # nothing changes in a log, or several shifts are possible
        entry = {key: value for key, value in entry.items() if key != "match"} | {"shift": 0.0}
        how_shifted, sure = "do both logs have the same clock?", False
    return draft.with_data(
        "join",
        [entry],
        f"the pressure is in a second log; {how_shifted}; {columns['pressure'].why}",
        sure,
    )
