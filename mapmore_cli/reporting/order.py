"""Where the page of a run lies, and the order of its figures."""

from __future__ import annotations

from mapmore_cli.domain.plugins import entry_points

RUN_PAGE = "report/index.html"
"""The page of a run, in its folder."""

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
"""The figures in their order, with the section of the page that each stands in; those of plug-ins
come last. A figure `NAME` is drawn by `reporting/figures/NAME.py`, or an entry point.
"""
FILES_ALONE = frozenset({"surface_3d"})
"""Figures that only Matplotlib can draw: a page has them where figures are asked for as files."""

FIGURES |= {name: "nrmse" for name in sorted(entry_points("figures")) if name not in FIGURES}
