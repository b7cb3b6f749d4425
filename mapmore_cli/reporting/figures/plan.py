"""Where a model is unsure, and where the next measurements go."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.results import Plan
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import BLUE, GREY, LIGHT, ORANGE, VERMILLION

SHOWN = 3
"""Of the levels: so many of the best are marked; of points, all are."""

MARK: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 4}


def plan_drawing(plan: Plan) -> Drawing:
    """Return the half widths over one quantity as lines, over two as colours; with three the first two are drawn."""
    names = list(plan.quantities)[:2]
    labels = [_label(plan.quantities[name]) for name in names]
    half = f"half width of {plan.target.name} ({plan.target.unit})"
    caption = "Half of the width of the 95 % interval, and where to measure next, numbered from the best on."
    data: dict[str, Values] = {_label(plan.quantities[name]): plan.picture.places[name] for name in names}
    data |= {f"{half} before": plan.picture.before, f"{half} after": plan.picture.after}
    if len(names) == 1:
        panel = Panel("", lambda axes: _lines(axes[0], plan, names[0]), labels[0], (half,), data)
        handles = [Line2D([], [], color=BLUE, label="now"), Line2D([], [], color=ORANGE, label="forecast after the first")]
        return Drawing("plan", caption, caption, (panel,), Grid(height=2.3), (*handles, *_marks()))
    panel = Panel("", lambda axes: _map(axes, plan, names, half), labels[0], (labels[1],), data)
    return Drawing("plan", caption, caption, (panel,), Grid(height=2.8), _marks())


def _label(quantity: Quantity) -> str:
    return quantity.name if quantity.unit == "1" else f"{quantity.name} ({quantity.unit})"


def _marks() -> tuple[Line2D, ...]:
    return Line2D([], [], color=GREY, label="measured", **MARK), Line2D([], [], color=VERMILLION, label="next", **MARK)


def _lines(ax: Axes, plan: Plan, name: str) -> None:
    x = plan.picture.places[name]
    ax.plot(x, plan.picture.before, color=BLUE)
    ax.plot(x, plan.picture.after, color=ORANGE, zorder=1)
    measured = plan.picture.measured[name]
    ax.plot(measured, np.zeros(len(measured)), color=GREY, clip_on=False, **MARK)
    for number, one in enumerate(plan.candidates[:SHOWN], 1):
        height = one.half_width if np.isfinite(one.half_width) else 0.0
        _numbered(ax, one.at[name], height, number)
    ax.set_ylim(bottom=0)


def _map(axes: Sequence[Axes], plan: Plan, names: Sequence[str], label: str) -> None:
    ax = axes[0]
    x, y = (plan.picture.places[name] for name in names)
    shown = ax.scatter(x, y, c=plan.picture.before, s=9, marker="s", linewidths=0, cmap="Blues", zorder=0)
    ax.figure.colorbar(shown, ax=ax, label=label, use_gridspec=False)
    ax.plot(*(plan.picture.measured[name] for name in names), color=LIGHT, **{**MARK, "markersize": 2, "markerfacecolor": GREY})
    for number, one in enumerate(plan.candidates, 1):
        _numbered(ax, one.at[names[0]], one.at[names[1]], number)


def _numbered(ax: Axes, x: float, y: float, number: int) -> None:
    ax.plot(x, y, color=VERMILLION, **MARK)
    ax.annotate(str(number), (x, y), xytext=(3, 3), textcoords="offset points", color=VERMILLION)
