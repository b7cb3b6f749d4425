"""Show sums in `mapmore show`."""

from __future__ import annotations

from collections.abc import Callable

from mapmore_cli.annexes.sums import Part, Sum
from mapmore_cli.cli.console import View
from mapmore_cli.domain.models import Model


def show(model: Model, show_other: Callable[[Model], View]) -> View:
    """Return what `mapmore show` prints about a sum: its parts, with their tables and lines."""
    body = model.body_of(Sum)
    shown = [(part.name, show_other(part)) for part in body.models]
    tables = tuple(table for _, view in shown for table in view.tables)
    lines = tuple(f"{name}: {line}" for name, view in shown for line in view.lines)
    parts = [_part(part, show_other) for part in body.parts]
    return View({"parts": parts}, tables, lines)


def _part(part: Part, show_other: Callable[[Model], View]) -> dict[str, object]:
    fed = {"fed": [_part(inner, show_other) for inner in part.fed]} if part.fed else {}
    head = {"sign": part.sign, "renamed": part.inputs}
    return {**head, **fed, **show_other(part.model).document}
