"""Segment functions as they were found, and fits of formulas."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.fits import FormulaFit, Scaling, SegmentFit, Selection
from mapmore_cli.storage.artefacts.codecs import pairs
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import CELL, COUNT, INTEGERS, REAL, REALS, TABLE, TEXT, TEXTS
from mapmore_cli.storage.artefacts.schema import Field, Schema, record

SCALING = Schema(
    Scaling,
    "Elementwise linear scaling `z_j = slope_j x_j + intercept_j`, `y = y_slope y_scaled + y_intercept` (M2 eq 8).",
    (
        Field("rule", TEXT, "`unit_square`, `max_abs` or `none`", NO_UNIT),
        Field("placement", TEXT, "where the origin lies, as `left`", NO_UNIT),
        Field("variables", TEXTS, "inputs, in the order of slope and intercept", NO_UNIT),
        Field("slope", REALS, "slope of each input", "[slopes]"),
        Field("intercept", REALS, "intercept of each input"),
        Field("y_slope", REAL, "slope of the output", "[target]"),
        Field("y_intercept", REAL, "intercept of the output", "[target]"),
    ),
    units=lambda scaling: {"slopes": ", ".join(f"1/[{name}]" for name in scaling.variables) or NO_UNIT},
)

SELECTION = Schema(
    Selection,
    "Everything that FROLS found out about one segment (M2 eq 2-7): k terms chosen of M candidates, in scaled coordinates.",
    (
        Field("chosen", INTEGERS, "(k) candidates in the order of selection, from 0", NO_UNIT),
        Field("g", REALS, "(k) coefficients of the orthogonalised regressors"),
        Field("err", REALS, "(k) error reduction ratios"),
        Field("err_sum", REALS, "(k) running sum of err", derived=lambda selection: np.cumsum(selection.err)),
        Field("theta", REALS, "(k) coefficients of the original regressors, A theta = g"),
        Field("theta_error", REALS, "(k) standard errors of theta; NaN without a degree of freedom"),
        Field("a", TABLE, "(k, k) unit upper triangular A, P_chosen = Q A"),
        Field("g_all", TABLE, "(k, M) g of every candidate at every iteration; NaN where already chosen or excluded"),
        Field("err_all", TABLE, "(k, M) err of every candidate at every iteration; NaN where already chosen or excluded"),
        Field("runner_up", INTEGERS, "(k) second best candidate of each iteration, from 0; -1 where there was none", NO_UNIT),
        Field("tied", INTEGERS, "(k) other candidates within 1e-9 of the winner's err"),
        Field("condition", REAL, "2-norm condition number of the chosen regressors"),
        Field("sse", REAL, "residual sum of squares, uncentred"),
        Field("yy", REAL, "total sum of squares, uncentred"),
        Field("samples", COUNT, "samples fitted to"),
        Field("stop", TEXT, "why selection stopped", NO_UNIT),
    ),
)

SEGMENT_FIT = Schema(
    SegmentFit,
    "A segment function: the chosen terms with their scaling, and how they were found.",
    (
        Field("id", TEXT, "identifier of the segment", NO_UNIT),
        Field("curve", TEXT, "identifier of its curve", NO_UNIT),
        Field("cell", CELL, "place along each segmented variable, from 1", NO_UNIT),
        Field("candidates", TEXTS, "names of all M dictionary terms", NO_UNIT),
        Field("terms", TEXTS, "(k) names of the chosen terms, in the order of selection", NO_UNIT, derived=lambda fit: fit.terms),
        Field("scaling", record(SCALING), "scaling of the segment", NO_UNIT),
        Field("selection", record(SELECTION), "how the terms were found", NO_UNIT),
    ),
)

FORMULA_FIT = Schema(
    FormulaFit,
    "A literature model fitted to training data.",
    (
        Field("name", TEXT, "name of the formula", NO_UNIT),
        Field("parameters", pairs(REALS), "fitted parameters; NaN where the fit failed", "those of the formula"),
        Field("errors", pairs(REALS), "standard errors of the parameters; NaN where unknown", "those of the formula"),
        Field("status", TEXT, "`converged`, `at_bound`, `rank_deficient`, `stopped_by_limit` or `failed`", NO_UNIT),
        Field("method", TEXT, "how it was fitted", NO_UNIT),
        Field("rank", COUNT, "rank of the linear problem"),
        Field("condition", REAL, "condition number of the linear problem"),
        Field("sse", REAL, "residual sum of squares", "[target]^2"),
        Field("samples", COUNT, "samples fitted to"),
        Field("notes", TEXTS, "remarks for the reader", NO_UNIT),
    ),
)
