"""Measured and predicted: over time for recordings of motion, as loops for a model with memory,
else over the in-curve quantity.

Curves stand as in M2's figures 9 and 10: held-out ones with what the models predict above and their
errors below, training curves in one panel with the run's own model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.reporting.figures import style
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.motion import loop_figures, motion_figures
from mapmore_cli.reporting.figures.style import ModelStyle
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import title_of

MOST_PANELS, MOST_SPANS, MOST_CURVES = 9, 6, 10
LABEL_ROOM, LABEL_HEIGHT = 0.24, 0.06
"""What the name of a curve takes of the width and of the height of the panel."""


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return the figures of the fit that suit the study."""
    if inputs.has_memory:
        return [*loop_figures(inputs), *motion_figures(inputs)]
    return (
        motion_figures(inputs)
        if inputs.over_time
        else [*held_out_figures(inputs), *training_figures(inputs)]
    )


@dataclass(frozen=True)
class CurveFit:
    """One curve in the order of the in-curve quantity: measured `y` over `x`, and every model's
    prediction, each `(n,)`.

    `interval` are the ends of the intervals of the run's `own` model, where it has some.
    """

    title: str
    x: Array
    y: Array
    held_out: BoolArray
    predictions: Mapping[str, Array]
    own: str
    interval: tuple[Array, Array] | None = None

    def predicted(self, model: str) -> bool:
        """Return False where the model gave no prediction, because its fit failed."""
        return bool(np.isfinite(self.predictions[model]).any())


def curve_fit(inputs: ReportInputs, number: int, rows: BoolArray | None = None) -> CurveFit:
    """Curve `number` of the dataset, or only some of its rows."""
    curve = inputs.dataset.curves[number]
    x = curve.columns[inputs.in_curve.name]
    order = np.argsort(x, kind="stable")
    if rows is not None:
        order = order[rows[order]]
    predictions = {
        model: inputs.validation.predictions[model][number][order] for model in inputs.lines
    }
    y, ends = curve.columns[inputs.dataset.target], inputs.interval(number)
    interval = None if ends is None else (ends[0][order], ends[1][order])
    return CurveFit(
        inputs.curve_label(curve),
        x[order],
        y[order],
        curve.held_out[order],
        predictions,
        inputs.own,
        interval,
    )


def held_out_spans(x: Array, held_out: BoolArray) -> list[tuple[float, float]]:
    """Return runs of held-out samples along sorted `x` as (start, end), each reaching halfway to
    the neighbouring training samples.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held_out, [False]]).astype(int)))
    middle = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2, x[-1:]])
    return [(float(middle[start]), float(middle[end])) for start, end in edges.reshape(-1, 2)]


def draw_fit(ax: Axes, curve: CurveFit, styles: Mapping[str, ModelStyle]) -> None:
    """Draw measured samples as dots, filled where held out, and every model as a line. A model
    without prediction draws nothing.
    """
    for rows, face, edge in (
        (~curve.held_out, "none", style.GREY),
        (curve.held_out, style.BLACK, style.BLACK),
    ):
        if rows.any():
            dots = np.flatnonzero(rows)[
                style.cloud(curve.x[rows], curve.y[rows], style.DOTS_A_CURVE)
            ]
            look: dict[str, Any] = {
                "markersize": 2.2,
                "markeredgewidth": 0.5,
                "markerfacecolor": face,
                "markeredgecolor": edge,
            }
            ax.plot(curve.x[dots], curve.y[dots], zorder=2, **style.DOT | look)
    if curve.interval is not None:
        style.draw_interval(ax, curve.x, curve.interval, styles[curve.own].colour)
    _draw_models(ax, curve, curve.predictions, styles)


def draw_error(ax: Axes, curve: CurveFit, styles: Mapping[str, ModelStyle]) -> None:
    """Draw predicted minus measured, one line a model."""
    style.zero_line(ax)
    if curve.interval is not None:
        low, high = (end - curve.predictions[curve.own] for end in curve.interval)
        style.draw_interval(ax, curve.x, (low, high), styles[curve.own].colour)
    _draw_models(
        ax, curve, {model: values - curve.y for model, values in curve.predictions.items()}, styles
    )


def _draw_models(
    ax: Axes, curve: CurveFit, lines: Mapping[str, Array], styles: Mapping[str, ModelStyle]
) -> None:
    for model, values in lines.items():
        if curve.predicted(model):
            style.draw_band(ax, curve.x, values, label=model, **styles[model].line)


def mark_held_out(ax: Axes, curve: CurveFit) -> None:
    """Shade the held-out regions of a curve that has training samples too; scattered ones are told
    by their dots alone.
    """
    spans = held_out_spans(curve.x, curve.held_out)
    if not curve.held_out.all() and len(spans) <= MOST_SPANS:
        for start, end in spans:
            ax.axvspan(start, end, color="#f0f0f0", zorder=-1, linewidth=0)


def held_out_figures(inputs: ReportInputs) -> list[Drawing]:
    """One pair of axes a curve that has held-out samples, or was asked for; no figure where there
    is none.
    """
    numbers = [
        i
        for i, curve in enumerate(inputs.dataset.curves)
        if curve.held_out.any() or curve.id in inputs.asked
    ]
    shown = style.some_curves(inputs, numbers, MOST_PANELS)
    if not shown:
        return []
    curves = [curve_fit(inputs, number) for number in shown]
    styles = style.model_styles(inputs.lines, inputs.style.palette)
    far_off = [model for model in inputs.far_off if model in inputs.lines]
    panels = tuple(
        _panel(inputs, inputs.dataset.curves[i].id, curve, styles, far_off)
        for i, curve in zip(shown, curves, strict=True)
    )
    grid = Grid(
        style.columns_for(len(panels)),
        style.width_for(len(panels)),
        2.65,
        (2.0, 1.0),
        common_x=True,
        common_y="row",
    )
    mixed = any(not curve.held_out.all() for curve in curves)
    what = f"Measured and predicted {inputs.target.name}"
    marked = (
        " Filled dots and grey bands mark held-out samples, open dots training samples."
        if mixed
        else ""
    )
    left_out = style.some_of(
        len(curves), len(numbers), "curves with held-out samples"
    ) + style.best_of(len(styles), len(inputs.models))
    thinned = style.thinned([len(curve.x) for curve in curves])
    drawn = f"{thinned}{left_out}{style.beyond_scale(far_off)}"
    caption = (
        f"{what} of the held-out curves above, predicted minus measured "
        f"below.{marked}{style.interval_words(inputs)}{drawn}"
    )
    alt = f"{what} over {inputs.in_curve.name}: {_worst_errors(curves)}."
    return [Drawing("fit", caption, alt, panels, grid, tuple(_legend(curves, styles, mixed)))]


def _panel(
    inputs: ReportInputs,
    name: str,
    curve: CurveFit,
    styles: Mapping[str, ModelStyle],
    far_off: Sequence[str],
) -> Panel:
    """One curve; where models are far off, its axes show what was measured and the others."""

    def on(axes: Sequence[Axes]) -> None:
        for ax, draw in zip(axes, (draw_fit, draw_error), strict=True):
            mark_held_out(ax, curve)
            draw(ax, curve, styles)

    near = [values for model, values in curve.predictions.items() if model not in far_off]
    limits = (
        (style.extent([curve.y, *near]), style.extent([values - curve.y for values in near]))
        if far_off
        else ()
    )
    labels = (inputs.axis_label(inputs.target), f"Error ({inputs.target.unit})")
    return Panel(
        name,
        on,
        inputs.axis_label(inputs.in_curve),
        labels,
        curve_data(inputs, curve),
        style.shortened(curve.title, 34),
        limits,
    )


def curve_data(inputs: ReportInputs, curve: CurveFit) -> dict[str, Values]:
    """Return what is drawn of a curve, by heading: measured, whether held out, and what every model
    predicts.
    """
    unit = inputs.target.unit
    data: dict[str, Values] = {
        style.heading(inputs.in_curve): curve.x,
        style.heading(inputs.target): curve.y,
    }
    data["data"] = np.where(curve.held_out, "validate", "train")
    data |= {f"{model} [{unit}]": values for model, values in curve.predictions.items()}
    ends = {} if curve.interval is None else dict(zip(("low", "high"), curve.interval, strict=True))
    return {**data, **{f"{inputs.own} {end} [{unit}]": values for end, values in ends.items()}}


def _legend(
    curves: Sequence[CurveFit], styles: Mapping[str, ModelStyle], mixed: bool
) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = []
    if any(curve.held_out.any() for curve in curves):
        handles.append(
            style.key("held out" if mixed else "measured", color=style.BLACK, **style.DOT)
        )
    if mixed:
        handles.append(
            style.key("training", markerfacecolor="none", markeredgecolor=style.GREY, **style.DOT)
        )
    for model, look in styles.items():
        failed = not any(curve.predicted(model) for curve in curves)
        cross: dict[str, Any] = {"linestyle": "none", "marker": "x"} if failed else {}
        handles.append(
            style.key(f"{title_of(model)} (failed)" if failed else model, **look.line | cross)
        )
    if any(curve.interval is not None for curve in curves):
        handles.append(style.interval_key(styles[curves[0].own].colour))
    return handles


def _worst_errors(curves: Sequence[CurveFit]) -> str:
    scored = [
        (curve, curve.held_out if curve.held_out.any() else ~curve.held_out) for curve in curves
    ]

    def worst(model: str) -> str:
        errors = np.concatenate(
            [np.abs(curve.predictions[model] - curve.y)[rows] for curve, rows in scored]
        )
        return (
            f"largest error {np.nanmax(errors):.3g}"
            if np.isfinite(errors).any()
            else "no prediction"
        )

    return ", ".join(f"{title_of(model)}: {worst(model)}" for model in curves[0].predictions)


def training_curve_fits(inputs: ReportInputs) -> list[CurveFit]:
    """Return the training samples of every curve that has some."""
    curves = inputs.dataset.curves
    return [
        curve_fit(inputs, i, ~curve.held_out)
        for i, curve in enumerate(curves)
        if not curve.held_out.all()
    ]


def draw_training_curves(
    top: Axes, bottom: Axes, curves: Sequence[CurveFit], model: str, own_colour: str
) -> None:
    """Draw measured samples coloured by curve with the model's lines over them, and the errors in
    the same colours.
    """
    style.zero_line(bottom)
    for curve, colour in zip(curves, style.level_colours(len(curves)), strict=True):
        dots = style.cloud(curve.x, curve.y, style.DOTS_A_CURVE)
        top.plot(
            curve.x[dots],
            curve.y[dots],
            color=colour,
            **style.DOT | {"markersize": 2.0, "markeredgewidth": 0},
        )
        if curve.predicted(model):
            predicted = curve.predictions[model]
            style.draw_band(top, curve.x, predicted, own_colour, linewidth=1.1, zorder=3)
            style.draw_band(bottom, curve.x, predicted - curve.y, colour, linewidth=0.8)


def label_curves(ax: Axes, curves: Sequence[CurveFit]) -> None:
    """Write the names of the curves beside that end at which they lie further apart; a name that
    would cover another is left out.
    """
    colours = style.level_colours(len(curves))
    left, right = (np.array([curve.y[end] for curve in curves]) for end in (0, -1))
    at_left = bool(np.ptp(left) >= np.ptp(right))
    end, ends = (0, left) if at_left else (-1, right)
    low, high = ax.get_xlim()
    room = LABEL_ROOM * (high - low)
    ax.set_xlim(low - room if at_left else low, high if at_left else high + room)
    apart, last = LABEL_HEIGHT * np.ptp(ax.get_ylim()), -np.inf
    for i in np.argsort(ends, kind="stable"):
        if ends[i] - last >= apart:
            last = ends[i]
            place, offset = (float(curves[i].x[end]), float(ends[i])), (-4 if at_left else 4, 0)
            look = {
                "ha": "right" if at_left else "left",
                "va": "center",
                "fontsize": style.small(),
                "color": colours[i],
            }
            ax.annotate(
                style.shortened(curves[i].title, 14),
                place,
                offset,
                textcoords="offset points",
                annotation_clip=False,
                **look,
            )


def training_figures(inputs: ReportInputs) -> list[Drawing]:
    """One figure for the training curves, or for some of them where they are many."""
    every = training_curve_fits(inputs)
    curves = [every[i] for i in style.spread(len(every), MOST_CURVES)]
    if not curves:
        return []
    look = style.model_styles([inputs.own], inputs.style.palette)[inputs.own]

    def on(axes: Sequence[Axes]) -> None:
        draw_training_curves(axes[0], axes[1], curves, inputs.own, look.colour)
        label_curves(axes[0], curves)

    data: dict[str, Values] = {
        "curve": [curve.title for curve in curves for _ in curve.x],
        style.heading(inputs.in_curve): np.concatenate([curve.x for curve in curves]),
        style.heading(inputs.target): np.concatenate([curve.y for curve in curves]),
        f"{inputs.own} [{inputs.target.unit}]": np.concatenate(
            [curve.predictions[inputs.own] for curve in curves]
        ),
    }
    labels = (inputs.axis_label(inputs.target), f"Error ({inputs.target.unit})")
    panel = Panel("", on, inputs.axis_label(inputs.in_curve), labels, data)
    legend = (
        style.key("measured", color=style.GREY, **style.DOT),
        style.key(inputs.own, color=look.colour, linewidth=look.width),
    )
    caption = (
        f"The training curves with {inputs.own} above, its error (predicted minus measured) below."
        f"{style.thinned([len(curve.x) for curve in curves])}"
        f"{style.some_of(len(curves), len(every), 'training curves')}"
    )
    spoken = ", ".join(curve.title for curve in curves)
    alt = f"Training curves {spoken}, with the predictions of {inputs.own} and their errors."
    return [
        Drawing("fit_training", caption, alt, (panel,), Grid(height=2.95, stack=(2.2, 1.0)), legend)
    ]
