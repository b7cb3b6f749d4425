"""Left-out error against the size of a model, for settings that were tried out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mapmore_cli.domain.scores import Trial, Tuning
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import GREY, LIGHT, level_colours


def tuning_drawing(tuning: Tuning) -> Drawing:
    """Return a dot for every combination, with the standard error of what it errs above the best; the simplest within that is ringed."""
    trials = [trial for trial in tuning.trials if trial.errors]
    first = next(iter(tuning.chosen.settings))
    groups = list(dict.fromkeys(str(trial.settings[first]) for trial in trials))
    colours = dict(zip(groups, level_colours(len(groups)), strict=True))

    def on(axes: Sequence[Axes]) -> None:
        ax = axes[0]
        ax.axhline(100 * tuning.best.error, color=LIGHT, linewidth=0.8, zorder=0)
        for trial in trials:
            look: dict[str, Any] = {"color": colours[str(trial.settings[first])], "markersize": 4, "elinewidth": 0.8}
            ax.errorbar(trial.parameters, 100 * trial.error, yerr=100 * trial.spread, fmt="o", **look)
        chosen = tuning.chosen
        ax.plot(chosen.parameters, 100 * chosen.error, linestyle="none", marker="o", markersize=10, markerfacecolor="none", color=GREY)

    handles = [Line2D([], [], linestyle="none", marker="o", markersize=4, color=c, label=f"{first} {g}") for g, c in colours.items()]
    handles.append(
        Line2D(
            [],
            [],
            linestyle="none",
            marker="o",
            markersize=8,
            markerfacecolor="none",
            color=GREY,
            label="simplest within one standard error",
        )
    )
    caption = (
        "Error on training data that were left out, over the number of free parameters. Bars: the standard error of the difference to the "
        "best, whose error is the line. A combination whose bar reaches the line is as good as the best, as far as these data can tell."
    )
    panel = Panel("", on, "Free parameters", ("Left-out NRMSE (%)",), _data(trials))
    return Drawing("tuning", caption, caption, (panel,), Grid(height=2.6), tuple(handles))


def _data(trials: Sequence[Trial]) -> dict[str, Values]:
    settings: dict[str, Values] = {key: [str(trial.settings[key]) for trial in trials] for key in trials[0].settings}
    numbers: dict[str, Values] = {
        "parameters": [trial.parameters for trial in trials],
        "left-out NRMSE [%]": [100 * trial.error for trial in trials],
        "above the best [%]": [100 * trial.excess for trial in trials],
        "standard error [%]": [100 * trial.spread for trial in trials],
    }
    return {**settings, **numbers}
