"""Figures of commands, beside those of the page: of `tune`, `plan` and `compare`, and a model by
itself for notebooks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.domain.models import CurveRange, Formula, Model, Pieces
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.results import Plan
from mapmore_cli.domain.scores import REPEATABILITY, Tuning
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.validation.comparison import ReferencePoint
from mapmore_cli.modelling.validation.intervals import half_widths_of
from mapmore_cli.modelling.validation.significance import WITHIN
from mapmore_cli.reporting.campaign import CampaignScores
from mapmore_cli.reporting.figures import style
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import ModelStyle
from mapmore_cli.reporting.inputs import MOST_LINES, FigureStyle

MARK: dict[str, Any] = style.DOT | {"markersize": 4}
RING: dict[str, Any] = style.DOT | {
    "markersize": 10,
    "markerfacecolor": "none",
    "color": style.GREY,
}

SHOWN = 3
"""Of the levels: so many of the best are marked; of points, all are."""

POINTS = 201


def drawing_of(found: Tuning | Plan) -> Drawing:
    """Return the figure of what `tune` or `plan` found."""
    return tuning_drawing(found) if isinstance(found, Tuning) else plan_drawing(found)


def tuning_drawing(tuning: Tuning) -> Drawing:
    """Return a dot for every combination, with the standard error of what it errs above the best;
    the simplest within that is ringed.
    """
    trials = [trial for trial in tuning.trials if trial.errors]
    first = next(iter(tuning.chosen.settings))
    groups = list(dict.fromkeys(str(trial.settings[first]) for trial in trials))
    colours = dict(zip(groups, style.level_colours(len(groups)), strict=True))

    def on(axes: Sequence[Axes]) -> None:
        ax = axes[0]
        ax.axhline(100 * tuning.best.error, color=style.LIGHT, linewidth=0.8, zorder=0)
        for trial in trials:
            look: dict[str, Any] = {
                "color": colours[str(trial.settings[first])],
                "markersize": 4,
                "elinewidth": 0.8,
            }
            below = 1 - np.exp(
                -np.clip(trial.spread, *WITHIN)
            )  # of the error, where its logarithm is one standard error less
            ax.errorbar(
                trial.parameters, 100 * trial.error, yerr=100 * trial.error * below, fmt="o", **look
            )
        chosen = tuning.chosen
        ax.plot(chosen.parameters, 100 * chosen.error, **RING)

    handles = [
        style.key(f"{first} {group}", color=colour, **MARK) for group, colour in colours.items()
    ]
    handles.append(style.key("simplest within one standard error", **RING | {"markersize": 8}))
    caption = (
        "Error on training data that were left out, over the number of free parameters. Bars: "
        "the standard error of the ratio to the "
        "best (2 to 20 %), whose error is the line. A combination whose bar reaches the line "
        "is as good as the best, as far as these "
        "data can tell."
    )
    data: dict[str, Values] = {
        name: [str(trial.settings[name]) for trial in trials] for name in trials[0].settings
    }
    data |= {
        "parameters": [trial.parameters for trial in trials],
        "left-out NRMSE [%]": [100 * trial.error for trial in trials],
        "above the best [%]": [100 * trial.excess for trial in trials],
        "standard error [%]": [100 * trial.spread for trial in trials],
    }
    panel = Panel("", on, "Free parameters", ("Left-out NRMSE (%)",), data)
    return Drawing("tuning", caption, caption, (panel,), Grid(height=2.6), tuple(handles))


def plan_drawing(plan: Plan) -> Drawing:
    """Return the half widths over one quantity as a line, over two as colours; with three the first
    two are drawn.
    """
    names = list(plan.quantities)[:2]
    labels = [_label(plan.quantities[name]) for name in names]
    marks = (
        style.key("measured", color=style.GREY, **MARK),
        style.key("next", color=style.VERMILLION, **MARK),
    )
    half = f"half width of {plan.target.name} ({plan.target.unit})"
    caption = (
        "Half of the width of the 95 % interval, and where to measure next, numbered from the "
        "best on."
    )
    data: dict[str, Values] = {
        _label(plan.quantities[name]): plan.picture.places[name] for name in names
    }
    if plan.candidates[0].kind == "between":
        caption = "The levels that were measured, and the next ones, numbered from the best on."
        panel = Panel("", lambda axes: _lines(axes[0], plan, names[0]), labels[0], ("",), data)
        return Drawing("plan", caption, caption, (panel,), Grid(height=1.4), marks)
    data |= {f"{half} before": plan.picture.before, f"{half} after": plan.picture.after}
    if len(names) == 1:
        panel = Panel("", lambda axes: _lines(axes[0], plan, names[0]), labels[0], (half,), data)
        handles = (
            style.key("now", color=style.BLUE),
            style.key("forecast after all", color=style.ORANGE),
        )
        return Drawing("plan", caption, caption, (panel,), Grid(height=2.3), (*handles, *marks))
    panel = Panel("", lambda axes: _map(axes, plan, names, half), labels[0], (labels[1],), data)
    return Drawing("plan", caption, caption, (panel,), Grid(height=2.8), marks)


def _label(quantity: Quantity) -> str:
    return quantity.name if quantity.unit == "1" else f"{quantity.name} ({quantity.unit})"


def _lines(ax: Axes, plan: Plan, name: str) -> None:
    x = plan.picture.places[name]
    ax.plot(x, plan.picture.before, color=style.BLUE)
    ax.plot(x, plan.picture.after, color=style.ORANGE, zorder=1)
    measured = plan.picture.measured[name]
    ax.plot(measured, np.zeros(len(measured)), color=style.GREY, clip_on=False, **MARK)
    for number, one in enumerate(plan.candidates[:SHOWN], 1):
        height = one.half_width if np.isfinite(one.half_width) else 0.0
        _numbered(ax, one.at[name], height, number)
    ax.set_ylim(bottom=0)


def _map(axes: Sequence[Axes], plan: Plan, names: Sequence[str], label: str) -> None:
    ax = axes[0]
    x, y = (plan.picture.places[name] for name in names)
    shown = ax.scatter(
        x, y, c=plan.picture.before, s=9, marker="s", linewidths=0, cmap="Blues", zorder=0
    )
    ax.figure.colorbar(shown, ax=ax, label=label, use_gridspec=False)
    ax.plot(
        *(plan.picture.measured[name] for name in names),
        color=style.LIGHT,
        **{**MARK, "markersize": 2, "markerfacecolor": style.GREY},
    )
    for number, one in enumerate(plan.candidates, 1):
        _numbered(ax, one.at[names[0]], one.at[names[1]], number)


def _numbered(ax: Axes, x: float, y: float, number: int) -> None:
    ax.plot(x, y, color=style.VERMILLION, **MARK)
    ax.annotate(
        str(number), (x, y), xytext=(3, 3), textcoords="offset points", color=style.VERMILLION
    )


def drift_drawing(
    names: Sequence[str], points: Sequence[ReferencePoint], output: Quantity
) -> Drawing:
    """Return a line for each reference point, a dot for each campaign, in per cent of the first."""
    colours = style.level_colours(len(points))
    labels = [
        ", ".join(f"{name} {value:.3g}" for name, value in point.inputs.items()) for point in points
    ]
    data: dict[str, Values] = {"campaign": list(names)}
    data |= {
        f"{label} [{output.unit}]": point.outputs
        for label, point in zip(labels, points, strict=True)
    }

    def on(axes: Sequence[Axes]) -> None:
        for point, colour in zip(points, colours, strict=True):
            relative = [100 * value / point.outputs[0] for value in point.outputs]
            axes[0].plot(
                range(len(names)), relative, color=colour, marker="o", markersize=3, linewidth=1.1
            )
        axes[0].set_xticks(range(len(names)), [style.shortened(name, 22) for name in names])

    legend = tuple(
        style.key(label, color=colour, marker="o", markersize=3)
        for label, colour in zip(labels, colours, strict=True)
    )
    what = FigureStyle().axis_label(Quantity(output.name, "% of the first"))
    caption = f"{output.name} at reference points over campaigns, in per cent of the first."
    return Drawing(
        "drift",
        caption,
        caption,
        (Panel("", on, "Campaign", (what,), data),),
        Grid(height=2.6),
        legend,
    )


def draw_model(ax: Axes, model: Model, level: float | None = None) -> None:
    """Draw a line for every training curve, over the input that varies most within it; other inputs
    are held in the middle of their ranges.

    With `level`, as 0.95, the band of that interval around each.

    Raises TypeError for a model that has no training curves: it runs along recordings, or is a sum.
    """
    if not isinstance(model.body, Pieces | Formula):
        raise TypeError(
            f"{model.name} has no curves to draw; call it with a recording, and draw what it says"
        )
    ranges = model.body.ranges
    along = _varying(model, ranges)
    for colour, one in zip(style.level_colours(len(ranges)), ranges, strict=True):
        x = np.linspace(*one.limits[along], POINTS)
        held = {name: np.full(POINTS, sum(ends) / 2) for name, ends in one.limits.items()}
        if model.level is not None and one.level is not None:
            held[model.level] = np.full(POINTS, one.level)
        said = predict(model, {**held, along: x})
        ax.plot(x, said, color=colour, label=one.curve)
        if level is not None:
            half = half_widths_of(model, {**held, along: x}, level)
            ax.fill_between(x, said - half, said + half, color=colour, alpha=0.2, linewidth=0)
    ax.set_xlabel(
        FigureStyle().axis_label(
            next(quantity for quantity in model.inputs if quantity.name == along)
        )
    )
    ax.set_ylabel(FigureStyle().axis_label(model.output))
    ax.legend()


def _varying(model: Model, ranges: tuple[CurveRange, ...]) -> str:
    """Return the first segmented variable, else the input that varies most within a curve beside
    its range over all curves.
    """
    if isinstance(model.body, Pieces) and model.body.variables:
        return model.body.variables[0]

    def share(name: str) -> float:
        ends = np.array([one.limits[name] for one in ranges])
        whole = float(np.ptp(ends))
        return float(np.mean(np.ptp(ends, axis=1))) / whole if whole > 0 else 0.0

    return max(
        (quantity.name for quantity in model.inputs if quantity.name != model.level), key=share
    )


FEWEST_RUNS = 2
ROUNDING = 1e-10
"""NRMSE below which an error is that of rounding; on a logarithmic axis it would leave no room for
the others.
"""
BEST_OTHER = "best of the others"
FLOOR: dict[str, Any] = {
    "linestyle": "none",
    "marker": "|",
    "markersize": 9,
    "markeredgewidth": 1.2,
    "color": style.GREY,
}


def campaign_figures(scores: CampaignScores) -> list[Drawing]:
    """Return a line of dots for each run, a dot for each model, on a logarithmic axis; none for a
    single run.

    Where most models are those of a few runs, a run's own model stands beside the best of its
    others.
    """
    runs = {
        name: {model: 100 * row.nrmse for model, row in run.items() if row.nrmse > ROUNDING}
        for name, run in scores.pooled.items()
    }
    shown = [scores.own, BEST_OTHER] if scores.sparse else _shown(scores)
    if scores.sparse:
        runs = {name: _own_and_best(run, scores.own) for name, run in runs.items()}
    if len(runs) < FEWEST_RUNS or not any(model in run for run in runs.values() for model in shown):
        return []
    styles = style.model_styles(shown)
    handles = [style.key(model, **_look(look)) for model, look in styles.items()]
    if any(REPEATABILITY in run for run in runs.values()):
        handles.append(style.key(REPEATABILITY, **FLOOR))
    models = [model for model in scores.models if model != REPEATABILITY]
    which = (
        f" {BEST_OTHER.capitalize()}: known afterwards only."
        if scores.sparse
        else style.best_of(len(shown), len(models))
    )
    exact = [
        name
        for name, run in scores.pooled.items()
        if scores.own in run and run[scores.own].nrmse <= ROUNDING
    ]
    left_out = (
        f" Without a dot, since its error is but rounding: {scores.own} in {', '.join(exact)}."
        if exact
        else ""
    )
    caption = f"NRMSE of every run, further left is better.{which}{left_out}"
    alt = "NRMSE of every run and model; the numbers are in the table below."
    rows = [(name, model, error) for name, run in runs.items() for model, error in run.items()]
    data: dict[str, Values] = dict(
        zip(("run", "model", "NRMSE [%]"), zip(*rows, strict=True), strict=True)
    )
    panel = Panel("", lambda axes: _draw_runs(axes[0], runs, styles), "NRMSE (%)", ("",), data)
    return [
        Drawing(
            "nrmse",
            caption,
            alt,
            (panel,),
            Grid(width=style.DOUBLE, height=0.45 + 0.21 * len(runs)),
            tuple(handles),
        )
    ]


def _own_and_best(run: Mapping[str, float], own: str) -> dict[str, float]:
    """Return the errors of a run's own model, of the best of its others, and of repeated
    measurements.
    """
    others = [
        error
        for model, error in run.items()
        if model not in (own, REPEATABILITY) and math.isfinite(error)
    ]
    best = {BEST_OTHER: min(others)} if others else {}
    return {model: error for model, error in run.items() if model in (own, REPEATABILITY)} | best


def _draw_runs(
    ax: Axes, runs: Mapping[str, dict[str, float]], styles: dict[str, ModelStyle]
) -> None:
    ax.hlines(
        range(len(runs)),
        0.0,
        1.0,
        transform=ax.get_yaxis_transform(),
        colors=style.LIGHT,
        linewidth=0.4,
        zorder=0,
    )
    looks = {model: _look(look) for model, look in reversed(styles.items())} | {
        REPEATABILITY: FLOOR
    }  # the own dots over the others
    for model, look in looks.items():
        found = [
            (run[model], place)
            for place, run in enumerate(runs.values())
            if math.isfinite(run.get(model, math.nan))
        ]
        if found:
            ax.plot(*zip(*found, strict=True), **look)
    style.label_rows(ax, [style.shortened(name, 40) for name in runs])
    style.plain_logarithm(ax.xaxis, (1.0, 2.0, 5.0))


def _shown(scores: CampaignScores) -> list[str]:
    """Return the runs' own model first, and those of the others that are the nearest to the best,
    in the order of the table.
    """
    others = [model for model in scores.models if model not in (scores.own, REPEATABILITY)]
    best = sorted(others, key=lambda model: _mean_logarithm(scores, model))[: MOST_LINES - 1]
    return [scores.own, *(model for model in others if model in best)]


def _mean_logarithm(scores: CampaignScores, model: str) -> float:
    """Of its NRMSE over the runs that have it, as the geometric mean has it; infinite where a run
    diverged.
    """
    found = [run[model].nrmse for run in scores.pooled.values() if model in run]
    return sum(math.log(value) if 0 < value < math.inf else math.inf for value in found) / len(
        found
    )


def _look(look: ModelStyle) -> dict[str, Any]:
    return {
        "linestyle": "none",
        "marker": look.marker,
        "markersize": 4.0 + look.width,
        "color": look.colour,
        "markeredgewidth": 0,
    }
