"""View of a search for the structure of a model."""

from __future__ import annotations

from typing import Any

from mapmore_cli.cli.views.view import View
from mapmore_cli.domain.search import Search, Tried
from mapmore_cli.reporting.search_table import search_table


def of_search(search: Search, spec: str) -> View:
    """Every structure that was tried, and where the spec with the one that was taken lies."""
    words = "the best itself" if search.chosen == search.best else "within one standard error of the best"
    lines = (*search.notes, f"found: {search.found.words} ({words})", f"spec: {spec}")
    return View({**document_of(search), "spec": spec}, (search_table(search),), lines)


def document_of(search: Search) -> dict[str, Any]:
    """The search as JSON has it."""
    return {
        "target": search.target,
        "left_out": search.left_out,
        "parts_left_out": search.parts,
        "scale": search.scale,
        "found": search.found.words,
        "sections": dict(search.found.sections),
        "tried": [_document(one) for one in search.tried],
        "cut": search.cut,
        "black_boxes": search.black_boxes,
        "notes": list(search.notes),
    }


def _document(one: Tried) -> dict[str, Any]:
    return {
        "family": one.family,
        "structure": one.words,
        "sections": one.sections,
        "parameters": one.parameters,
        "error": one.error,
        "standard_error": one.spread,
        "above_best": one.excess,
        "parts_error": one.parts,
        "seconds": one.seconds,
        "failure": one.failure or None,
    }
