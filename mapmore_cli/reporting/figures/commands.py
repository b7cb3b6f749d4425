"""Figures of commands, beside those of the page: of `tune`, `plan`, `compare` and campaigns, and a
model by itself for notebooks.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.domain.arrays import Columns
from mapmore_cli.domain.models import Formula, Model, Pieces
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.domain.results import Plan
from mapmore_cli.domain.scores import REPEATABILITY, Tuning
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.validation.comparison import ReferencePoint
from mapmore_cli.modelling.validation.intervals import half_widths_of
from mapmore_cli.modelling.validation.shown import varying_input
from mapmore_cli.modelling.validation.significance import WITHIN
from mapmore_cli.reporting.campaign import CampaignScores
from mapmore_cli.reporting.figures import panels, style
from mapmore_cli.reporting.figures.drawing import DOUBLE, Drawing, Layout, Panel
from mapmore_cli.reporting.figures.panels import key

MARK: dict[str, Any] = panels.DOT | {"markersize": 4}
RING: dict[str, Any] = MARK | {"markersize": 9, "markerfacecolor": "none", "color": style.GREY}
HELD_OUT: dict[str, Any] = panels.DOT | {"markersize": 2, "color": style.GREY, "zorder": 0}

POINTS = 201


def drawing_of(result: Tuning | Plan) -> Drawing:
    """Return the figure of what `tune` or `plan` found."""
    return tuning_drawing(result) if isinstance(result, Tuning) else plan_drawing(result)


def tuning_drawing(tuning: Tuning) -> Drawing:
    """Return a dot for every combination, with the standard error of what it errs above the best;
    the simplest within that is ringed.
    """
    trials = [trial for trial in tuning.trials if trial.errors]
    first = next(iter(tuning.chosen.settings))
    groups = list(dict.fromkeys(str(trial.settings[first]) for trial in trials))
    colours = dict(zip(groups, style.level_colours(len(groups)), strict=True))

    def on(ax: Axes) -> None:
        ax.axhline(100 * tuning.best.error, color=style.LIGHT, linewidth=0.8, zorder=0)
        for trial in trials:
            error, colour = 100 * trial.error, colours[str(trial.settings[first])]
            # below the error, to where its logarithm is one standard error less
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
    """Return the half widths over one quantity as a line, over two as colours; with three the first
    two are drawn.
    """
    names = list(plan.quantities)[:2]
    labels = [_label(plan.quantities[name]) for name in names]
    half = f"half width of {plan.target.name} ({plan.target.unit})"
    handles = [
        key("measured", color=style.GREY, **MARK),
        key("next", color=style.VERMILLION, **MARK),
    ]
    caption = (
        "Half of the width of the 95 % interval, and where to measure next, numbered from the "
        "best on."
    )
    y_label, height, on = half, 2.3, partial(_draw_widths, plan=plan, name=names[0])
    if plan.candidates[0].kind == "between":
        caption = "The levels that were measured, and the next ones, numbered from the best on."
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
    for number, one in enumerate(plan.candidates[:3], 1):
        height = one.half_width if np.isfinite(one.half_width) else 0.0
        _draw_number(ax, one.at[name], height, number)
    ax.set_ylim(bottom=0)


def _draw_map(ax: Axes, plan: Plan, names: Sequence[str], label: str) -> None:
    x, y = (plan.picture.places[name] for name in names)
    look: dict[str, Any] = {"marker": "s", "linewidths": 0, "cmap": "Blues", "zorder": 0}
    colours = ax.scatter(x, y, 9, plan.picture.before, **look)
    ax.figure.colorbar(colours, ax=ax, label=label, use_gridspec=False)
    dots = MARK | {"markersize": 2, "color": style.LIGHT, "markerfacecolor": style.GREY}
    ax.plot(*(plan.picture.measured[name] for name in names), **dots)
    for number, one in enumerate(plan.candidates, 1):
        _draw_number(ax, one.at[names[0]], one.at[names[1]], number)


def _draw_number(ax: Axes, x: float, y: float, number: int) -> None:
    ax.plot(x, y, color=style.VERMILLION, **MARK)
    panels.write_at(ax, str(number), (x, y), (3, 3), color=style.VERMILLION)


def drift_drawing(
    names: Sequence[str], points: Sequence[ReferencePoint], output: Quantity
) -> Drawing:
    """Return a line for each reference point, a dot for each campaign, in per cent of the first."""

    def on(ax: Axes) -> None:
        for point, colour in zip(points, style.level_colours(len(points)), strict=True):
            label = ", ".join(f"{name} {value:.3g}" for name, value in point.inputs.items())
            per_cent = [100 * value / point.outputs[0] for value in point.outputs]
            ax.plot(per_cent, color=colour, marker="o", markersize=3, label=label)
        ax.set_xticks(range(len(names)), panels.told_apart(names, 22))

    what = style.PLAIN.axis_label(Quantity(output.name, "% of the first"))
    caption = f"{output.name} at reference points over campaigns, in per cent of the first."
    return Drawing("drift", caption, (Panel("", on, "Campaign", (what,)),), Layout(2.6))


def draw_model(
    ax: Axes, model: Model, level: float | None = None, held_out: Sequence[Curve] = ()
) -> None:
    """Draw a line for every training curve, over the input that varies most within it; other inputs
    are held in the middle of their ranges. Of `held_out` curves, the samples are dots, and the
    model at them is a dashed line.

    With `level`, as 0.95, the band of that interval around each.

    Raises TypeError for a model that has no training curves: it runs along recordings, or is a sum.
    """
    if not isinstance(model.body, Pieces | Formula):
        raise TypeError(
            f"{model.name} has no curves to draw; call it with a recording, and draw what it says"
        )
    ranges = model.body.ranges
    along = varying_input(model, [one.limits for one in ranges])
    colours = iter(style.level_colours(len(ranges) + len(held_out)))

    def line(columns: Columns, label: str, dashes: str) -> None:
        x, y, colour = columns[along], predict(model, columns), next(colours)
        ax.plot(x, y, dashes, color=colour, label=label)
        if level is not None:
            half = half_widths_of(model, columns, level)
            panels.shade_between(ax, x, (y - half, y + half), colour)

    for one in ranges:
        columns = {name: np.full(POINTS, sum(ends) / 2) for name, ends in one.limits.items()}
        if model.level is not None and one.level is not None:
            columns[model.level] = np.full(POINTS, one.level)
        line(columns | {along: np.linspace(*one.limits[along], POINTS)}, one.curve, "-")
    for curve in held_out:
        ordered = curve.at(np.argsort(curve.columns[along], kind="stable")).columns
        line(ordered, f"{curve.id}, held out", "--")
        ax.plot(ordered[along], ordered[model.output.name], **HELD_OUT)
    quantity = next(quantity for quantity in model.inputs if quantity.name == along)
    ax.set_xlabel(style.PLAIN.axis_label(quantity))
    ax.set_ylabel(style.PLAIN.axis_label(model.output))
    ax.legend()


# Campaigns
# --------------------------------------------------------------------------------------------------

ROUNDING = 1e-10
"""NRMSE below which an error is that of rounding; on a logarithmic axis it would leave no room for
the others.
"""
MOST_RUNS = 100
"""Runs of a campaign in its figure; of more, some stand for all."""

BEST_OTHER = "best of the others"
FLOOR: dict[str, Any] = {
    "marker": "|",
    "markersize": 9,
    "markeredgewidth": 1.2,
    "color": style.GREY,
}


def campaign_figures(scores: CampaignScores) -> list[Drawing]:
    """Return a line of dots for each run on a logarithmic axis: the runs' own model, the one that
    ratios are taken to, the best of a run's others, and repeated measurements; none for a single
    run. Of very many some are drawn, the run with the least error among them.
    """
    pooled, own = scores.pooled, scores.own
    every = list(pooled)
    of_own = {run: pooled[run][own].nrmse for run in every if own in pooled[run]}
    best = min(
        filter(lambda run: np.isfinite(of_own[run]), of_own), key=of_own.__getitem__, default=""
    )
    shown = {best, *(every[i] for i in panels.evenly(len(every), MOST_RUNS))}
    runs = [run for run in every if run in shown]
    known = [
        {model: 100 * row.nrmse for model, row in pooled[run].items() if row.nrmse > ROUNDING}
        for run in runs
    ]
    for of_run in known:
        others = [of_run[model] for model in of_run.keys() - {own, REPEATABILITY}]
        of_run[BEST_OTHER] = min(filter(np.isfinite, others), default=np.nan)
    names = dict.fromkeys(filter(None, [own, scores.relative_to, BEST_OTHER, REPEATABILITY]))
    errors = {
        name: np.array([of_run.get(name, np.nan) for of_run in known], dtype=np.float64)
        for name in names
    }
    exact = [run for run in runs if of_own.get(run, np.inf) <= ROUNDING]
    drawn = [model for model, dots in errors.items() if np.isfinite(dots).any()]
    if len(runs) < 2 or not {*drawn} - {REPEATABILITY}:
        return []
    looks = style.model_styles(drawn)

    def on(ax: Axes) -> None:
        rows, across = np.arange(len(runs)), ax.get_yaxis_transform()
        ax.hlines(rows, 0.0, 1.0, transform=across, colors=style.LIGHT, linewidth=0.4, zorder=0)
        for place, model in enumerate(drawn):
            look, finite = looks[model], np.isfinite(errors[model])
            dots: dict[str, Any] = {"marker": look.marker, "markersize": 4.0 + look.width}
            dots |= {"color": look.colour, "markeredgewidth": 0}
            # the own dots over the others
            dots = (FLOOR if model == REPEATABILITY else dots) | {"zorder": 3 - 0.1 * place}
            ax.plot(errors[model][finite], rows[finite], linestyle="none", label=model, **dots)
        panels.label_rows(ax, panels.told_apart(runs, 40))
        panels.plain_logarithm(ax.xaxis, (1.0, 2.0, 5.0))

    caption = f"NRMSE of every run, further left is better. The {BEST_OTHER}: known afterwards."
    if exact:
        caption += f" Without a dot, since its error is but rounding: {own} in {', '.join(exact)}."
    if len(runs) < len(every):
        caption += (
            f" {len(runs)} of {len(every)} runs are drawn, the one that errs least among them."
        )
    grid = Layout(0.45 + 0.21 * len(runs), width=DOUBLE)
    return [Drawing("nrmse", caption, (Panel("", on, "NRMSE (%)", ("",)),), grid)]
