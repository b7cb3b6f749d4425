"""Draw the combinations of settings that `tune` tried, and the points at which `plan` would measure
next.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.annexes.planning.results import Plan, Tuning
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.validation.significance import WITHIN
from mapmore_cli.reporting.figures import panels, style
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.panels import key

MARK: dict[str, Any] = panels.DOT | {"markersize": 4}
RING: dict[str, Any] = MARK | {"markersize": 9, "markerfacecolor": "none", "color": style.GREY}


def drawing_of(result: Tuning | Plan) -> Drawing:
    """Return the figure of a result of `tune` or `plan`."""
    return tuning_drawing(result) if isinstance(result, Tuning) else plan_drawing(result)


def tuning_drawing(tuning: Tuning) -> Drawing:
    """Return the figure of a comparison, with a dot for every combination of settings. A bar shows
    the standard error of its difference from the best combination. The simplest combination within
    one standard error of the best has a ring.
    """
    trials = [trial for trial in tuning.trials if trial.errors]
    first = next(iter(tuning.chosen.settings))
    groups = list(dict.fromkeys(str(trial.settings[first]) for trial in trials))
    colours = dict(zip(groups, style.level_colours(len(groups)), strict=True))

    def on(ax: Axes) -> None:
        ax.axhline(100 * tuning.best.error, color=style.LIGHT, linewidth=0.8, zorder=0)
        for trial in trials:
            error, colour = 100 * trial.error, colours[str(trial.settings[first])]
            # `spread` is the standard error of ln(error); the bar goes down to error*exp(-spread)
            bar = error * (1 - np.exp(-np.clip(trial.spread, *WITHIN)))
            look: dict[str, Any] = {"fmt": "o", "markersize": 4, "elinewidth": 0.8}
            ax.errorbar(trial.parameters, error, yerr=bar, color=colour, **look)
        ax.plot(tuning.chosen.parameters, 100 * tuning.chosen.error, **RING)

    handles = [key(f"{first} {group}", color=colour, **MARK) for group, colour in colours.items()]
    handles.append(key("simplest within one standard error", **RING))
    caption = (
        "Error on training data that were left out, over the number of free parameters. Bars: "
        "the standard error of the ratio to the "
        "best (2 to 20 %), whose error is the line. A combination whose bar reaches the line "
        "is as good as the best, as far as these "
        "data can tell."
    )
    panel = Panel("", on, "Free parameters", ("Left-out NRMSE (%)",))
    return Drawing("tuning", caption, (panel,), Layout(2.6), handles)


def plan_drawing(plan: Plan) -> Drawing:
    """Return the figure of a plan: the half widths over one quantity as a line, or over two
    quantities as colours. Of three quantities, the first two are drawn.
    """
    names = list(plan.quantities)[:2]
    labels = [_label(plan.quantities[name]) for name in names]
    half = f"half width of {plan.target.name} ({plan.target.unit})"
    handles = [
        key("measured", color=style.GREY, **MARK),
        key("next", color=style.VERMILLION, **MARK),
    ]
    caption = (
        "Half of the width of the 95 % interval, and the next places to measure, numbered from "
        "the best."
    )
    y_label, height, on = half, 2.3, partial(_draw_widths, plan=plan, name=names[0])
    if plan.candidates[0].kind == "between":
        caption = "The levels that were measured, and the next ones, numbered from the best."
        y_label, height = "", 1.4
    if len(names) == 2:
        y_label, height, on = labels[1], 2.8, partial(_draw_map, plan=plan, names=names, label=half)
    elif y_label:
        handles = [
            key("now", color=style.BLUE),
            key("forecast after all", color=style.ORANGE),
            *handles,
        ]
    panel = Panel("", on, labels[0], (y_label,))
    return Drawing("plan", caption, (panel,), Layout(height), handles)


def _label(quantity: Quantity) -> str:
    return quantity.name if quantity.unit == "1" else f"{quantity.name} ({quantity.unit})"


def _draw_widths(ax: Axes, plan: Plan, name: str) -> None:
    x = plan.picture.places[name]
    ax.plot(x, plan.picture.before, color=style.BLUE)
    ax.plot(x, plan.picture.after, color=style.ORANGE, zorder=1)
    measured = plan.picture.measured[name]
    ax.plot(measured, np.zeros(len(measured)), color=style.GREY, clip_on=False, **MARK)
    for number, candidate in enumerate(plan.candidates[:3], 1):
        height = candidate.half_width if np.isfinite(candidate.half_width) else 0.0
        _draw_number(ax, candidate.at[name], height, number)
    ax.set_ylim(bottom=0)


def _draw_map(ax: Axes, plan: Plan, names: Sequence[str], label: str) -> None:
    x, y = (plan.picture.places[name] for name in names)
    look: dict[str, Any] = {"marker": "s", "linewidths": 0, "cmap": "Blues", "zorder": 0}
    colours = ax.scatter(x, y, 9, plan.picture.before, **look)
    ax.figure.colorbar(colours, ax=ax, label=label, use_gridspec=False)
    dots = MARK | {"markersize": 2, "color": style.LIGHT, "markerfacecolor": style.GREY}
    ax.plot(*(plan.picture.measured[name] for name in names), **dots)
    for number, candidate in enumerate(plan.candidates, 1):
        _draw_number(ax, candidate.at[names[0]], candidate.at[names[1]], number)


def _draw_number(ax: Axes, x: float, y: float, number: int) -> None:
    ax.plot(x, y, color=style.VERMILLION, **MARK)
    panels.write_at(ax, str(number), (x, y), (3, 3), color=style.VERMILLION)
