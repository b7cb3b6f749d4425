"""The page of a run: where it is, and in which order its figures stand."""

from __future__ import annotations

RUN_PAGE = "report/index.html"
"""The page of a run, in its folder."""

FIGURES = {
    "data": "data",
    "fit": "fit",
    "error": "fit",
    "residual_map": "fit",
    "surface": "fit",
    "residuals": "fit",
    "nrmse": "nrmse",
    "bands": "nrmse",
    "segments": "segments",
    "terms": "terms",
    "convergence": "nrmse",
}
"""The figures in their order, with the section of the page that each stands in. A figure `NAME` is drawn by `reporting/figures/NAME.py`."""
