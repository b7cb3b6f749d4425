"""The files of a study and its columns, as a `data` section, and the recordings read as that section says."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import IngestSlice, relative_name
from mapmore_cli.spec.sections.data import Data
from mapmore_cli.spec.units import convert, default_unit, is_canonical
from mapmore_cli.storage.tables import NotANumber
from mapmore_cli.study.drafting.columns import LARGEST_FRACTION, Guess, Raw
from mapmore_cli.study.drafting.draft import Draft
from mapmore_cli.study.drafting.groups import Group, number_in, patterns
from mapmore_cli.study.drafting.preview import Preview
from mapmore_cli.study.inspection.evidence import read_label

MOST_FILES = 5
MOST_WORDS = 3  # that stand for missing numbers in one column; more are a column of words
WHOLE = 0.5  # of the samples, at least
MOST_TOLD = 8  # sheets that a note names
T = TypeVar("T")


def dataset_of(data: Mapping[str, Any], folder: Path, measured: str, units: Mapping[str, str] | None = None) -> Dataset:
    """Return the dataset that a `data` section describes; DataError where it cannot be made."""
    model = Data.model_validate(data)
    known = {name: "kPa/s" if name == "pressure_rate" else default_unit(name) for name in model.quantities}
    try:
        return build_dataset(IngestSlice(data=model, measured=measured, component="static", units={**known, **(units or {})}), folder)
    except SpecError as fault:
        raise DataError(fault.message, fault.remedy) from fault


def read_draft(draft: Draft, folder: Path, measured: str) -> Dataset:
    """Return the dataset of a draft, in the units that it says; DataError where it cannot be made."""
    return dataset_of(draft.data, folder, measured, draft.spec.get("units"))


def raw_columns(group: Group, folder: Path) -> dict[str | int, list[Array]]:
    """Every column of numbers of a group, one array `(n,)` for each of a few files; columns of text and empty ones are missing.

    Where cells are empty every column is read by itself: one that is hardly filled must not hide the others. Raises DataError where no
    column is left.
    """
    columns = group.layout.columns
    with suppress(DataError):
        found, lost = _read(group, folder, columns)
        if not lost:
            return found
    found = {}
    for column in columns:
        try:
            found |= _read(group, folder, (column,))[0]
        except DataError as fault:
            last = fault
    if not found:
        raise last from None
    return found


def tolerant(read: Callable[[tuple[str, ...]], Dataset]) -> tuple[Dataset, tuple[str, ...]]:
    """Return a dataset whose samples are mostly whole, with the few words in its cells that then stand for missing numbers, as `---`.

    `read` makes it, given such words. Raises DataError where the cells hold more words, or hardly a number.
    """
    words: tuple[str, ...] = ()
    while True:
        try:
            dataset = read(words)
        except NotANumber as fault:
            if len(words) == MOST_WORDS:
                raise
            words = (*words, fault.cell)
            continue
        if words and sum(one.rows_kept for one in dataset.recordings) < WHOLE * sum(one.rows_read for one in dataset.recordings):
            raise DataError(f"hardly a number among {', '.join(map(repr, words))}")
        return dataset, words


def _read(group: Group, folder: Path, columns: Sequence[str | int]) -> tuple[dict[str | int, list[Array]], int]:
    """Return the columns, and how many samples are lost because one of them has none."""
    names = {f"column_{place}": column for place, column in enumerate(columns)}
    data = {
        "files": [{"path": relative_name(file, folder), "id": str(place)} for place, file in enumerate(_some(group.files))],
        "reader": group.layout.reader,
        **group.layout.settings,
        "columns": {name: {"column": column} for name, column in names.items()},
    }

    def read(words: tuple[str, ...]) -> Dataset:
        return dataset_of({**data, "missing": missing(words)}, folder, next(iter(names)), dict.fromkeys(names, "1"))

    recordings = tolerant(read)[0].recordings
    lost = sum(one.dropped.get("missing value", 0) for one in recordings)
    return {column: [np.asarray(one.columns[name]) for one in recordings] for name, column in names.items()}, lost


def missing(words: Sequence[str]) -> str | dict[str, Any]:
    """Return what the spec says of samples without a number: they are left out, also where one of these words stands for it."""
    return {"tokens": list(words)} if words else "drop"


def _some(files: Sequence[T]) -> Sequence[T]:
    """Return a few files from all over the list: columns are the same in all, and files can be many and large."""
    return files[:: -(-len(files) // MOST_FILES)]


IMPOSSIBLE = 100  # per cent of strain


@dataclass(frozen=True, order=True)
class Told:
    """What the name of a file says about the held quantity, in the model's unit, and how."""

    value: float
    why: str


def constants_of(
    words: Sequence[str | None], quantity: str, length: float | None = None, *, strict: bool = False
) -> tuple[str, list[Told]] | None:
    """Return the held quantity by the names of the files, or by sheets of a workbook, and its values; None where they say nothing.

    Strains above 1.5 are per cent, whether of the length or of the largest strain, and those of 100 are none; a name without a number
    stands for zero. Millimetres are a contraction: a strain of the muscle's `length` in m, and a `displacement` where that is not known.
    With `strict`, numbers without a unit say nothing. `L=180mm` is a length.
    """
    if any(word is None for word in words) or len(set(words)) < 2:
        return None
    numbers = [number_in(word or "") for word in words]
    numbered = [number for number in numbers if number is not None]
    if strict and any(unit is None for _, unit in numbered):
        return None
    if not numbered or any(unit is not None and _kind_of(unit) != quantity for _, unit in numbered):
        return None
    if any(unit in LENGTHS for _, unit in numbered):
        labels = [read_label(word or "") for word in words]
        if len(numbered) == len(words) and all(label is not None and label.quantity == "length" for label in labels):
            return "length", [_told(word, number, "length", "mm", "m") for word, number in zip(words, numbers, strict=True)]
        return _shortened(words, numbers, length)
    largest = max(value for value, _ in numbered)
    if quantity == "strain" and largest >= IMPOSSIBLE:
        return None
    model_unit = default_unit(quantity)
    usual = "%" if quantity == "strain" and largest > LARGEST_FRACTION else model_unit
    return quantity, [_told(word, number, quantity, usual, model_unit) for word, number in zip(words, numbers, strict=True)]


def _shortened(
    words: Sequence[str | None], numbers: Sequence[tuple[float, str | None] | None], length: float | None
) -> tuple[str, list[Told]]:
    """Return the contraction that names tell in mm: a strain where the length of the muscle is known, else a displacement in m."""
    told = []
    for word, number in zip(words, numbers, strict=True):
        by = 0.0 if number is None else convert(number[0], number[1] if number[1] in LENGTHS else "mm", "m")
        why = f"'{word}' " + (f"taken as shortened by {1000 * by:g} mm" if number else "has no number: taken as not shortened")
        if length is None:
            told.append(Told(float(f"{by:.6g}"), f"{why}; say --length to make a strain of it, or the strain itself"))
        else:
            told.append(Told(float(f"{by / length:.6g}"), f"{why} of {1000 * length:g} mm"))
    return ("displacement" if length is None else "strain"), told


LENGTHS = ("mm", "cm")


def _kind_of(unit: str) -> str:
    """Return what a unit in a name is of."""
    return "strain" if unit in ("%", *LENGTHS) else "pressure"


def pressures_told(group: Group) -> list[float]:
    """Return the pressures in bar that names of files which `raw_columns` reads tell with a unit; empty where not all of them do."""
    numbers = [number_in(part.condition or "") for part in _some(group.names)]
    told = [(value, unit) for value, unit in (number for number in numbers if number is not None) if unit not in (None, "%", *LENGTHS)]
    return [convert(value, str(unit), "bar") for value, unit in told] if len(told) == len(numbers) else []


_LOAD = re.compile(r"(\d+(?:[.,]\d+)?)[\s_-]*(kg|g|grams?|kilograms?)(?![a-z])", re.IGNORECASE)
GRAVITY = 9.80665  # m/s^2


def loads_told(group: Group) -> list[Told] | None:
    """Return the dead loads that the names of the files tell, as `Sample 1 Final 200 grams`; None where not all of them do."""
    found = [_LOAD.search(path.name) for path in group.files]
    told = []
    for one in found:
        if one is None:
            return None
        mass = float(one[1].replace(",", ".")) * (1.0 if one[2].casefold().startswith("k") else 1e-3)
        told.append(Told(float(f"{mass * GRAVITY:.6g}"), f"N: '{one[0]}' taken as the mass of a load that hangs there"))
    return told


def _told(word: str | None, number: tuple[float, str | None] | None, quantity: str, usual: str, model_unit: str) -> Told:
    if number is None:
        return Told(0.0, f"'{word}' has no number: taken as {quantity} 0")
    value, unit = number[0], number[1] or usual
    shown = f"{value:g}{'' if unit == '1' else f' {unit}'}"
    why = f"'{word}' taken as {quantity} {shown}: say what was measured, here and in `levels` and `split`"
    return Told(float(f"{convert(value, unit, model_unit):.12g}"), why)


def started(group: Group, name: str, folder: Path, quantity: str, constants: Sequence[Told] | None) -> Draft:
    """Return a draft with the name and the files; those for which the same constant is set share an entry."""
    data: dict[str, Any] = {"files": [], "reader": group.layout.reader, **group.layout.settings}
    draft = Draft({"schema_version": 1, "name": name, "muscle": {"name": name}, "data": data})
    draft = draft.noted(("muscle",), "kind, length and diameter help `check`, as {kind: mckibben, length: 88 mm, diameter: 20 mm}")
    if "header" in group.layout.settings and not group.layout.settings["header"]:
        draft = draft.noted(("data", "header"), "the first line holds numbers")
    if "sample_time" in group.layout.settings:
        draft = draft.noted(("data", "sample_time"), "s: as the file says")
    if group.layout.sheets:
        draft = draft.without_data("sheet")
    if group.layout.left:
        draft = draft.noted(("data", "sheet" if "sheet" in draft.data else "reader"), _of_sheets(group.layout), False)
    if constants is not None and len(constants) == len(group.layout.told):
        (path,) = patterns(group.files, folder)
        for place, one in enumerate(constants):
            draft = draft.noted(("data", "files", place), one.why, False)
        pairs = zip(group.layout.told, constants, strict=True)
        return draft.without_data("sheet").with_data(
            "files", [{"path": path, "sheet": sheet, "set": {quantity: one.value}} for sheet, one in pairs]
        )
    if constants is None and group.of is None:
        found = patterns(group.files, folder)
        told_count = f"{len(group.files)} files" if len(found) < len(group.files) else None
        return draft.with_data("files", _of_each_sheet(found, group.layout)).noted(("data", "files", 0), told_count)
    entries: list[Any] = []
    values: Sequence[Told | None] = constants or [None for _ in group.files]
    specimens: Sequence[tuple[int, str] | None] = group.specimens if group.of else [None for _ in group.files]
    told_of = list(zip(values, specimens, strict=True))
    for pair in sorted(
        set(told_of), key=lambda pair: (pair[0].value if pair[0] else 0.0, pair[0].why if pair[0] else "", pair[1] or (0, ""))
    ):
        told, specimen = pair
        members = [file for file, own in zip(group.files, told_of, strict=True) if own == pair]
        known = ({} if told is None else {quantity: told.value}) | ({} if specimen is None else {str(group.of): specimen[0]})
        why = "; ".join([*([told.why] if told else []), *([f"'{specimen[1]}' is {group.of} {specimen[0]}"] if specimen else [])])
        for pattern in patterns(members, folder):
            draft = draft.noted(("data", "files", len(entries)), why, sure=told is None)
            entries += _of_each_sheet([{"path": pattern, "set": known}], group.layout)
    draft = draft.with_data("files", entries)
    return draft if group.of is None else draft.with_data("groups", {"of": group.of}, "each is scored by itself")


def _of_sheets(layout: Preview) -> str:
    """Which sheets of a workbook are read, and which are not."""
    several = bool(layout.sheets) or "*" in layout.settings.get("sheet", "")
    which = "the sheets that are alike" if several else "the sheet with the most rows"
    names = ", ".join(f"'{name}'" for name in layout.left[:MOST_TOLD]) + (" ..." if len(layout.left) > MOST_TOLD else "")
    return f"{which}; laid out in another way, and left out: {names}"


def _of_each_sheet(entries: Sequence[Any], layout: Preview) -> list[Any]:
    """Return the entries of `files`, once for every sheet where sheets have to be named one by one."""
    if not layout.sheets:
        return list(entries)
    plain = [entry if isinstance(entry, dict) else {"path": entry} for entry in entries]
    return [{**entry, "sheet": sheet} for entry in plain for sheet in layout.sheets]


def with_columns(draft: Draft, guesses: Mapping[str, Guess], titles: Mapping[str | int, str], raw: Raw) -> Draft:
    """Return the draft with its columns, their units where the names are no canonical quantities, and a word on those that are not used.

    These have a title, or `raw` values that move.
    """
    used = {guess.column for guess in guesses.values()}
    moving = [column for column, values in raw.items() if np.ptp(np.concatenate(values))]
    unused = [column for column in dict.fromkeys([*titles, *moving]) if column not in used]
    left = ", ".join(titles.get(column) or f"column {column}" for column in unused if titles.get(column) or column in moving)
    draft = draft.with_data("columns", {one: guess.as_spec() for one, guess in guesses.items()}, f"left out: {left}" if left else None)
    own = {one: model_unit(guess.unit) for one, guess in guesses.items() if not is_canonical(one) and guess.unit != "1"}
    if own:
        draft = draft.with_section("units", own)
    if "time" in guesses:
        draft = draft.without_data("sample_time")
    for quantity, guess in guesses.items():
        draft = replace(draft.noted(("data", "columns", quantity), guess.why, guess.sure), rivals={**draft.rivals, quantity: guess.rivals})
    return draft


_VOLTS = re.compile(r"[\[(]\s*m?V\s*[\])]|(?i:\bvolts?\b)")


def with_volts(draft: Draft, layout: Preview) -> Draft:
    """Return the draft with a word on pressures, forces and positions whose titles, or the units below them, say volts."""
    texts = {
        column: f"{title} ({below})"
        for column, title, below in zip_longest(layout.columns, layout.titles or (), layout.below, fillvalue="")
    }
    for name, told in draft.data["columns"].items():
        if _VOLTS.search(texts[told["column"]]) and told.get("unit", "V") not in ("V", "mV"):
            how = f"its title says volts: give the calibration of its sensor, as {name}:{told['unit']}*2.5-1.25"
            why = f"{how}; {draft.notes['data', 'columns', name].why}"
            draft = draft.noted(("data", "columns", name), why, False)
    return draft


def model_unit(unit: str) -> str:
    """Return the model's unit of a quantity of no canonical name: kPa of all pressures, else what it was measured in."""
    try:
        convert(1.0, unit, "kPa")
    except SpecError:
        return unit
    return "kPa"


def cleaned(draft: Draft, folder: Path, target: str) -> tuple[Draft, Dataset]:
    """Return the draft with what its recordings need to be read, and these; a clock that runs backwards is left out.

    Raises DataError where they cannot be read, or where another log is joined by such a clock.
    """
    draft = draft.with_data("missing", "drop").with_data("repeated_time", "average").with_data("glitches", "drop")
    try:
        dataset, words = tolerant(lambda words: read_draft(draft.with_data("missing", missing(words)), folder, target))
    except DataError as fault:
        if "time" not in draft.data["columns"]:
            raise
        found = _split_at_resets(draft, folder, target)
        if found is not None:
            draft = draft.with_data("gaps", GAPS, f"s: the clock is set back, and splits the recording: {fault.message}", False)
        elif any(log.get("on") != "row" for log in draft.data.get("join", ())):
            raise
        else:
            columns = {name: column for name, column in draft.data["columns"].items() if name != "time"}
            draft = draft.with_data("columns", columns, f"time is left out: {fault.message}", False)
            found = tolerant(lambda words: read_draft(draft.with_data("missing", missing(words)), folder, target))
        dataset, words = found
    return _told_losses(draft, dataset, target, words, folder), dataset


GAPS = {"longer_than": 60.0, "action": "split"}
FEW_RESETS = 3  # pieces of a file, beyond which its clock is no clock


def _split_at_resets(draft: Draft, folder: Path, target: str) -> tuple[Dataset, tuple[str, ...]] | None:
    """Return the recordings, split where the clock is set back, and words for missing numbers; None where it is no clock at all."""
    try:
        dataset, words = tolerant(
            lambda words: read_draft(draft.with_data("missing", missing(words)).with_data("gaps", GAPS), folder, target)
        )
    except DataError:
        return None
    files = len({one.source for one in dataset.recordings})
    sizes = [one.rows_kept for one in dataset.recordings]
    return (dataset, words) if len(sizes) <= files + FEW_RESETS and min(sizes) > LONG_ENOUGH else None


LONG_ENOUGH = 100  # samples of a piece


def _told_losses(draft: Draft, dataset: Dataset, target: str, words: Sequence[str], folder: Path) -> Draft:
    """Return the draft with what is done about empty cells, stamps that repeat, and a force that pushes."""
    lost = {reason: sum(one.dropped.get(reason, 0) for one in dataset.recordings) for reason in ("missing value", "repeated time")}
    glitches = sum(one.dropped.get("glitch of the clock", 0) for one in dataset.recordings)
    told = {
        "repeated_time": ("average", "stamps of the joined log repeat"),
        "glitches": ("drop", f"{glitches or 'some'} stamps are glitches"),
    }
    draft = draft.without_data("missing", *(told if "join" not in draft.data else ()))
    for key, (word, why) in told.items() if "join" in draft.data else ():
        try:
            read_draft(draft.without_data(key).with_data("missing", missing(words)), folder, target)
            draft = draft.without_data(key)
        except DataError:
            draft = draft.with_data(key, word, why)
    if glitches and "glitches" not in draft.data:
        draft = draft.with_data("glitches", "drop", f"{glitches} stamps lie before an earlier one")
    if words:
        why = f"{lost['missing value']} samples have a cell that is empty or holds {', '.join(map(repr, words))}: taken as no value"
        draft = draft.with_data("missing", missing(words), why, False)
    elif lost["missing value"]:
        draft = draft.with_data("missing", "drop", f"{lost['missing value']} samples have an empty cell")
    if lost["repeated time"]:
        draft = draft.with_data("repeated_time", "average", f"{lost['repeated time']} time stamps repeat: the logger rounds them")
    force = np.concatenate([one.columns[target] for one in dataset.recordings])
    if target == "force" and -force.min() > force.max():
        why = f"{draft.notes['data', 'columns', 'force'].why}: it pushes, or its sign is turned; `scale: -1` makes push positive"
        draft = draft.noted(("data", "columns", "force"), why, False)
    return draft


def with_strain(draft: Draft, dataset: Dataset, length: float, position: str | None) -> tuple[Draft, str | None]:
    """Return the draft with the strain that a length or a displacement makes of the muscle's own length in m, where no column holds it.

    A displacement counts as contraction in the direction in which it mostly goes.
    """
    draft = replace(draft, spec={**draft.spec, "muscle": {**draft.spec["muscle"], "length": length}})
    columns = dataset.recordings[0].columns
    measured = next((one for one in ("length", "displacement") if one in columns), None)
    if "strain" in columns or measured is None:
        return draft, position
    pooled = np.concatenate([one.columns[measured] for one in dataset.recordings])
    turned = "-" if measured == "displacement" and abs(pooled.min()) > abs(pooled.max()) else ""
    rule = f"({length:g} - length)/{length:g}" if measured == "length" else f"{turned}displacement/{length:g}"
    draft = draft.with_data("derive", {"strain": rule}, "of the length that was given; positive is contraction", False)
    return draft, "strain" if position is not None else None
