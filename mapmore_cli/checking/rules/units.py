"""Rules about units, numbers of a size that no muscle has, and labels that cannot be set."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mapmore_cli.checking.names import read_label, unit_in
from mapmore_cli.checking.rules import Issue, Subject
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.spec.units import convert, default_unit
from mapmore_cli.storage.readers import READERS
from mapmore_cli.storage.tables.cells import shortened

LARGEST_STRAIN = 1.5  # of any muscle
LARGEST_PRESSURE = 5000.0  # kPa
PRESSURE_IN_BAR = (1.0, 12.0)  # largest value: a usual supply in bar
# times pressure and bore area; a braid of 20 degrees reaches 14 at zero strain
STRONGEST_PULL = 25.0
# s between samples, in a record of a logger, which has so many
LONGEST_STEP, SAMPLES_OF_A_LOGGER = (
    0.2,
    1000,
)


def strain_in_per_cent(subject: Subject) -> Iterator[Issue]:
    """Find strains above 1.5, which were meant in per cent."""
    largest = subject.largest("strain", "1")
    if largest > LARGEST_STRAIN:
        message = (
            f"strain reaches {largest:.3g}, which is {100 * largest:.4g} %: it looks like per "
            "cent read as a fraction"
        )
        yield Issue(
            "error", "strain-in-per-cent", subject.source("strain"), message, 'say `unit: "%"`'
        )


def pressure_in_pascals(subject: Subject) -> Iterator[Issue]:
    """Find pressures above 5 MPa, which were meant in Pa."""
    largest = subject.largest("pressure", "kPa")
    if largest > LARGEST_PRESSURE:
        message = (
            f"pressure reaches {largest:.6g} kPa: it looks like Pa read as "
            f"{_declared(subject, 'pressure')}"
        )
        yield Issue(
            "error", "pressure-in-pascals", subject.source("pressure"), message, "say `unit: Pa`"
        )


def pressure_in_bar(subject: Subject) -> Iterator[Issue]:
    """Find pressures that never exceed a few kPa, which may have been meant in bar."""
    largest = subject.largest("pressure", "kPa")
    if (
        PRESSURE_IN_BAR[0] <= largest <= PRESSURE_IN_BAR[1]
        and _declared(subject, "pressure") == "kPa"
    ):
        message = f"pressure reaches no more than {largest:.3g} kPa: it may be bar"
        yield Issue(
            "warning",
            "pressure-in-bar",
            subject.source("pressure"),
            message,
            "say `unit: bar` if it is",
        )


def pull_of_the_bore(subject: Subject) -> Iterator[Issue]:
    """No muscle pulls much harder than a braided one, `F = P pi r^2 (3/tan^2 - 1/sin^2)(braid
    angle)` at zero strain.
    """
    diameter = subject.spec.muscle.diameter
    if diameter is None or not subject.has("pressure", "force"):
        return
    bore = subject.largest("pressure", "Pa") * math.pi * diameter**2 / 4
    pull = convert(subject.span("force")[1], subject.units["force"], "N")
    if bore > 0 and pull > STRONGEST_PULL * bore:
        message = (
            f"the force reaches {pull:.4g} N, {pull / bore:.0f} times pressure times bore "
            f"area; {STRONGEST_PULL:g} is more than braids give"
        )
        remedy = "look at the pressure's unit (psi, bar?), the force's and `muscle.diameter`"
        yield Issue("warning", "force-too-large", subject.source("pressure"), message, remedy)


def time_in_milliseconds(subject: Subject) -> Iterator[Issue]:
    """Find slow stamps, which may be in ms: a logger takes many samples a second.

    Names that tell the unit are believed, and so is a spec that tells it, or the step from sample
    to sample.
    """
    data = subject.spec.data
    column = data.columns.get("time")
    is_told = data.every > 1 or data.resample is not None or not subject.has("time")
    if column is None or column.unit is not None or is_told:
        return
    label = read_label(column.column) if isinstance(column.column, str) else None
    if label is not None and label.unit is not None:
        return
    for recording in (one for one in subject.recordings if one.rows_kept >= SAMPLES_OF_A_LOGGER):
        steps = np.diff(convert(recording.columns["time"], subject.units["time"], "s"))
        step = float(np.median(steps))
        if step > LONGEST_STEP:
            message = (
                f"{recording.name}: one sample every {step:.3g} s, {steps.sum() / 3600:.3g} hours "
                "in all, which is slow for a muscle"
            )
            remedy = "say `unit: ms` if the stamps are in ms"
            place = subject.source("time")
            yield Issue("hint", "time-in-milliseconds", place, message, remedy)
            return  # the others are of the same logger


def unit_in_the_name(subject: Subject) -> Iterator[Issue]:
    """Find columns whose name tells another unit: one called `P_psi` is hardly in kPa."""
    for name, column in subject.spec.data.columns.items():
        label = read_label(column.column) if isinstance(column.column, str) else None
        if (
            label is not None
            and label.quantity == name
            and (declared := _contradicted(subject, name, label.unit))
        ):
            message = (
                f"column '{column.column}' is read in {declared}, but its name says {label.unit}"
            )
            yield Issue(
                "warning",
                "unit-in-name",
                subject.source(name),
                message,
                f'say `unit: "{label.unit}"`, or rename the column',
            )


def unit_line(subject: Subject) -> Iterator[Issue]:
    """Find lines of units that say otherwise: kN under the name, and the column is read in N."""
    data = subject.spec.data
    peek = READERS[data.reader].peek
    if peek is None or int(data.header) < 2 or not subject.recordings:
        return
    path = subject.folder / subject.recordings[0].source
    for top in peek(path, data.skip_rows + int(data.header)):
        if all(
            getattr(data, key) == value
            for key, value in top.settings.items()
            if key in type(data).model_fields
        ):
            names, *below = [list(map(str, row)) for row in top.rows[data.skip_rows :]] or [[]]
            yield from _units_below(subject, [name.strip() for name in names], below)
            return


def _units_below(subject: Subject, names: list[str], below: list[list[str]]) -> Iterator[Issue]:
    for name, column in subject.spec.data.columns.items():
        place = (
            column.column
            if isinstance(column.column, int)
            else names.index(column.column)
            if column.column in names
            else None
        )
        texts = [row[place] for row in below if place is not None and place < len(row)]
        unit = next((found for text in texts if (found := unit_in(name, text)) is not None), None)
        if declared := _contradicted(subject, name, unit):
            message = (
                f"column '{column.column}' is read in {declared}, but the line under its name "
                f"says {unit}"
            )
            yield Issue(
                "warning",
                "unit-line",
                subject.source(name),
                message,
                f'say `unit: "{unit}"`, or `scale` if the line is wrong',
            )


def _contradicted(subject: Subject, name: str, told: str | None) -> str:
    """Return the unit that a column without a scale is read in, where another one is told; else the
    empty text.
    """
    column = subject.spec.data.columns[name]
    declared = column.unit or default_unit(name, subject.spec.units)
    if told is None or column.scale != 1.0:
        return ""
    try:
        return "" if math.isclose(convert(1.0, told, declared), 1.0) else declared
    except SpecError:  # the name means something else
        return ""


def _declared(subject: Subject, name: str) -> str:
    """Return the unit that a quantity is read in."""
    column = subject.spec.data.columns.get(name)
    return (column.unit if column is not None else None) or subject.units[name]


def formulas_in_labels(subject: Subject) -> Iterator[Issue]:
    """Find labels with a formula that cannot be set."""
    for quantity, label in subject.spec.report.style.labels.items():
        if "$" not in label:
            continue
        from mapmore_cli.reporting.figures.style import wrong_formula

        if fault := wrong_formula(label):
            place = subject.where("report", "style", "labels", quantity)
            message, remedy = (
                f"report.style.labels.{quantity}: {shortened(label)!r} cannot be set ({fault})",
                "mend the formula between the dollars, or remove the dollars",
            )
            yield Issue("error", "label", place, message, remedy)
