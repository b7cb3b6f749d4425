"""A page to check the guesses of `init` by eye: every column with its course, what it was taken for, and what is still open."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.results import Search
from mapmore_cli.reporting.table import environment
from mapmore_cli.study.drafting.draft import Draft

POINTS = 300  # of a thumbnail
WIDTH, HEIGHT = 200, 60


def guesses_page(draft: Draft) -> str:
    """Return the page of a draft as HTML; every text of the user's is escaped."""
    used = {entry["column"]: name for name, entry in draft.data["columns"].items()}
    target = draft.spec["target"]
    follows = target["column"] if isinstance(target, dict) else "force"
    drawn = {name: column for column, name in used.items() if column in draft.raw}
    pairs = [
        {"thumbnail": thumbnail(draft.raw[drawn[name]], draft.raw[drawn[follows]]), "text": f"{name} across, {follows} up"}
        for name in drawn
        if name not in ("time", follows) and follows in drawn and _alike(draft.raw[drawn[name]], draft.raw[drawn[follows]])
    ]
    return (
        environment()
        .get_template("guesses.html")
        .render(
            name=draft.name,
            files=draft.files,
            drawn=len(next(iter(draft.raw.values()), ())),
            questions=[f"{'.'.join(map(str, loc))}: {note.why}" for loc, note in draft.notes.items() if not note.sure],
            columns=[_row(draft, column, used.get(column)) for column in draft.raw],
            pairs=pairs,
            tried=[] if draft.found is None else _tried(draft.found),
            left_out="" if draft.found is None else draft.found.left_out,
            sources=[str(entry) if isinstance(entry, str) else _said(entry) for entry in draft.data["files"]],
        )
    )


def _row(draft: Draft, column: str | int, name: str | None) -> dict[str, Any]:
    values = draft.raw[column]
    low, high = min(float(one.min()) for one in values), max(float(one.max()) for one in values)
    row = {"column": column, "thumbnail": thumbnail(None, values), "range": f"{low:.4g} to {high:.4g}"}
    if name is None:
        return {**row, "guess": "left out", "why": "", "rival": ""}
    unit = draft.data["columns"][name].get("unit", "")
    note = draft.notes.get(("data", "columns", name))
    rivals = draft.rivals.get(name, ())
    told = f"column {rivals[0].column}: {rivals[0].why}" if rivals else ""
    return {**row, "guess": f"{name}{f' in {unit}' if unit else ''}", "why": note.why if note is not None else "", "rival": told}


def _tried(found: Search) -> list[dict[str, Any]]:
    """Return what was tried, the one that is taken first, then by its error; what could not be fitted last."""
    order = sorted(found.tried, key=lambda one: (one is not found.found, bool(one.failure), one.excess))
    return [
        {
            "words": one.words,
            "parameters": "" if one.failure else str(one.parameters),
            "error": one.failure or f"{100 * one.error:.2g} %",
            "parts": "" if math.isnan(one.parts) else f"{100 * one.parts:.2g} %",
        }
        for one in order
    ]


def _said(entry: dict[str, Any]) -> str:
    return f"{entry['path']}: {', '.join(f'{name} {value}' for name, value in entry.get('set', {}).items())}"


def _alike(one: Sequence[Array], other: Sequence[Array]) -> bool:
    return [len(values) for values in one] == [len(values) for values in other]


def thumbnail(across: Sequence[Array] | None, up: Sequence[Array]) -> Any:
    """Return columns of all recordings as a small SVG, the second over the first, or over its samples for None."""
    from markupsafe import Markup

    y = np.concatenate(up)
    x = np.arange(len(y), dtype=float) if across is None else np.concatenate(across)
    rows = np.linspace(0, len(y) - 1, min(POINTS, len(y))).astype(int)
    places = zip(_scaled(x, WIDTH)[rows].tolist(), (HEIGHT - _scaled(y, HEIGHT)[rows]).tolist(), strict=True)
    path = "M" + " L".join(f"{a:.1f} {b:.1f}" for a, b in places)
    box = f'viewBox="-2 -2 {WIDTH + 4} {HEIGHT + 4}" preserveAspectRatio="none" aria-hidden="true"'
    return Markup(f'<svg class="thumbnail" {box}><path d="{path}"/></svg>')


def _scaled(values: Array, size: float) -> Array:
    scaled: Array = (values - values.min()) / (float(np.ptp(values)) or 1.0) * size
    return scaled
