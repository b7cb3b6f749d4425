"""Rules about units, and labels that cannot be set."""

from __future__ import annotations

from mapmore_cli.checking.names import read_label
from mapmore_cli.checking.rules import Issue, Issues, Subject
from mapmore_cli.storage.readers import READERS
from mapmore_cli.storage.tables.cells import shortened
from mapmore_cli.study.units import can_convert, convert, default_unit, is_same, unit_of


def strain_in_per_cent(subject: Subject) -> Issues:
    """Find contractions by more than the whole length, which were meant in per cent."""
    if not subject.has("strain"):
        return
    largest = convert(subject.span("strain")[1], subject.units["strain"], "1")
    if largest > 1:
        yield Issue(
            "error",
            "strain-in-per-cent",
            subject.source("strain"),
            f"strain reaches {largest:.3g}, which is {100 * largest:.4g} % of the length: it looks "
            "like per cent read as a fraction",
            'say `unit: "%"`; an elongation needs another name, or `scale: -1`',
        )


def unit_in_the_name(subject: Subject) -> Issues:
    """Find columns whose name tells another unit: one called `P_psi` is hardly in kPa."""
    for name, column in subject.spec.data.columns.items():
        label = read_label(column.column) if isinstance(column.column, str) else None
        if (
            label is not None
            and label.quantity == name
            and (declared := _contradicted(subject, name, label.unit))
        ):
            yield Issue(
                "warning",
                "unit-in-name",
                subject.source(name),
                f"column '{column.column}' is read in {declared}, but its name says {label.unit}",
                f'say `unit: "{label.unit}"`, or rename the column',
            )


def unit_line(subject: Subject) -> Issues:
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


def _units_below(subject: Subject, names: list[str], below: list[list[str]]) -> Issues:
    for name, column in subject.spec.data.columns.items():
        place = (
            column.column
            if isinstance(column.column, int)
            else names.index(column.column)
            if column.column in names
            else None
        )
        texts = [row[place] for row in below if place is not None and place < len(row)]
        units = (unit_of(text, column.unit or subject.units[name]) for text in texts)
        unit = next((unit for unit in units if unit is not None), None)
        if declared := _contradicted(subject, name, unit):
            yield Issue(
                "warning",
                "unit-line",
                subject.source(name),
                f"column '{column.column}' is read in {declared}, but the line under its name "
                f"says {unit}",
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
    # a name that says bar may mean absolute ones; what cannot be converted means something else
    agrees = any(is_same(unit, declared) for unit in (told, f"{told} abs"))
    return "" if agrees or not can_convert(told, declared) else declared


def formulas_in_labels(subject: Subject) -> Issues:
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
