"""What the report says in numbers about the model: segments, selected terms, coefficients, formulas."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import stdtrit

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.fits import FormulaFit, Optimum, SegmentFit
from mapmore_cli.domain.models import Equation, FoldError
from mapmore_cli.domain.results import FitResult
from mapmore_cli.modelling.literature.identifiability import half_width
from mapmore_cli.modelling.literature.own import units_of_parameters
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import Cell, Column, Table

CONFIDENCE = 0.95
SAME = 1e-9
"""Relative difference between the sums of squares of two fits that are taken for one model."""
INDEPENDENCE_CAVEAT = (
    "The intervals take the samples to be independent. Neighbouring samples of a smooth curve are not, so the true intervals are wider."
)


def segments_table(inputs: ReportInputs) -> Table:
    """Where every segment lies, how it was scaled, and how well its own function fits it (training RMSE, before fusion)."""
    places = {
        s.id: tuple(b[c - 1 : c + 1] for b, c in zip(curve.boundaries, s.cell, strict=True))
        for curve in inputs.segmentation
        for s in curve.segments
    }
    variables = inputs.segmentation[0].variables if inputs.segmentation else ()
    bounds = [Column(f"{v} {end}", inputs.dataset.unit(v)) for v in variables for end in ("from", "to")]
    columns = (
        Column("segment"),
        Column("samples"),
        *bounds,
        Column("RMSE", inputs.target.unit),
        Column("scaling"),
        Column("origin"),
        Column("condition", "", ".3g"),
    )
    rows: list[tuple[Cell, ...]] = []
    for fit in inputs.fit.segments:
        chosen = fit.selection
        ends = [float(end) for pair in places[fit.id] for end in pair]
        rmse = math.sqrt(max(chosen.sse, 0.0) / chosen.samples) * abs(fit.scaling.y_slope)
        rows.append((fit.id, chosen.samples, *ends, rmse, fit.scaling.rule, fit.scaling.placement, chosen.condition))
    return Table("segments", "Segments", columns, tuple(rows))


def terms_table(fit: FitResult) -> Table:
    """Terms in the order of selection: error reduction ratio, running sum, runner-up and the margin over it."""
    columns = (
        Column("segment"),
        Column("step"),
        Column("term"),
        Column("ERR", "%", ".4f"),
        Column("sum of ERR", "%", ".4f"),
        Column("runner-up"),
        Column("its ERR", "%", ".4f"),
        Column("margin", "%", ".4f"),
        Column("tied"),
        Column("stop"),
    )
    rows = tuple(row for piece in fit.pieces for row in _term_rows(piece))
    share = "share of the segment's uncentred sum of squares, in scaled coordinates, that a term explains when it is chosen"
    notes: tuple[str, ...] = (f"ERR: {share}.",)
    if any(np.any(piece.selection.tied > 0) for piece in fit.pieces):
        notes += ("Tied: other candidates whose ERR was the same within 1e-9; the first of the dictionary was taken.",)
    return Table("terms", "Selected terms", columns, rows, notes)


def _term_rows(segment: SegmentFit) -> list[tuple[Cell, ...]]:
    chosen = segment.selection
    running = np.cumsum(chosen.err)
    rows: list[tuple[Cell, ...]] = []
    for step, term in enumerate(segment.terms):
        second = int(chosen.runner_up[step])
        rival, rival_err = (segment.candidates[second], float(chosen.err_all[step, second])) if second >= 0 else (None, math.nan)
        last = step == len(segment.terms) - 1
        share = (100 * float(value) for value in (chosen.err[step], running[step]))
        margin = 100 * (float(chosen.err[step]) - rival_err)
        tied = int(chosen.tied[step]) or None
        rows.append((segment.id, step + 1, term, *share, rival, 100 * rival_err, margin, tied, chosen.stop if last else None))
    return rows


def interval_half_width(theta_error: Array, freedom: int) -> Array:
    """Half width `t(0.975; n-k) s(theta)` of the 95 % confidence intervals `(k,)`; NaN where no degree of freedom is left."""
    quantile = float(stdtrit(freedom, 0.5 + CONFIDENCE / 2)) if freedom > 0 else math.nan
    return quantile * np.asarray(theta_error, dtype=float)


def coefficients_table(inputs: ReportInputs) -> Table:
    """Coefficients of every segment with 95 % confidence intervals, in scaled coordinates and in the target's unit."""
    unit = inputs.target.unit
    columns = (
        Column("segment"),
        Column("term"),
        Column("theta"),
        Column("± 95 %", "", ".3g"),
        Column("lower"),
        Column("upper"),
        Column("theta × y_slope", unit),
        Column("± 95 %", unit, ".3g"),
    )
    rows: list[tuple[Cell, ...]] = []
    for segment in inputs.fit.pieces:
        chosen, slope = segment.selection, segment.scaling.y_slope
        half = interval_half_width(chosen.theta_error, chosen.samples - len(chosen.theta))
        for term, theta, width in zip(segment.terms, chosen.theta.tolist(), half.tolist(), strict=True):
            rows.append((segment.id, term, theta, width, theta - width, theta + width, theta * slope, width * abs(slope)))
    return Table("coefficients", "Coefficients with 95 % confidence intervals", columns, tuple(rows), (INDEPENDENCE_CAVEAT,))


def equations_table(equations: Sequence[Equation], others: Mapping[str, Sequence[Equation]]) -> Table:
    """Return the model in physical units, and in `others`, as text and as LaTeX source: a column for each."""
    texts = ("equation", *(f"with {units}" for units in others))
    sources = ("latex", *(f"latex with {units}" for units in others))
    columns = (Column("id"), *(Column(name, form="text") for name in texts), *(Column(name, form="source") for name in sources))
    forms = [[(one.text, one.latex) for one in same] for same in (equations, *others.values())]
    rows = tuple(
        (equation.id, *(text for text, _ in same), *(source for _, source in same))
        for equation, *same in zip(equations, *forms, strict=True)
    )
    return Table("equations", "Equations in physical units", columns, rows)


def formulas_table(inputs: ReportInputs) -> Table:
    """Parameters ± standard error of every fitted formula; a failed fit has one row, and no number."""
    own = inputs.fit.formula
    fitted = [(own.name, "backbone" if inputs.has_pieces else "own model", own)] if own is not None else []
    fitted += [(name, "competitor", formula) for name, formula in inputs.validation.formulas.items()]
    columns = (
        Column("formula", form="model"),
        Column("role"),
        Column("status"),
        Column("parameter"),
        Column("value", "", "#.6g"),
        Column("unit"),
        Column("standard error", "", ".3g"),
        Column("95 %, from", "", ".4g"),
        Column("to", "", ".4g"),
        Column("method"),
        Column("rank"),
        Column("condition", "", ".3g"),
        Column("samples"),
    )
    rows = tuple(row for name, role, formula in fitted for row in _formula_rows(name, role, formula))
    notes = tuple(f"{name} ({role}): {note}" for name, role, formula in fitted for note in formula.notes)
    caveat = (INDEPENDENCE_CAVEAT,) if rows else ()
    notes = (*caveat, *same_models([(name, formula) for name, _, formula in fitted]), *notes)
    notes += tuple(told for name, _, formula in fitted for told in rival_minima(name, formula, inputs.target.unit))
    return Table("formulas", "Parameters of the fitted formulas", columns, rows, notes)


def _formula_rows(name: str, role: str, formula: FormulaFit) -> list[tuple[Cell, ...]]:
    head: tuple[Cell, ...] = (name, role, formula.status.replace("_", " "))
    if formula.failed:
        return [(*head, None, None, None, None, None, None, formula.method, None, None, formula.samples)]
    tail: tuple[Cell, ...] = (formula.method, formula.rank, formula.condition, formula.samples)
    units, errors = units_of_parameters(formula), formula.errors
    return [
        (*head, key, value, units.get(key), errors.get(key), *_interval(formula, key), *tail) for key, value in formula.parameters.items()
    ]


def _interval(formula: FormulaFit, parameter: str) -> tuple[float, float]:
    """Return ends of the confidence interval of a parameter; NaN where its error is unknown."""
    reach = half_width(formula.errors.get(parameter, math.nan), formula.samples - formula.rank, CONFIDENCE)
    return formula.parameters[parameter] - reach, formula.parameters[parameter] + reach


def same_models(fitted: Sequence[tuple[str, FormulaFit]]) -> tuple[str, ...]:
    """Return a sentence for every pair of different formulas that are one model here: what one of them can say, the other can.

    That is so where the same samples are fitted with the same sum of squares (tondu_lopez with its area fitted is chou_hannaford in other
    parameters wherever that describes a braid).
    """
    known = [(name, fit) for name, fit in fitted if not fit.failed and fit.sse > 0.0]
    return tuple(
        f"{first} and {second} are one model here, in other parameters: their sums of squares agree within {SAME:g}. Count them once."
        for i, (first, one) in enumerate(known)
        for second, other in known[i + 1 :]
        if one.name != other.name and one.samples == other.samples and abs(one.sse - other.sse) <= SAME * one.sse
    )


def rival_minima(name: str, formula: FormulaFit, unit: str = "") -> tuple[str, ...]:
    """Other minima of a formula's error that training data hardly tell from the one taken, each as a sentence.

    `unit` is that of held-out errors, which only a validation knows.
    """
    return tuple(_minimum(name, formula, rival, unit) for rival in formula.rivals)


def _minimum(name: str, formula: FormulaFit, rival: Optimum, unit: str) -> str:
    ratio = math.sqrt(rival.sse / formula.sse)
    held_out = "" if math.isnan(rival.held_out_rmse) else f" and an error of {rival.held_out_rmse:.4g} {unit} on the validation data"
    parameters = ", ".join(f"{key} = {value:.4g}" for key, value in rival.parameters.items())
    return f"{name}: another minimum, {parameters}, has {ratio:.3g} times its training error{held_out}"


def folds_table(choices: Sequence[FoldError], unit: str) -> Table:
    """Cross-validation errors behind the decision between the formula alone and the formula with segments."""
    best = min((choice.rmse for choice in choices), default=math.nan)
    columns = (Column("choice"), Column("RMSE of left-out samples", unit), Column("folds"), Column("least error"))
    rows = tuple((c.choice, c.rmse, c.folds, "yes" if c.rmse == best else "no") for c in choices)
    return Table("cross_validation", "Is the residual worth its segments? Errors on left-out training data", columns, rows)
