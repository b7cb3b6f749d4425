"""Segment functions as they were found, and fits of formulas."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mapmore_cli.domain.fits import FormulaFit, Optimum, Scaling, SegmentFit, Selection
from mapmore_cli.modelling.literature.literature_model import SEVERITY
from mapmore_cli.storage.artefacts.codecs import added, numbered, numbers, pairs, shown, text
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import ANY_REAL, ANY_REALS, ANY_TABLE, CELL, COUNT, INDICES, REAL, REALS, TABLE, TEXT, TEXTS
from mapmore_cli.storage.artefacts.layout.derived import completed
from mapmore_cli.storage.artefacts.schema import Fault, Field, Schema, record

STOP = text(words=("tolerance", "max_terms", "no_gain", "rank", "bic", "aicc", "press", "free_run", "pruned"))

RULE = text(words=("unit_square", "max_abs", "none", "range"))

SCALING = Schema(
    Scaling,
    "Elementwise linear scaling `z_j = slope_j x_j + intercept_j`, `y = y_slope y_scaled + y_intercept` (M2 eq 8).",
    (
        Field("rule", RULE, "`unit_square`, `max_abs`, `none` or `range`", NO_UNIT),
        Field("placement", TEXT, "where the origin lies, as `left`", NO_UNIT),
        Field("variables", TEXTS, "(v) inputs, in the order of slope and intercept", NO_UNIT),
        Field("slope", REALS, "(v) slope of each input", "[slopes]"),
        Field("intercept", REALS, "(v) intercept of each input"),
        Field("y_slope", REAL, "slope of the output", "[target]"),
        Field("y_intercept", REAL, "intercept of the output", "[target]"),
    ),
    units=lambda scaling: {"slopes": ", ".join(f"1/[{name}]" for name in scaling.variables) or NO_UNIT},
)


def _selection_faults(selection: Selection) -> Iterator[Fault]:
    candidates = selection.err_all.shape[1]
    for field in ("chosen", "runner_up"):
        indices = getattr(selection, field)
        if indices.size and indices.max() >= candidates:
            yield field, f"names candidate {indices.max()} of {candidates}"
    if len(set(selection.chosen.tolist())) < len(selection.chosen):
        yield "chosen", "names a candidate twice"


SELECTION = Schema(
    Selection,
    "Everything that FROLS found out about one segment (M2 eq 2-7): k terms chosen of M candidates, in scaled coordinates.",
    (
        Field("chosen", INDICES, "(k) candidates in the order of selection, from 0", NO_UNIT),
        Field("g", REALS, "(k) coefficients of the orthogonalised regressors"),
        Field("err", ANY_REALS, "(k) error reduction ratios"),
        Field("err_sum", REALS, "(k) running sum of err", derived=lambda selection: np.cumsum(selection.err)),
        Field("theta", REALS, "(k) coefficients of the original regressors, A theta = g"),
        Field("theta_error", ANY_REALS, "(k) standard errors of theta; NaN without a degree of freedom"),
        Field("a", TABLE, "(k, k) unit upper triangular A, P_chosen = Q A"),
        Field("g_all", ANY_TABLE, "(k, M) g of every candidate at every iteration; NaN where already chosen or excluded"),
        Field("err_all", ANY_TABLE, "(k, M) err of every candidate at every iteration; NaN where already chosen or excluded"),
        Field(
            "runner_up", numbers("<i8", least=-1), "(k) second best candidate of each iteration, from 0; -1 where there was none", NO_UNIT
        ),
        Field("tied", INDICES, "(k) other candidates within 1e-9 of the winner's err"),
        Field("condition", ANY_REAL, "2-norm condition number of the chosen regressors"),
        Field("sse", REAL, "residual sum of squares, uncentred"),
        Field("yy", REAL, "total sum of squares, uncentred"),
        Field("samples", COUNT, "samples fitted to"),
        Field("stop", STOP, "why selection stopped", NO_UNIT),
    ),
    rule=_selection_faults,
)

SEGMENT_FIT = Schema(
    SegmentFit,
    "A segment function: the chosen terms with their scaling, and how they were found.",
    (
        Field("id", TEXT, "identifier of the segment", NO_UNIT),
        Field("curve", TEXT, "identifier of its curve", NO_UNIT),
        Field("cell", CELL, "place along each segmented variable, from 1", NO_UNIT),
        Field("candidates", TEXTS, "(M) names of all M dictionary terms", NO_UNIT),
        Field("terms", TEXTS, "(k) names of the chosen terms, in the order of selection", NO_UNIT, derived=lambda fit: fit.terms),
        Field("scaling", record(SCALING), "scaling of the segment", NO_UNIT),
        Field("selection", record(SELECTION), "how the terms were found", NO_UNIT),
    ),
)

OPTIMUM = Schema(
    Optimum,
    "Another minimum of a formula's error that explains the training data nearly as well.",
    (
        Field("parameters", pairs(REALS), "its parameters", "those of the formula"),
        Field("sse", REAL, "its residual sum of squares", "[target]^2"),
        Field("held_out_rmse", ANY_REAL, "its error on the validation data; NaN where nobody has asked", "[target]"),
    ),
)


def _formula_faults(fit: FormulaFit) -> Iterator[Fault]:
    lost = [name for name, value in fit.parameters.items() if not np.isfinite(value)]
    if lost and not fit.failed:
        yield "parameters", f"has no value of {shown(lost[0])}, although the fit has not failed"


FORMULA_FIT = completed(
    Schema(
        FormulaFit,
        "A literature model fitted to training data.",
        (
            Field("name", TEXT, "name of the formula", NO_UNIT),
            Field("parameters", pairs(ANY_REALS), "fitted parameters; NaN where the fit failed", "those of the formula"),
            Field("errors", pairs(ANY_REALS), "standard errors of the parameters; NaN where unknown", "those of the formula"),
            Field("status", text(words=SEVERITY), "`converged`, `at_bound`, `rank_deficient`, `stopped_by_limit` or `failed`", NO_UNIT),
            Field("method", TEXT, "how it was fitted", NO_UNIT),
            Field("rank", COUNT, "rank of the linear problem"),
            Field("condition", ANY_REAL, "condition number of the linear problem"),
            Field("sse", ANY_REAL, "residual sum of squares", "[target]^2"),
            Field("samples", COUNT, "samples fitted to"),
            Field("notes", TEXTS, "remarks for the reader", NO_UNIT),
            Field("rivals", added(numbered(record(OPTIMUM)), ()), "other minima with nearly its training error", NO_UNIT),
        ),
        rule=_formula_faults,
    )
)
