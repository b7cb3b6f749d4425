"""The recordings of a study, read as its draft says, and the draft with what they need to be
read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.annexes.drafting.columns import (
    Table,
    known_by_titles,
    named_by_person,
    read_titles,
)
from mapmore_cli.annexes.drafting.draft import Column, Draft, NamedColumn
from mapmore_cli.annexes.drafting.sources import Study, patterns
from mapmore_cli.annexes.drafting.understanding import Understood
from mapmore_cli.checking.evidence import MUCH, two_digits
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import IngestSlice, relative_name
from mapmore_cli.spec.sections.data import Data
from mapmore_cli.spec.units import can_convert, convert, default_unit, is_canonical
from mapmore_cli.storage.tables.cells import NotANumber

MOST_FILES = 5  # that are looked at
MOST_WORDS = 3  # that stand for missing numbers in one column; more are a column of words
RESET = {"longer_than": 60.0, "action": "split"}  # cuts a recording where its clock is set back
BREAK = 5  # usual steps without a sample, that are a gap


class _Columns(Data):
    """The columns of a file before anything is known of them: any may hold time stamps."""

    def clocks(self) -> frozenset[Column]:
        return frozenset(column.column for column in self.columns.values())


def read_draft(draft: Draft, folder: Path, measured: str, form: type[Data] = Data) -> Dataset:
    """Return the dataset of a draft, in the units that it says; DataError where it cannot be
    made.
    """
    data = form.model_validate(draft.data)
    units = {name: default_unit(name) for name in data.quantities} | draft.spec.get("units", {})
    try:
        return build_dataset(
            IngestSlice(data=data, measured=measured, component="static", units=units), folder
        )
    except SpecError as fault:
        raise DataError(fault.message, fault.remedy) from fault


def read_tolerantly(
    draft: Draft, folder: Path, measured: str, form: type[Data] = Data
) -> tuple[Draft, Dataset]:
    """Return a draft that leaves samples without a number out, and its dataset; a few words, as
    `---`, may stand for such numbers.

    Raises DataError where its cells hold more words, or hardly a number; and for a cell that is no
    such word, as a date.
    """
    words: list[str] = []
    while True:
        draft = draft.with_data("missing", {"tokens": words} if words else "drop")
        try:
            dataset = read_draft(draft, folder, measured, form)
        except NotANumber as fault:
            if len(words) == MOST_WORDS or fault.known:
                raise
            words = [*words, fault.cell]
            continue
        read, kept = (
            sum(getattr(one, key) for one in dataset.recordings)
            for key in ("rows_read", "rows_kept")
        )
        if words and kept < MUCH * read:
            raise DataError(f"hardly a number among {', '.join(map(repr, words))}")
        return draft, dataset


def table_of(study: Study, folder: Path) -> Table:
    """Return the columns of a few files of a study; those of text and empty ones have no values.

    Where cells are empty every column is read by itself: one that is hardly filled must not hide
    the others. Raises DataError where no column is left.
    """
    layout = study.layout
    raw: dict[Column, list[Array]] = {}
    is_whole = False
    with suppress(DataError):
        raw, is_whole = _read_columns(study, folder, layout.columns)
    if not is_whole:
        raw = {}
        for place, column in enumerate(layout.columns):
            try:
                raw |= _read_columns(study, folder, (column,))[0]
            except DataError as fault:
                if isinstance(fault, NotANumber) and fault.known and place in layout.numeric:
                    raise
                last = fault
    if not raw:
        raise last
    titles, units = (
        dict(zip(layout.columns, texts, strict=False))
        for texts in (layout.titles or (), layout.units)
    )
    return read_titles(titles, raw, units)


def _read_columns(
    study: Study, folder: Path, columns: Sequence[Column]
) -> tuple[dict[Column, list[Array]], bool]:
    """Return the columns, and whether every sample has all of them."""
    names = {f"column_{place}": column for place, column in enumerate(columns)}
    some = study.files[:: -(-len(study.files) // MOST_FILES)]  # columns are the same in all
    data = {
        "files": [
            {"path": relative_name(file, folder), "id": str(place)}
            for place, file in enumerate(some)
        ],
        "reader": study.layout.reader,
        **study.layout.settings,
        "columns": {name: {"column": column} for name, column in names.items()},
    }
    draft = Draft({"data": data, "units": dict.fromkeys(names, "1")})
    _, dataset = read_tolerantly(draft, folder, "column_0", _Columns)
    raw = {
        column: [np.asarray(one.columns[name]) for one in dataset.recordings]
        for name, column in names.items()
    }
    return raw, not any(one.dropped.get("missing value") for one in dataset.recordings)


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
    if units := units | draft.spec.get("units", {}):
        draft = draft.with_section("units", units)
    if "time" in columns:
        draft = draft.without("data.sample_time")
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
    try:
        read, dataset = read_tolerantly(draft, folder, target)
    except DataError as fault:
        if "time" not in draft.data["columns"]:
            raise
        try:
            why = f"s: the clock is set back, and cuts the recording: {fault.message}"
            read, dataset = read_tolerantly(draft.with_data("gaps", RESET, why), folder, target)
        except DataError:
            if "join" in draft.data:
                raise fault from None
            columns = {key: one for key, one in draft.data["columns"].items() if key != "time"}
            draft = draft.with_data("columns", columns, f"time is left out: {fault.message}", False)
            read, dataset = read_tolerantly(draft, folder, target)
    return _with_losses_told(read, dataset), dataset


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
            told = ", ".join(map(repr, rule["tokens"]))
            why = f"{count} samples have a cell that is empty or holds {told}: taken as no value"
            draft = draft.noted(("data", key), why, False)
        elif count:
            draft = draft.noted(("data", key), f"{count} {words}")
        elif "join" not in draft.data:
            draft = draft.without(f"data.{key}")
    return draft


def with_strain(draft: Draft, dataset: Dataset, length: float) -> tuple[Draft, str]:
    """Return the draft with the strain that a length or a displacement makes of the muscle's own
    length in m, and which of them; empty where a column holds the strain, or there is none.

    A displacement counts as contraction in the direction in which it mostly goes.
    """
    draft = draft.with_section("muscle", {"length": length})
    columns = dataset.recordings[0].columns
    measured = next((one for one in ("length", "displacement") if one in columns), None)
    if "strain" in columns or measured is None:
        return draft, ""
    pooled = np.concatenate([one.columns[measured] for one in dataset.recordings])
    turned = "-" if measured == "displacement" and abs(pooled.min()) > abs(pooled.max()) else ""
    rules = {
        "length": f"({length:g} - length)/{length:g}",
        "displacement": f"{turned}displacement/{length:g}",
    }
    why = "of the length that was given; positive is contraction"
    return draft.with_data("derive", {"strain": rules[measured]}, why, False), measured


def with_second_log(
    draft: Draft, second: Study, folder: Path, target: str, said: Mapping[str, NamedColumn]
) -> Draft:
    """Return the draft with the pressure of a second log, shifted as the changes of the target and
    of the pressure tell, where they do.
    """
    table = table_of(second, folder)
    columns = known_by_titles(table).columns
    columns |= named_by_person(said, table, "--columns", columns)
    if not {"time", "pressure"} <= columns.keys() or "time" not in draft.data["columns"]:
        raise DataError(
            f"{second.files[0].name}: holds the pressure, and no clock goes on in both logs",
            "write `join` by hand",
        )
    steps = np.diff(table[columns["time"].column].values[0])
    usual = convert(float(np.median(steps[steps > 0])), columns["time"].unit, "s")
    entry: dict[str, Any] = {
        "files": patterns(second.files, folder),
        "reader": second.layout.reader,
        **second.layout.settings,
        "columns": {name: columns[name].as_spec() for name in ("time", "pressure")},
        "shift": "auto",
        "match": {"first": target, "second": "pressure"},
        "max_gap": two_digits(BREAK * usual),
    }
    sure = columns["pressure"].sure
    try:
        notes = read_draft(lenient(draft.with_data("join", [entry])), folder, target).notes
        told = next((note for note in notes if ": shift " in note), "").partition(": ")[2]
    except DataError:  # nothing changes, or several shifts would do
        entry = {key: value for key, value in entry.items() if key != "match"} | {"shift": 0.0}
        told, sure = "are both clocks one?", False
    why = f"the pressure is in a log of its own; {told}; {columns['pressure'].why}"
    return draft.with_data("join", [entry], why, sure)
