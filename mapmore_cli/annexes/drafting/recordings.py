"""The recordings of a study, read as its draft says, and the draft with what they need to be
read.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from mapmore_cli.annexes.drafting.answers import Answers
from mapmore_cli.annexes.drafting.columns import (
    Table,
    guess_columns,
    names_of,
    span,
    told_guesses,
    turn_of,
)
from mapmore_cli.annexes.drafting.draft import Column, Draft, Guess, range_of
from mapmore_cli.annexes.drafting.groups import Group, patterns
from mapmore_cli.annexes.drafting.preview import Preview
from mapmore_cli.checking.evidence import two_digits
from mapmore_cli.checking.names import words_of
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import IngestSlice, relative_name
from mapmore_cli.ingestion.samples import unwrapped
from mapmore_cli.spec.sections.data import Data
from mapmore_cli.spec.units import convert, default_unit, is_canonical
from mapmore_cli.storage.tables.cells import NotANumber

MOST_FILES = 5
MOST_WORDS = 3  # that stand for missing numbers in one column; more are a column of words
WHOLE = 0.5  # of the samples, at least
GAPS = {"longer_than": 60.0, "action": "split"}
FEW_RESETS, LONG_ENOUGH = (
    3,
    100,
)  # pieces of a file, beyond which its clock is no clock, and samples of a piece
REST = 20.0  # usual steps of the second log, beyond which it rested
OVERLAP = 0.5  # of the shorter log, in which both clocks run, where they are one
_VOLTS = re.compile(r"[\[(]\s*m?V\s*[\])]|(?i:\bvolts?\b)")
T = TypeVar("T")


class _Columns(Data):
    """The columns of a file before anything is known of them: any may hold time stamps."""

    def clocks(self) -> frozenset[Column]:
        return frozenset(column.column for column in self.columns.values())


def read_draft(draft: Draft, folder: Path, measured: str, form: type[Data] = Data) -> Dataset:
    """Return the dataset of a draft, in the units that it says; DataError where it cannot be
    made.
    """
    data = form.model_validate(draft.data)
    units = {
        name: "kPa/s" if name == "pressure_rate" else default_unit(name) for name in data.quantities
    }
    units |= draft.spec.get("units", {})
    try:
        return build_dataset(
            IngestSlice(data=data, measured=measured, component="static", units=units), folder
        )
    except SpecError as fault:
        raise DataError(fault.message, fault.remedy) from fault


def read_tolerantly(
    draft: Draft, folder: Path, measured: str, form: type[Data] = Data
) -> tuple[Draft, Dataset, tuple[str, ...]]:
    """Return a draft that leaves samples without a number out, with its dataset, and the few words
    that stand for such numbers, as `---`.

    Raises DataError where its cells hold more words, or hardly a number; and for a cell that is no
    such word, as a date.
    """
    words: tuple[str, ...] = ()
    while True:
        draft = draft.with_data("missing", {"tokens": list(words)} if words else "drop")
        try:
            dataset = read_draft(draft, folder, measured, form)
        except NotANumber as fault:
            if len(words) == MOST_WORDS or fault.known:
                raise
            words = (*words, fault.cell)
            continue
        if words and sum(one.rows_kept for one in dataset.recordings) < WHOLE * sum(
            one.rows_read for one in dataset.recordings
        ):
            raise DataError(f"hardly a number among {', '.join(map(repr, words))}")
        return draft, dataset, words


def table_of(group: Group, folder: Path) -> Table:
    """Return the columns of numbers of a few files of a group, those of encoders unwrapped; columns
    of text and empty ones are missing.

    Where cells are empty every column is read by itself: one that is hardly filled must not hide
    the others. Raises DataError where no column is left.
    """
    layout = group.layout
    raw: dict[Column, list[Array]] = {}
    lost = 1
    with suppress(DataError):
        raw, lost = _read(group, folder, layout.columns)
    if lost:
        raw = {}
        for column in layout.columns:
            try:
                raw |= _read(group, folder, (column,))[0]
            except DataError as fault:
                if (
                    isinstance(fault, NotANumber)
                    and fault.known
                    and layout.columns.index(column) in layout.numeric
                ):
                    raise
                last = fault
    if not raw:
        raise last
    turns = {
        column: turn for column, values in raw.items() if (turn := turn_of(values)) is not None
    }
    raw |= {column: [unwrapped(one, turn) for one in raw[column]] for column, turn in turns.items()}
    titles, below = (
        dict(zip(layout.columns, texts, strict=False))
        for texts in (layout.titles or (), layout.below)
    )
    return Table(titles, raw, below, turns)


def _read(
    group: Group, folder: Path, columns: Sequence[Column]
) -> tuple[dict[Column, list[Array]], int]:
    """Return the columns, and how many samples are lost because one of them has none."""
    names = {f"column_{place}": column for place, column in enumerate(columns)}
    data = {
        "files": [
            {"path": relative_name(file, folder), "id": str(place)}
            for place, file in enumerate(some_of(group.files))
        ],
        "reader": group.layout.reader,
        **group.layout.settings,
        "columns": {name: {"column": column} for name, column in names.items()},
    }
    _, dataset, _ = read_tolerantly(
        Draft({"data": data, "units": dict.fromkeys(names, "1")}),
        folder,
        next(iter(names)),
        _Columns,
    )
    lost = sum(one.dropped.get("missing value", 0) for one in dataset.recordings)
    return {
        column: [np.asarray(one.columns[name]) for one in dataset.recordings]
        for name, column in names.items()
    }, lost


def some_of(files: Sequence[T]) -> Sequence[T]:
    """Return a few files from all over the list: columns are the same in all, and files can be many
    and large.
    """
    return files[:: -(-len(files) // MOST_FILES)]


def with_columns(draft: Draft, guesses: Mapping[str, Guess], table: Table) -> Draft:
    """Return the draft with its columns, their units where the names are no canonical quantities,
    and a word on those that are not used.

    These have a title, or values that move. What comes of an encoder is unwrapped.
    """
    for name, one in guesses.items():
        if (turn := table.turns.get(one.column)) is not None:
            why = f"{one.why}; it jumps by {turn:g}: an encoder that wraps"
            guesses = {**guesses, name: replace(one, unwrap=turn, why=why, sure=False)}
    used = {guess.column for guess in guesses.values()}
    moving = [column for column, values in table.raw.items() if span(values)]
    unused = [column for column in dict.fromkeys([*table.titles, *moving]) if column not in used]
    left = ", ".join(
        table.titles.get(column) or f"column {column}"
        for column in unused
        if table.titles.get(column) or column in moving
    )
    draft = draft.with_data(
        "columns",
        {one: guess.as_spec() for one, guess in guesses.items()},
        f"left out: {left}" if left else None,
    )
    own = {
        one: _model_unit(guess.unit)
        for one, guess in guesses.items()
        if not is_canonical(one) and guess.unit != "1"
    }
    if own:
        draft = draft.with_section("units", own)
    if "time" in guesses:
        draft = draft.without("data.sample_time")
    for quantity, guess in guesses.items():
        draft = draft.noted(("data", "columns", quantity), guess.why, guess.sure)
    return replace(
        draft, rivals={quantity: guess.rivals for quantity, guess in guesses.items()}, raw=table.raw
    )


def _model_unit(unit: str) -> str:
    """Return the model's unit of a quantity of no canonical name: kPa of all pressures, else what
    it was measured in.
    """
    try:
        convert(1.0, unit, "kPa")
    except SpecError:
        return unit
    return "kPa"


def with_volts(draft: Draft, layout: Preview) -> Draft:
    """Return the draft with a word on pressures, forces and positions whose titles, or the units
    below them, say volts.
    """
    titled = zip_longest(layout.columns, layout.titles or (), layout.below, fillvalue="")
    volts = {column for column, title, below in titled if _VOLTS.search(f"{title} ({below})")}
    for name, told in draft.data["columns"].items():
        if told["column"] in volts and told.get("unit", "V") not in ("V", "mV"):
            how = (
                "its title says volts: give the calibration of its sensor, as "
                f"{name}:{told['unit']}*2.5-1.25"
            )
            draft = draft.noted(
                ("data", "columns", name),
                f"{how}; {draft.notes['data', 'columns', name].why}",
                False,
            )
    return draft


# What recordings need to be read
# --------------------------------------------------------------------------------------------------


def _lenient(draft: Draft) -> Draft:
    return (
        draft.with_data("missing", "drop")
        .with_data("repeated_time", "average")
        .with_data("glitches", "drop")
    )


def cleaned(draft: Draft, folder: Path, target: str) -> tuple[Draft, Dataset]:
    """Return the draft with what its recordings need to be read, and these; a clock that runs
    backwards is left out.

    Raises DataError where they cannot be read, or where another log is joined by such a clock.
    """
    draft = _lenient(draft)
    try:
        read, dataset, words = read_tolerantly(draft, folder, target)
    except DataError as fault:
        if "time" not in draft.data["columns"]:
            raise
        found = _split_at_resets(draft, folder, target)
        if found is not None:
            read, dataset, words = found
            read = read.with_data(
                "gaps",
                GAPS,
                f"s: the clock is set back, and splits the recording: {fault.message}",
                False,
            )
        elif any(log.get("on") != "row" for log in draft.data.get("join", ())):
            raise
        else:
            columns = {
                name: column for name, column in draft.data["columns"].items() if name != "time"
            }
            draft = draft.with_data("columns", columns, f"time is left out: {fault.message}", False)
            read, dataset, words = read_tolerantly(draft, folder, target)
    return _told_losses(read, dataset, target, words, folder), dataset


def _split_at_resets(
    draft: Draft, folder: Path, target: str
) -> tuple[Draft, Dataset, tuple[str, ...]] | None:
    """Return what is read where the clock splits recordings as it is set back; None where it is no
    clock at all.
    """
    try:
        found = read_tolerantly(draft.with_data("gaps", GAPS), folder, target)
    except DataError:
        return None
    recordings = found[1].recordings
    files = len({one.source for one in recordings})
    return (
        found
        if len(recordings) <= files + FEW_RESETS
        and min(one.rows_kept for one in recordings) > LONG_ENOUGH
        else None
    )


def _told_losses(
    draft: Draft, dataset: Dataset, target: str, words: Sequence[str], folder: Path
) -> Draft:
    """Return the draft with what is done about empty cells, stamps that repeat, and a force that
    pushes, where there are any.
    """
    missing, repeated, glitches = (
        sum(one.dropped.get(reason, 0) for one in dataset.recordings)
        for reason in ("missing value", "repeated time", "glitch of the clock")
    )
    rule = draft.data["missing"]
    of_log = {
        "repeated_time": "stamps of the joined log repeat",
        "glitches": f"{glitches or 'some'} stamps are glitches",
    }
    draft = draft.without(
        "data.missing", *([] if "join" in draft.data else [f"data.{key}" for key in of_log])
    )
    for key, why in of_log.items() if "join" in draft.data else ():
        try:
            read_draft(draft.without(f"data.{key}").with_data("missing", rule), folder, target)
            draft = draft.without(f"data.{key}")
        except DataError:
            draft = draft.noted(("data", key), why)
    if glitches and "glitches" not in draft.data:
        draft = draft.with_data("glitches", "drop", f"{glitches} stamps lie before an earlier one")
    if words:
        why = (
            f"{missing} samples have a cell that is empty or holds "
            f"{', '.join(map(repr, words))}: taken as no value"
        )
        draft = draft.with_data("missing", rule, why, False)
    elif missing:
        draft = draft.with_data("missing", rule, f"{missing} samples have an empty cell")
    if repeated:
        draft = draft.with_data(
            "repeated_time", "average", f"{repeated} time stamps repeat: the logger rounds them"
        )
    force = np.concatenate([one.columns[target] for one in dataset.recordings])
    if target == "force" and -force.min() > force.max():
        why = (
            f"{draft.notes['data', 'columns', 'force'].why}: it pushes, or its sign is "
            "turned; `scale: -1` makes push positive"
        )
        draft = draft.noted(("data", "columns", "force"), why, False)
    return draft


def with_strain(draft: Draft, dataset: Dataset, length: float) -> Draft:
    """Return the draft with the strain that a length or a displacement makes of the muscle's own
    length in m, where no column holds it.

    A displacement counts as contraction in the direction in which it mostly goes.
    """
    draft = draft.with_section("muscle", {**draft.spec["muscle"], "length": length})
    columns = dataset.recordings[0].columns
    measured = next((one for one in ("length", "displacement") if one in columns), None)
    if "strain" in columns or measured is None:
        return draft
    pooled = np.concatenate([one.columns[measured] for one in dataset.recordings])
    turned = "-" if measured == "displacement" and abs(pooled.min()) > abs(pooled.max()) else ""
    rule = (
        f"({length:g} - length)/{length:g}"
        if measured == "length"
        else f"{turned}displacement/{length:g}"
    )
    return draft.with_data(
        "derive", {"strain": rule}, "of the length that was given; positive is contraction", False
    )


# Two files of one test
# --------------------------------------------------------------------------------------------------


def _joined(group: Group, folder: Path, columns: Mapping[str, Guess]) -> dict[str, Any]:
    """Return the entry of `join` for columns of another log."""
    entry = {
        "files": patterns(group.files, folder),
        "reader": group.layout.reader,
        **group.layout.settings,
    }
    return {**entry, "columns": {name: guess.as_spec() for name, guess in columns.items()}}


def with_second_log(
    draft: Draft, second: Group, folder: Path, first: Array, target: str, answers: Answers | None
) -> Draft:
    """Return the draft with the pressure of a second log; `first` is the time `(n,)` of the one it
    has, in s.

    Its shift is what the changes of the target and of the pressure tell, where they do.
    """
    table = table_of(second, folder)
    guesses = guess_columns(table) | ({} if answers is None else told_guesses(answers, table))
    if not {"time", "pressure"} <= guesses.keys():
        raise DataError(
            f"{second.files[0].name}: its time and its pressure are no numbers",
            "write `join` by hand",
        )
    time = convert(table.raw[guesses["time"].column][0], guesses["time"].unit, "s")
    low, high = float(first.min()), float(first.max())
    common = min(high, float(time[-1])) - max(low, float(time[0]))
    one_clock = common > OVERLAP * min(high - low, float(np.ptp(time)))
    steps = np.diff(time)
    forward = steps[steps > 0]
    if not forward.size:
        raise DataError(f"{second.files[0].name}: its time never goes on", "write `join` by hand")
    entry = _joined(second, folder, {name: guesses[name] for name in ("time", "pressure")})
    entry["shift"] = 0.0 if one_clock else float(f"{low - time[0]:.6g}")
    usual = float(np.median(forward))  # of stamps in whole seconds, many are alike
    if (steps > REST * usual).any():
        entry["max_gap"] = two_digits(REST * usual)
    clocks = "both clocks seem to be one" if one_clock else "both logs are taken to begin together"
    beside = "the pressure is in a log of its own"
    draft = draft.with_data(
        "join", [entry], f"{beside}; {clocks}: look at `shift`; {guesses['pressure'].why}", False
    )
    matched = {key: value for key, value in entry.items() if key != "shift"}
    matched |= {"shift": "auto", "match": {"first": target, "second": "pressure"}}
    try:
        notes = read_draft(_lenient(draft).with_data("join", [matched]), folder, target).notes
    except DataError:
        return draft
    told = next((note for note in notes if ": shift " in note), "").partition(": ")[2]
    return draft.with_data("join", [matched], f"{beside}; {told or clocks}", False)


def with_column_beside(
    draft: Draft, first: Group, other: Group, folder: Path
) -> tuple[Draft, list[str], str]:
    """Return the draft of two files of one column each, joined row by row, with input and target;
    the file that comes first drives.
    """
    drive, response = names_of(
        [0, 1],
        {place: "_".join(words_of(one.files[0].name)) for place, one in enumerate((first, other))},
    )
    table = table_of(first, folder)
    ((column, values),) = table.raw.items()
    why = f"taken as what drives, as its file comes first; without a unit; {range_of(values)}"
    draft = with_columns(draft, {drive: Guess(column, "1", why, False)}, replace(table, turns={}))
    entry = {**_joined(other, folder, {response: Guess(other.layout.columns[0])}), "on": "row"}
    return (
        draft.with_data(
            "join",
            [entry],
            "a single column as well, of as many rows: taken as what follows",
            False,
        ),
        [drive],
        response,
    )
