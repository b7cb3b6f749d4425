"""Read tables for `predict`, `invert` and `adapt` that are not CSV files with the model's names and
units. Such tables are read like the recordings of a spec, and converted to lines of a CSV table.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from mapmore_cli.domain.errors import DataError, UsageError, Warn
from mapmore_cli.domain.models import Model
from mapmore_cli.ingestion.files import Log, Meter
from mapmore_cli.ingestion.reading import read_tables
from mapmore_cli.ingestion.samples import Samples
from mapmore_cli.pipeline.records import RECORDING, reading_of
from mapmore_cli.storage.readers import READERS, reader_of
from mapmore_cli.storage.tables.beginnings import is_binary
from mapmore_cli.storage.tables.lines import encoding_of, guess_encoding, head_of
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.units import default_unit, is_same, unit_of


@dataclass(frozen=True)
class TableOptions:
    """Options of the command line for reading a table.

    - `settings`: settings of the section `data` of a spec, for example `{"delimiter": ";"}`.
    - `columns`: title or index of the column of each quantity.
    - `units`: unit of the column of each quantity.
    """

    settings: Mapping[str, Any] = field(default_factory=dict)
    columns: Mapping[str, str | int] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def says_something(self) -> bool:
        """Return True if at least one option was given."""
        return bool(self.settings or self.columns or self.units)


def is_foreign(path: Path, options: TableOptions) -> bool:
    """Return True if a table must be read by one of the readers of recordings, because it is no
    plain CSV file or because options were given.
    """
    if options.says_something:
        return True
    if not path.is_file():
        return False
    reader = reader_of(path)
    is_text = reader is None or reader is READERS["csv"]
    head = head_of(path)
    # True also for a binary file of unknown format, because the reader raises an error that says
    # what is wrong with it
    return not is_text or is_binary(head) or encoding_of(head).startswith("utf-16")


def columns_of(model: Model, solved_for: str | None) -> Sequence[Sequence[str]]:
    """Return the sets of columns with which a table can be used for the model; the table must have
    all columns of one set. Rates and directions that are inputs of the model are columns in the
    first set. In the second set, they are computed from other columns. If the model is inverted for
    the input `solved_for`, there is only one set, with the output instead of this input.
    """
    if solved_for is not None:
        inputs = (name for name in model.input_names if name != solved_for)
        return [[model.output.name, *inputs]]
    readings = (reading_of(model, [signal.name for signal in model.signals]), reading_of(model, []))
    return [reading.columns + reading.outputs for reading in readings]


def units_of(model: Model, ways: Sequence[Sequence[str]]) -> dict[str, str]:
    """Return the unit of every column in the sets `ways`, by name."""
    known = {quantity.name: quantity.unit for quantity in (*model.inputs, *model.outputs)}
    return {name: known.get(name) or default_unit(name) for way in ways for name in way}


def foreign_lines(
    path: Path,
    options: TableOptions,
    ways: Sequence[Sequence[str]],
    units: Mapping[str, str],
    warn: Warn,
) -> Iterator[str]:
    """Read a table, and yield it as the lines of a CSV table with the names of quantities as header
    and numbers in the given `units`. `ways` are the possible sets of columns; the first set whose
    columns all exist in the file is used. A column `recording`, with numbers or texts, is included
    if the file has it.

    Raises DataError for a file that cannot be read, and for a column whose title ends with a unit
    other than the unit in which the column is read. Raises UsageError for settings that the reader
    of the file does not use.
    """
    with_recordings = [[*way, RECORDING] for way in ways]
    ways = with_recordings if RECORDING in options.columns else [*with_recordings, *ways]
    meter = Meter([], lambda *_: None)
    samples = _samples(path, options, ways, {**units, RECORDING: "1"}, meter)
    for doubt in samples.doubts:
        warn(doubt)
    names = {number: text for text, number in meter.texts.get(RECORDING, {}).items()}
    columns = [
        [_quoted(names[x]) if x == x else "" for x in values.tolist()]
        if name == RECORDING
        else ["" if x != x else repr(x) for x in values.tolist()]
        for name, values in samples.columns.items()
    ]
    yield ",".join(samples.columns) + "\n"
    for row in zip(*columns, strict=True):
        yield ",".join(row) + "\n"


def _quoted(text: str) -> str:
    """Return a text as a field of a CSV file, in quotation marks if it needs them."""
    doubled = text.replace('"', '""')
    return f'"{doubled}"' if {*text} & {*',"\r\n'} else text


def _samples(
    path: Path,
    options: TableOptions,
    ways: Sequence[Sequence[str]],
    units: Mapping[str, str],
    meter: Meter,
) -> Samples:
    for number, names in enumerate(ways, start=1):
        _refuse_titles(path.name, options, names, units)
        data = _data_of(path, options, names)
        try:
            log = Log(path, path.name, None)
            samples, *others = read_tables(log, data, data, units, meter)
        except DataError as error:
            if number < len(ways) and "there is no " in error.message:
                continue
            raise
        if others:
            raise DataError(
                f"{path.name}: holds several recordings, and this command reads one at a time",
                "name one sheet or file",
            )
        return samples
    raise AssertionError


def _data_of(path: Path, options: TableOptions, names: Sequence[str]) -> Data:
    """Return a section `data`, as in a spec, with which this table can be read. Raises UsageError
    for options that do not fit the table.
    """
    named = (*options.columns, *options.units)
    if unknown := next((name for name in named if name not in names), ""):
        raise UsageError(
            f"the table cannot contain '{unknown}': the model does not use it",
            f"name one of {', '.join(names)}",
        )
    reader, settings = reader_of(path) or READERS["csv"], dict(options.settings)
    if reader is READERS["csv"]:
        settings.setdefault("encoding", guess_encoding(path))
    columns: dict[str, dict[str, Any]] = {
        name: {"column": options.columns.get(name, name), "unit": options.units.get(name)}
        for name in dict.fromkeys(names)
    }
    if RECORDING in columns:
        columns[RECORDING]["texts"] = True
    sections = {"files": [path.name], "reader": reader.name, "columns": columns, "missing": "drop"}
    try:
        return Data.model_validate(sections | settings)
    except ValidationError as fault:
        first = fault.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise UsageError(
            f"{path.name} ({reader.name}): {key}: {first['msg']}",
            "`mapmore predict --help` explains each option",
        ) from fault


def _refuse_titles(
    label: str, options: TableOptions, names: Sequence[str], units: Mapping[str, str]
) -> None:
    """Raise DataError if the title of a column ends with a unit, such as `force [N]`, that differs
    from the unit in which the column is read.
    """
    for name in names:
        title, unit = str(options.columns.get(name, "")), options.units.get(name, units[name])
        unit_in_title = unit_of(title, unit) if title.rstrip().endswith(("]", ")")) else None
        if (
            name not in options.units
            and unit_in_title is not None
            and not is_same(unit_in_title, unit)
        ):
            raise DataError(
                f"{label}: the column '{title}' is read as {name} in {unit}, but its title says "
                f"{unit_in_title}",
                f"write `--units {name}={unit_in_title}`, or `--units {name}={unit}` if the title "
                "is wrong",
            )
