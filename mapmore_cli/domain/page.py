"""The order of the page of a run."""

from __future__ import annotations

FIGURES = {"data": "data", "fit": "fit", "error": "fit", "nrmse": "nrmse", "segments": "segments", "terms": "terms"}
"""The figures in their order, with the section of the page that each stands in. A figure `NAME` is drawn by `reporting/figures/NAME.py`."""
