"""What `mapmore show` has of sums."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mapmore_cli.annexes.sums import Part, Sum
from mapmore_cli.domain.models import Model
from mapmore_cli.reporting.table import Table


def show(
    model: Model, show_other: Callable[[Model], Any]
) -> tuple[dict[str, Any], tuple[Table, ...], tuple[str, ...]]:
    """Return what `mapmore show` has of a sum: its parts, with their tables and lines."""
    assert isinstance(model.body, Sum)
    shown = [(one.name, show_other(one)) for one in model.body.models]
    tables = tuple(table for _, view in shown for table in view.tables)
    lines = tuple(f"{name}: {line}" for name, view in shown for line in view.lines)
    return {"parts": [_part(part, show_other) for part in model.body.parts]}, tables, lines


def _part(part: Part, show_other: Callable[[Model], Any]) -> dict[str, Any]:
    fed = {"fed": [_part(one, show_other) for one in part.fed]} if part.fed else {}
    head = {"sign": part.sign, "renamed": part.inputs}
    return {**head, **fed, **show_other(part.model).document}
