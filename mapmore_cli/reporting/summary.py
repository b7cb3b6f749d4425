"""The summary of a fit, as statistics programs print one: coefficients with their standard errors,
and how much the training data say for so many parameters.
"""

from __future__ import annotations

import math

from mapmore_cli.domain.models import Model
from mapmore_cli.domain.results import FitResult
from mapmore_cli.domain.scores import OWN, ScoreTable
from mapmore_cli.modelling.kinds import parameters
from mapmore_cli.modelling.literature.linear import half_width
from mapmore_cli.modelling.validation.metrics import information_criteria
from mapmore_cli.reporting.table import Table
from mapmore_cli.reporting.tables import coefficient_rows

COLUMNS = ("part", "term", "coefficient #.6g", "standard error .3g", "t .3g", "ERR [%] .4f")


def summary_table(fit: FitResult, model: Model, scores: ScoreTable) -> Table:
    """Return a row for each coefficient of the formula, and of every segment or of the model with
    memory.

    Coefficients of terms are of scaled coordinates, those of formulas in their own units. The notes
    have n, the number of parameters, AIC and BIC; and the coefficients whose 95 % interval includes
    zero.
    """
    found: list[tuple[str, str, float, float, float, float]] = []
    if formula := fit.formula:
        freedom = formula.samples - len(formula.parameters)
        for name, value in formula.parameters.items():
            error = formula.errors[name]
            found.append((formula.name, name, value, error, math.nan, half_width(error, freedom)))
    for piece, row in coefficient_rows(fit, model):
        numbers = row["coefficient"], row["standard_error"], row["err"], row["width"]
        found.append((piece.id, row["term"], *numbers))
    rows = [
        (part, term, value, error, value / error if error else math.nan, 100 * err)
        for part, term, value, error, err, _ in found
    ]
    unclear = [f"{term} of {part}" for part, term, value, *_, width in found if width > abs(value)]
    notes = list(fit.formula.notes) if fit.formula is not None else []
    if unclear:
        notes.append(f"Not told from zero by the training data (95 %): {', '.join(unclear)}.")
    count, unit = parameters(model), model.output.unit
    for score in scores.scores:
        if (score.model, score.split, score.curve) == (OWN, "train", "all"):
            aic, bic = information_criteria(score.n, score.rmse, count)
            size = (
                f"n = {score.n} training samples, {count} parameters, RMSE {score.rmse:.4g} {unit}"
            )
            notes.insert(0, f"{size}: AIC {aic:.6g}, BIC {bic:.6g}.")
    return Table.of("summary", f"Summary of {model.name}", COLUMNS, rows, *notes)
