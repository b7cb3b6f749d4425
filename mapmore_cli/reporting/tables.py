"""Make the tables of a report about the data, the errors, and the equations of the model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from mapmore_cli.domain.models import Equation, Model
from mapmore_cli.domain.recording import Curve, CurveRange, Dataset
from mapmore_cli.domain.results import ErrorBand
from mapmore_cli.modelling.validation.repeatability import floors
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import FROM_TO, Cells, Column, Columns, Table


def bands_table(sizes: Sequence[ErrorBand], unit: str) -> Table:
    """Return a table of errors, with a row for each band of measured values and a column for each
    model.
    """
    models = list(sizes[0].rmse) if sizes else []
    errors = [Column(model, unit, ".3g") for model in models]
    columns: Columns = (f"from [{unit}]", f"to [{unit}]", "samples", *errors)
    rows = ((band.low, band.high, band.samples, *map(band.rmse.get, models)) for band in sizes)
    note = (
        "RMSE of the samples whose absolute measured value lies in the band, of held-out data if "
        "there are any."
    )
    return Table.of("bands", "RMSE by the size of what was measured", columns, rows, note)


def recordings_table(dataset: Dataset) -> Table:
    """Return a table with a row for each recording: how many rows of its file were read, how many
    were kept, and how many were dropped for each reason.
    """
    reasons = list(
        dict.fromkeys(reason for recording in dataset.recordings for reason in recording.dropped)
    )
    columns = ("recording", "file", "read", "kept")
    dropped = [Column(f"dropped: {reason}") for reason in reasons]
    rows: list[Cells] = []
    uneven = []
    for recording in dataset.recordings:
        counts = [recording.dropped.get(reason, 0) for reason in reasons]
        rows.append(
            (recording.id, recording.source, recording.rows_read, recording.rows_kept, *counts)
        )
        if recording.rows_read != recording.rows_kept + sum(counts):
            uneven.append(recording.id)
    note = (
        "Resampled, so that kept and dropped rows do not add up to those read: "
        f"{', '.join(uneven)}."
    )
    title = "Rows of every recording"
    return Table.of("recordings", title, (*columns, *dropped), rows, *([note] if uneven else []))


SINGLE_VALUED_NOTE = (
    "Single-valued: how far the best monotone curve over {along} lies from the samples of "
    "that level, in per cent of the largest {target}. "
    "No static model does better there: a loop has two values at one place, and samples have noise."
)


def levels_table(dataset: Dataset, along: str | None = None, whole: Dataset | None = None) -> Table:
    """Return a table of the curves, with their numbers of training and held-out samples in the
    `whole` dataset. Samples at rest are not used for training, so they are counted only if they are
    held out.

    `along` is the quantity that varies within a curve. A static model has a single output for each
    value of `along`. If measured curves have several outputs for one value (loops), a further
    column gives the smallest error that a monotone function of `along` can have on each curve.
    """
    level = f"level [{dataset.unit(dataset.level)}] .6g" if dataset.level else "level"
    columns = ["curve", level, "train", "validate", "recordings"]
    rows: list[Cells] = [
        (curve.id, curve.level, *sample_counts(curve).values(), ", ".join(curve.recordings))
        for curve in (whole or dataset).curves
    ]
    notes: list[str] = []
    if lowest := _single_valued(dataset, along):
        columns.append("single-valued [%] .2g")
        rows = [(*row, 100 * floor) for row, floor in zip(rows, lowest, strict=True)]
        notes.append(SINGLE_VALUED_NOTE.format(along=along, target=dataset.target))
    title = f"Samples of every curve{f', levels of {dataset.level}' if dataset.level else ''}"
    return Table.of("levels", title, columns, rows, *notes)


def sample_counts(curve: Curve) -> dict[str, int]:
    """Return the number of training samples (`train`) and the number of held-out samples
    (`validate`) of a curve.
    """
    return {"train": int(curve.training.sum()), "validate": int(curve.held_out.sum())}


def _single_valued(dataset: Dataset, along: str | None) -> list[float]:
    """Return the smallest RMSE that a monotone function of `along` can have on each curve, as a
    fraction of the largest target of all curves. The list is empty if all these errors are small.
    """
    if along is None or dataset.level is None or along == dataset.level:
        return []
    return floors(
        *([curve.columns[name] for curve in dataset.curves] for name in (along, dataset.target))
    )


def pieces_table(equations: Sequence[Equation], title: str) -> Table:
    """Return a table from which the model can be computed by hand: every piece with its weight and
    its equation.
    """
    rows = [(equation.id, equation.weight or None, equation.text) for equation in equations]
    if any(equation.weight for equation in equations):
        return Table.of("pieces", title, ("piece", "weight", "equation"), rows)
    return Table.of("pieces", title, ("piece", "equation"), [(row[0], row[2]) for row in rows])


def limits_tables(model: Model) -> Iterator[Table]:
    """Yield a table of the training ranges of the inputs in each curve, for a model and for all
    models that it contains. If a model has several outputs, there is one table for all of them,
    because they have the same ranges.
    """
    several = len(model.each) > 1
    for number, part in enumerate(model.each[:1] if several else model.every):
        ranges: Sequence[CurveRange] = getattr(part.body, "ranges", ())
        units = {quantity.name: quantity.unit for quantity in part.inputs}
        names = [name for name in ranges[0].limits if name in units] if ranges else []
        level = [Column("level", units[part.level], ".9g")] if part.level else []
        ends = [Column(f"{name} {end}", units[name], ".6g") for name in names for end in FROM_TO]
        rows = [
            (
                curve.curve,
                *[curve.level] * len(level),
                *(x for name in names for x in curve.limits[name]),
            )
            for curve in ranges
        ]
        title = "Limits: the ranges in which the model was trained" + f" ({part.name})" * (
            part is not model and not several
        )
        if names:
            yield Table.of(
                "limits" + f"_{number}" * (number > 0), title, ("curve", *level, *ends), rows
            )


def shape_table(inputs: ReportInputs) -> Table:
    """Return a table of the known shape of the output along inputs, for example increasing: by how
    much the model violates this shape, and the ranges in which the shape changed the coefficients.
    """
    unit, shape = inputs.model.output.unit, inputs.model.shape
    known = {
        (condition.quantity, condition.word): condition
        for condition in (shape.kept if shape else ())
    }
    rows: list[Cells] = []
    for violation in inputs.violations:
        row = (
            violation.asked.quantity,
            violation.asked.word,
            violation.amount,
            100 * violation.share,
            violation.place or None,
        )
        kept = known.get(row[:2])
        places = kept.binds.items() if kept else ()
        binds = ", ".join(f"{name} {low:.4g} to {high:.4g}" for name, (low, high) in places)
        rows.append((*row, kept.violated if kept else None, binds or None))
    columns = (
        *("along", "the output is", f"violated by [{unit}] .3g", "% of its range .3g", "most for"),
        *(f"without fit.shape [{unit}] .3g", "it binds at"),
    )
    notes = [VIOLATED.format("the kind of muscle" if shape is None else "the spec")]
    if shape:
        notes.append(
            f"RMSE with the shape | without: training {shape.training:.4g} | "
            f"{shape.training_without:.4g} {unit}, held out {shape.held_out:.4g} | "
            f"{shape.held_out_without:.4g} {unit}."
        )
    return Table.of("shape", "Shape of the surface", columns, rows, *notes)


VIOLATED = (
    "Known from {}. Violated by: the largest change of the output in the wrong direction along "
    "one line within the training range, at places where the training output is clearly above its "
    "smallest value."
)


def equations_table(
    equations: Sequence[Equation], others: Mapping[str, Sequence[Equation]]
) -> Table:
    """Return a table with a row for each equation of the model. For the physical units, there are
    two columns: the equation as text and as LaTeX source. Each other set of units in `others` adds
    two such columns.
    """
    with_units = [f"with {units}" for units in others]
    texts = [Column(name, form="text") for name in ("equation", *with_units)]
    sources = [
        Column(name, form="source")
        for name in ("latex", *(f"latex {words}" for words in with_units))
    ]
    weight = ("weight",) if any(equation.weight for equation in equations) else ()
    rows = (
        (
            same[0].id,
            *[same[0].weight] * len(weight),
            *(equation.text for equation in same),
            *(equation.latex for equation in same),
        )
        for same in zip(equations, *others.values(), strict=True)
    )
    return Table.of(
        "equations", "Equations in physical units", ("id", *weight, *texts, *sources), rows
    )
