"""The recordings of a study, read as its draft says, and the draft with what they need to be
read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from mapmore_cli.annexes.drafting.columns import (
    Table,
    known_by_titles,
    named_by_person,
    read_titles,
)
from mapmore_cli.annexes.drafting.draft import Column, Conditions, Draft, Named, Section
from mapmore_cli.annexes.drafting.sources import Study, started
from mapmore_cli.annexes.drafting.understanding import Understood
from mapmore_cli.checking.evidence import MUCH, two_digits
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import IngestSlice, Meter, find_sources
from mapmore_cli.ingestion.samples import Samples, read_tables
from mapmore_cli.storage.tables.cells import NotANumber
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.units import can_convert, convert, default_unit, is_canonical

MOST_FILES = 5  # that are looked at
MOST_WORDS = 3  # that stand for missing numbers in one column; more are a column of words
RESET = {"longer_than": 60.0, "action": "split"}  # cuts a recording where its clock is set back
BREAK = 5  # usual steps without a sample, that are a gap

T = TypeVar("T")


class _Columns(Data):
    """The columns of a file before anything is known of them: any may hold time stamps."""

    def clocks(self) -> frozenset[Column]:
        return frozenset(column.column for column in self.columns.values())


def read_draft(draft: Draft, folder: Path, measured: str) -> Dataset:
    """Return the dataset of a draft, in the units that it says; DataError where it cannot be
    made.
    """
    data = Data.model_validate(draft.data)
    units = {name: default_unit(name) for name in data.quantities} | draft.spec.get("units", {})
    try:
        return build_dataset(IngestSlice(data, measured, "static", units), folder)
    except SpecError as fault:
        raise DataError(fault.message, fault.remedy) from fault


def _with_words(read: Callable[[object], T]) -> tuple[object, T]:
    """Return the first rule for missing values by which something can be read, and what was read:
    a few words, as `---`, may stand for such values.

    Raises DataError for more words, and for a cell that is no such word, as a date.
    """
    words: list[str] = []
    while True:
        rule: object = {"tokens": words} if words else "drop"
        try:
            return rule, read(rule)
        except NotANumber as fault:
            if len(words) == MOST_WORDS or fault.known:
                raise
            words = [*words, fault.cell]


def table_of(study: Study, folder: Path) -> Table:
    """Return the columns of a few files of a study; those of text and empty ones have no values.

    Where one cannot be read, every column is read by itself. Raises DataError where no column is
    left.
    """
    layout, section = study.layout, started(study, folder).data
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
    return read_titles(layout, raw)


def _read_columns(
    section: Mapping[str, Any], folder: Path, columns: Sequence[Column]
) -> dict[Column, list[Array]]:
    """Return the numbers of every column; of none that is empty in a file, or that mostly has
    words.
    """
    names = {f"column_{place}": column for place, column in enumerate(columns)}
    entries = {name: {"column": column} for name, column in names.items()}
    units = {**dict.fromkeys(names, "1"), "time": "s"}

    def read(missing: object) -> list[Samples]:
        data = _Columns.model_validate({**section, "columns": entries, "missing": missing})
        every = find_sources(data.files, folder)
        some = every[:: -(-len(every) // MOST_FILES)]  # columns are the same in all
        meter = Meter(some, lambda *_: None)
        logs = [read_tables(source, data, data, units, meter) for source in some]
        return [table for log in logs for table in log]

    missing, tables = _with_words(read)
    raw: dict[Column, list[Array]] = {}
    for name, column in names.items():
        cells = [np.asarray(table.columns[name]) for table in tables]
        values = [numbers[np.isfinite(numbers)] for numbers in cells]
        least = 0.0 if missing == "drop" else MUCH * sum(map(len, cells))
        if all(map(len, values)) and sum(map(len, values)) >= least:
            raw[column] = values
    return raw


def with_columns(draft: Draft, known: Understood, target: str, table: Table) -> Draft:
    """Return the draft with the columns of one target, their units where the names are no canonical
    quantities, and a word on those that are not used.
    """
    used = {one.column for one in known.columns.values()}
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
    if "time" in columns:
        draft = draft.without_data("sample_time")
    for name, one in columns.items():
        draft = draft.noted(("data", "columns", name), one.why, one.sure)
    return replace(draft, raw={one.column: one.values for one in table.values() if one.values})


# What recordings need to be read
# --------------------------------------------------------------------------------------------------


def lenient(draft: Draft) -> Draft:
    """Return the draft with single faults of cells and of the clock left out."""
    for key, value in (("missing", "drop"), ("repeated_time", "average"), ("glitches", "drop")):
        draft = draft.with_data(key, value)
    return draft


def cleaned(draft: Draft, folder: Path, target: str) -> tuple[Draft, Dataset]:
    """Return the draft with what its recordings need to be read, and these.

    A clock that is set back cuts a recording; one that cannot be mended is left out. Raises
    DataError where they cannot be read, or where another log is joined by such a clock.
    """
    draft = lenient(draft)
    columns = draft.data["columns"]
    try:
        draft, dataset = _read_tolerantly(draft, folder, target)
    except DataError as fault:
        if "time" not in columns:
            raise
        try:
            cut = draft.with_data(
                "gaps", RESET, f"s: the clock is set back, and cuts the recording: {fault.message}"
            )
            draft, dataset = _read_tolerantly(cut, folder, target)
        except DataError:
            if "join" in draft.data:
                raise fault from None
            others = {key: one for key, one in columns.items() if key != "time"}
            draft = draft.with_data("columns", others, f"time is left out: {fault.message}", False)
            draft, dataset = _read_tolerantly(draft, folder, target)
    return _with_losses_told(draft, dataset), dataset


def _read_tolerantly(draft: Draft, folder: Path, target: str) -> tuple[Draft, Dataset]:
    missing, dataset = _with_words(
        lambda rule: read_draft(draft.with_data("missing", rule), folder, target)
    )
    return draft.with_data("missing", missing), dataset


def _with_losses_told(draft: Draft, dataset: Dataset) -> Draft:
    """Return the draft with what is done about empty cells and odd stamps, where there are any;
    those of a joined log are not counted.
    """
    rules = {
        "missing": ("missing value", "samples have an empty cell"),
        "repeated_time": ("repeated time", "time stamps repeat: the logger rounds them"),
        "glitches": ("glitch of the clock", "stamps lie before an earlier one"),
    }
    for key, (reason, words) in rules.items():
        count = sum(one.dropped.get(reason, 0) for one in dataset.recordings)
        rule = draft.data[key]
        if isinstance(rule, dict):
            tokens = ", ".join(map(repr, rule["tokens"]))
            draft = draft.noted(
                ("data", key),
                f"{count} samples have a cell that is empty or holds {tokens}: taken as no value",
                False,
            )
        elif count:
            draft = draft.noted(("data", key), f"{count} {words}")
        elif "join" not in draft.data:
            draft = draft.without_data(key)
    return draft


def with_strain(draft: Draft, length: float, conditions: Conditions) -> tuple[Draft, str]:
    """Return the draft with the strain that a length or a displacement makes of the muscle's own
    length in m, and which of them; empty where a column holds the strain, or there is none.

    A displacement counts as contraction in the direction in which it mostly goes. `conditions`
    are values that names tell.
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
        "of the length that was given; positive is contraction",
        False,
    ), measured


def with_second_log(draft: Draft, second: Study, folder: Path, target: str, said: Named) -> Draft:
    """Return the draft with the pressure of a second log, shifted as the changes of the target and
    of the pressure tell, where they do.
    """
    table = table_of(second, folder)
    columns, _ = known_by_titles(table)
    columns |= named_by_person(said, table, "--columns", columns)
    if not {"time", "pressure"} <= columns.keys() or "time" not in draft.data["columns"]:
        raise DataError(
            f"{second.files[0].name}: holds the pressure, and no clock goes on in both logs",
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
    except DataError:  # nothing changes, or several shifts would do
        entry = {key: value for key, value in entry.items() if key != "match"} | {"shift": 0.0}
        how_shifted, sure = "are both clocks one?", False
    return draft.with_data(
        "join",
        [entry],
        f"the pressure is in a log of its own; {how_shifted}; {columns['pressure'].why}",
        sure,
    )
