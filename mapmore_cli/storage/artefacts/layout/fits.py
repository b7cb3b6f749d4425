"""Segment functions as they were found, and fits of formulas."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mapmore_cli.domain.fits import FormulaFit, Optimum, Scaling, SegmentFit, Selection
from mapmore_cli.modelling.literature.literature_model import SEVERITY
from mapmore_cli.storage.artefacts.codecs import numbers, pairs, shown, text
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import ANY_REAL, ANY_REALS, ANY_TABLE, CELL, REALS, TABLE, TEXTS
from mapmore_cli.storage.artefacts.layout.derived import stored
from mapmore_cli.storage.artefacts.schema import Fault, Field

STOP = text(words=("tolerance", "max_terms", "no_gain", "rank", "bic", "aicc", "press", "free_run", "pruned"))

RULE = text(words=("unit_square", "max_abs", "none", "range"))

SCALING = stored(
    Scaling,
    {"rule": RULE, "slope": REALS, "intercept": REALS},
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


SELECTION = stored(
    Selection,
    {
        "g": REALS,
        "theta": REALS,
        "a": TABLE,
        "g_all": ANY_TABLE,
        "err_all": ANY_TABLE,
        "runner_up": numbers("<i8", least=-1),
        "condition": ANY_REAL,
        "stop": STOP,
    },
    derived=(Field("err_sum", REALS, "(k) running sum of err", derived=lambda selection: np.cumsum(selection.err)),),
    rule=_selection_faults,
)

SEGMENT_FIT = stored(
    SegmentFit,
    {"cell": CELL},
    derived=(Field("terms", TEXTS, "(k) names of the chosen terms, in the order of selection", NO_UNIT, derived=lambda fit: fit.terms),),
)

OPTIMUM = stored(Optimum, {"held_out_rmse": ANY_REAL})


def _formula_faults(fit: FormulaFit) -> Iterator[Fault]:
    lost = [name for name, value in fit.parameters.items() if not np.isfinite(value)]
    if lost and not fit.failed:
        yield "parameters", f"has no value of {shown(lost[0])}, although the fit has not failed"


FORMULA_FIT = stored(
    FormulaFit,
    {
        "parameters": pairs(ANY_REALS),
        "errors": pairs(ANY_REALS),
        "status": text(words=SEVERITY),
        "condition": ANY_REAL,
        "sse": ANY_REAL,
        "notes": TEXTS,
    },
    rule=_formula_faults,
)
