"""The summary of a model, as statistics programs print one: coefficients with their standard
errors, and how much the training data say for so many parameters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.fits import PIECE, FormulaFit, MemoryModel
from mapmore_cli.domain.models import Model, SegmentFunction
from mapmore_cli.modelling.kinds import parameters
from mapmore_cli.modelling.literature.linear import half_width
from mapmore_cli.modelling.validation.metrics import information_criteria
from mapmore_cli.reporting.table import Cell, Table

COLUMNS = ("part", "term", "coefficient #.6g", "standard error .3g", "t .3g", "ERR [%] .4f")


def summary_table(model: Model, scores: Sequence[Mapping[str, Any]]) -> Table:
    """Return a row for each coefficient: of backbones and formulas, segment functions, and parts
    with memory.

    Coefficients of terms are of scaled coordinates, those of formulas in their own units. The notes
    have n, the number of parameters, AIC and BIC where `scores` (rows of scores.json) tell the
    training error; and the coefficients whose 95 % interval includes zero.
    """
    rows: list[tuple[Cell, ...]] = []
    unclear: list[str] = []
    trained = [row for row in scores if _is_training(row)]
    samples = int(trained[0]["n"]) if trained else 0
    for part, term, value, error, err, freedom in _coefficients(model, samples):
        rows.append((part, term, value, error, value / error if error else math.nan, 100 * err))
        if not half_width(error, freedom) < abs(value):
            unclear.append(f"{term} of {part}")
    notes = [_fit_note(model, row) for row in trained]
    if unclear:
        notes.append(f"Not told from zero by the training data (95 %): {', '.join(unclear)}.")
    notes += [note for one in model.every for note in getattr(one.backbone, "notes", ())]
    return Table.of("summary", f"Summary of {model.name}", COLUMNS, rows, *notes)


Coefficient = tuple[str, str, float, float, float, int]
"""Part, term, coefficient, its standard error, its ERR, and the degrees of freedom."""


def _coefficients(model: Model, samples: int) -> Iterator[Coefficient]:
    for one in model.every:
        if one.backbone is not None:
            yield from _of_formula(one.backbone)
        for segment in one.pieces.segments if one.pieces is not None else ():
            yield from _of_terms(segment.id, segment, segment.err, segment.samples)
        for memory in one.body.memories:
            unknown = np.full(len(memory.terms), np.nan)
            yield from _of_terms(PIECE, memory, unknown, samples)


def _of_terms(
    part: str, fitted: SegmentFunction | MemoryModel, err: Array, samples: int
) -> Iterator[Coefficient]:
    freedom = samples - len(fitted.terms)
    columns = (fitted.theta.tolist(), fitted.theta_error.tolist(), err.tolist())
    for term, *numbers in zip(fitted.terms, *columns, strict=True):
        yield part, term, *numbers, freedom


def _of_formula(fit: FormulaFit) -> Iterator[Coefficient]:
    freedom = fit.samples - len(fit.parameters)
    for name, value in fit.parameters.items():
        yield fit.name, name, value, fit.errors.get(name, math.nan), math.nan, freedom


def _is_training(row: Mapping[str, Any]) -> bool:
    return (row["model"], row["split"], row["curve"]) == ("mapmore", "train", "all")


def _fit_note(model: Model, row: Mapping[str, Any]) -> str:
    """Return a sentence on the training error."""
    n, rmse, count = int(row["n"]), float(row["rmse"]), parameters(model)
    aic, bic = information_criteria(n, rmse, count)
    return (
        f"n = {n} training samples, {count} parameters, RMSE {rmse:.4g} {model.output.unit}: "
        f"AIC {aic:.6g}, BIC {bic:.6g}."
    )
