"""Define the path of the page of a run, and the order of the figures on it."""

from __future__ import annotations

from mapmore_cli.domain.plugins import entry_points

RUN_PAGE = "report/index.html"
"""Path of the page in the run folder."""

FIGURES = {
    "data": "data",
    "fit": "fit",
    "error": "fit",
    "surface": "fit",
    "surface_3d": "fit",
    "residual_map": "fit",
    "residuals": "fit",
    "nrmse": "nrmse",
    "bands": "nrmse",
    "segments": "segments",
    "terms": "terms",
    "convergence": "nrmse",
}
"""Names of the figures in their order on the page, with the section to which each figure belongs.
Figures of plugins come last. A figure `NAME` is drawn by `reporting/figures/NAME.py`, or by an
entry point.
"""
FILES_ALONE = frozenset({"surface_3d"})
"""Figures that only Matplotlib can draw. A page contains them only if figures are also written as
files.
"""

FIGURES |= {name: "nrmse" for name in sorted(entry_points("figures")) if name not in FIGURES}
