"""Summarise a fit as statistics programs do: list the coefficients with their standard errors, and
show how well the training data determine them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from mapmore_cli.domain.models import Model
from mapmore_cli.domain.results import FitResult
from mapmore_cli.domain.scores import OWN, ScoreTable
from mapmore_cli.modelling.kinds import equations, parameters
from mapmore_cli.modelling.literature.linear import half_width
from mapmore_cli.modelling.validation.metrics import information_criteria
from mapmore_cli.reporting.fit_tables import coefficient_rows
from mapmore_cli.reporting.table import Cells, Table

COLUMNS = ("part", "term", "coefficient #.6g", "standard error .3g", "t .3g", "ERR [%] .4f")

MOST_EQUATIONS = 4

NO_CRITERIA = (
    "AIC and BIC are left out, because samples had different weights or a robust loss was "
    "minimised, so that their likelihood does not apply."
)


def summary_table(fit: FitResult, model: Model, scores: ScoreTable, weighed: bool) -> Table:
    """Return a table with a row for each coefficient of the formula, of every segment, or of the
    model with memory. `weighed` is True if samples had different weights in the fit.

    Coefficients of terms belong to scaled coordinates; parameters of formulas have their own units.
    The notes give the number n of samples and the number of parameters; AIC and BIC, which are
    valid for plain least squares only; the first equations of the model in physical units; the
    assumptions of the standard errors; and the coefficients whose 95 % interval includes zero.
    """
    rows, unclear = list[Cells](), list[str]()
    notes, sizes = list[str](), list[str]()
    outputs = list(zip(fit.each, model.each, scores.each, strict=True))
    for output_fit, output_model, table in outputs:
        prefix = f"{output_model.output.name}: " if len(outputs) > 1 else ""
        for part, term, value, error, err, width in _fitted_numbers(output_fit, output_model):
            t = value / error if error else math.nan
            rows.append((f"{prefix}{part}", term, value, error, t, 100 * err))
            if width > abs(value):
                unclear.append(f"{term} of {prefix}{part}")
        if output_fit.formula is not None:
            notes += (output_fit.formula.errors_note, *output_fit.formula.notes)
        notes += dict.fromkeys(piece.selection.errors_note for piece in output_fit.pieces)
        count, unit = parameters(output_model), output_model.output.unit
        for row in table.scores:
            if (row.model, row.split, row.curve) == (OWN, "train", "all"):
                size = f"n = {row.n} training samples, {count} parameters, RMSE {row.rmse:.4g}"
                aic, bic = information_criteria(row.n, row.rmse, count)
                criteria = f": AIC {aic:.6g}, BIC {bic:.6g}." if not weighed else f". {NO_CRITERIA}"
                sizes.insert(0, f"{prefix}{size} {unit}{criteria}")
    if unclear:
        notes.append(
            f"Not distinguishable from zero with the training data (95 %): {', '.join(unclear)}."
        )
    return Table.of(
        "summary",
        f"Summary of {model.name}",
        COLUMNS,
        rows,
        *sizes,
        *_in_physical_units(model),
        *notes,
    )


def _in_physical_units(model: Model) -> Iterator[str]:
    """Yield the equations of the model in physical units, at most `MOST_EQUATIONS` of them."""
    lines = equations(model)
    for line in lines[:MOST_EQUATIONS]:
        yield f"In physical units: {line.id} = {line.text}"
    if len(lines) > MOST_EQUATIONS:
        yield f"The model has {len(lines)} equations in all; its `equations` lists them."


def _fitted_numbers(
    fit: FitResult, model: Model
) -> Iterator[tuple[str, str, float, float, float, float]]:
    """Yield a tuple for each coefficient: the part of the model, the term, the value, its standard
    error, the error reduction ratio of the term, and half the width of the 95 % interval.
    """
    if formula := fit.formula:
        freedom = formula.samples - len(formula.parameters)
        for name, value in formula.parameters.items():
            error = formula.errors[name]
            yield formula.name, name, value, error, math.nan, half_width(error, freedom)
    for piece, row in coefficient_rows(fit, model):
        numbers = row["coefficient"], row["standard_error"], row["err"], row["width"]
        yield piece.id, row["term"], *numbers
