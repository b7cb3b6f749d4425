"""Held-out curves, what the models predict above and their errors below, as M2's figures 9 and 10."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import (
    BLACK,
    DOTS_A_CURVE,
    GREY,
    ModelStyle,
    best_of,
    beyond_scale,
    columns_for,
    draw_band,
    draw_interval,
    extent,
    interval_key,
    interval_words,
    model_styles,
    places,
    shortened,
    some_of,
    thinned,
    width_for,
    zero_line,
)
from mapmore_cli.reporting.figures.thinning import cloud
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.titles import title_of

MOST_PANELS = 9
MOST_SPANS = 6


@dataclass(frozen=True)
class CurveFit:
    """One curve in the order of the in-curve quantity: measured `y` over `x`, and every model's prediction, each `(n,)`.

    `interval` are the ends of the intervals of the run's `own` model, where it has some.
    """

    title: str
    x: Array
    y: Array
    held_out: BoolArray
    predictions: Mapping[str, Array]
    own: str
    interval: tuple[Array, Array] | None = None

    @property
    def scored(self) -> BoolArray:
        """The held-out samples, or all where there are none, `(n,)`."""
        return self.held_out if self.held_out.any() else ~self.held_out

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
    predictions = {model: inputs.validation.predictions[model][number][order] for model in inputs.lines}
    y, ends = curve.columns[inputs.dataset.target], inputs.interval(number)
    interval = None if ends is None else (ends[0][order], ends[1][order])
    return CurveFit(inputs.curve_label(curve), x[order], y[order], curve.held_out[order], predictions, inputs.own, interval)


def held_out_spans(x: Array, held_out: BoolArray) -> list[tuple[float, float]]:
    """Yield runs of held-out samples along sorted `x` as (start, end), each reaching halfway to the neighbouring training samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held_out, [False]]).astype(int)))
    middle = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2, x[-1:]])
    return [(float(middle[start]), float(middle[end])) for start, end in edges.reshape(-1, 2)]


def draw_fit(ax: Axes, curve: CurveFit, styles: Mapping[str, ModelStyle]) -> None:
    """Draw measured samples as dots, filled where held out, and every model as a line. A model without prediction draws nothing."""
    for rows, face, edge in ((~curve.held_out, "none", GREY), (curve.held_out, BLACK, BLACK)):
        if rows.any():
            dots = np.flatnonzero(rows)[cloud(curve.x[rows], curve.y[rows], DOTS_A_CURVE)]
            look: dict[str, Any] = {"markersize": 2.2, "markeredgewidth": 0.5, "markerfacecolor": face, "markeredgecolor": edge}
            ax.plot(curve.x[dots], curve.y[dots], linestyle="none", marker="o", zorder=2, **look)
    if curve.interval is not None:
        draw_interval(ax, curve.x, curve.interval, styles[curve.own].colour)
    _draw_models(ax, curve.x, {model: values for model, values in curve.predictions.items() if curve.predicted(model)}, styles)


def draw_error(ax: Axes, curve: CurveFit, styles: Mapping[str, ModelStyle]) -> None:
    """Draw predicted minus measured, one line a model."""
    zero_line(ax)
    if curve.interval is not None:
        low, high = (end - curve.predictions[curve.own] for end in curve.interval)
        draw_interval(ax, curve.x, (low, high), styles[curve.own].colour)
    errors = {model: values - curve.y for model, values in curve.predictions.items() if curve.predicted(model)}
    _draw_models(ax, curve.x, errors, styles)


def _draw_models(ax: Axes, x: Array, lines: Mapping[str, Array], styles: Mapping[str, ModelStyle]) -> None:
    for model, values in lines.items():
        style = styles[model]
        draw_band(ax, x, values, style.colour, linestyle=style.dashes, linewidth=style.width, zorder=style.zorder, label=model)


def mark_held_out(ax: Axes, curve: CurveFit) -> None:
    """Shade the held-out regions of a curve that has training samples too; scattered ones are told by their dots alone."""
    spans = held_out_spans(curve.x, curve.held_out)
    if not curve.held_out.all() and len(spans) <= MOST_SPANS:
        for start, end in spans:
            ax.axvspan(start, end, color="#f0f0f0", zorder=-1, linewidth=0)


def held_out_figures(inputs: ReportInputs) -> list[Drawing]:
    """One pair of axes a curve that has held-out samples, or was asked for; no figure where there is none."""
    numbers = [i for i, curve in enumerate(inputs.dataset.curves) if curve.held_out.any() or curve.id in inputs.asked]
    shown = [numbers[i] for i in places(inputs, [inputs.dataset.curves[i].id for i in numbers], MOST_PANELS)]
    if not shown:
        return []
    curves = [curve_fit(inputs, number) for number in shown]
    styles = model_styles(inputs.lines, inputs.style.palette)
    far_off = [model for model in inputs.far_off if model in inputs.lines]
    panels = tuple(_panel(inputs, inputs.dataset.curves[i].id, curve, styles, far_off) for i, curve in zip(shown, curves, strict=True))
    grid = Grid(columns_for(len(panels)), width_for(len(panels)), 2.65, (2.0, 1.0), common_x=True, common_y="row")
    mixed = any(not curve.held_out.all() for curve in curves)
    what = f"Measured and predicted {inputs.target.name}"
    marked = " Filled dots and grey bands mark held-out samples, open dots training samples." if mixed else ""
    left_out = some_of(len(curves), len(numbers), "curves with held-out samples") + best_of(len(styles), len(inputs.models))
    drawn = f"{thinned([len(curve.x) for curve in curves])}{left_out}{beyond_scale(far_off)}"
    caption = f"{what} of the held-out curves above, predicted minus measured below.{marked}{interval_words(inputs)}{drawn}"
    alt = f"{what} over {inputs.in_curve.name}: {_worst_errors(curves)}."
    return [Drawing("fit", caption, alt, panels, grid, tuple(_legend(curves, styles, mixed)))]


def _panel(inputs: ReportInputs, key: str, curve: CurveFit, styles: Mapping[str, ModelStyle], far_off: Sequence[str]) -> Panel:
    """One curve; where models are far off, its axes show what was measured and the others."""

    def on(axes: Sequence[Axes]) -> None:
        for ax, draw in zip(axes, (draw_fit, draw_error), strict=True):
            mark_held_out(ax, curve)
            draw(ax, curve, styles)

    near = [values for model, values in curve.predictions.items() if model not in far_off]
    limits = (extent([curve.y, *near]), extent([values - curve.y for values in near])) if far_off else ()
    labels = (inputs.axis_label(inputs.target), f"Error ({inputs.target.unit})")
    return Panel(key, on, inputs.axis_label(inputs.in_curve), labels, curve_data(inputs, curve), shortened(curve.title, 34), limits)


def curve_data(inputs: ReportInputs, curve: CurveFit) -> dict[str, Values]:
    """Return what is drawn of a curve, by heading: measured, whether held out, and what every model predicts."""
    unit, along = inputs.target.unit, inputs.in_curve
    data: dict[str, Values] = {f"{along.name} [{along.unit}]": curve.x, f"{inputs.target.name} [{unit}]": curve.y}
    data["data"] = np.where(curve.held_out, "validate", "train")
    data |= {f"{model} [{unit}]": values for model, values in curve.predictions.items()}
    ends = {} if curve.interval is None else dict(zip(("low", "high"), curve.interval, strict=True))
    return {**data, **{f"{inputs.own} {end} [{unit}]": values for end, values in ends.items()}}


def _legend(curves: Sequence[CurveFit], styles: Mapping[str, ModelStyle], mixed: bool) -> list[Line2D | Patch]:
    dots: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 3}
    handles: list[Line2D | Patch] = []
    if any(curve.held_out.any() for curve in curves):
        handles.append(Line2D([], [], color=BLACK, label="held out" if mixed else "measured", **dots))
    if mixed:
        handles.append(Line2D([], [], markerfacecolor="none", markeredgecolor=GREY, label="training", **dots))
    for model, style in styles.items():
        failed = not any(curve.predicted(model) for curve in curves)
        look: dict[str, Any] = {"linestyle": "none", "marker": "x"} if failed else {"linestyle": style.dashes}
        name = f"{title_of(model)} (failed)" if failed else model
        handles.append(Line2D([], [], color=style.colour, linewidth=style.width, label=name, **look))
    if any(curve.interval is not None for curve in curves):
        handles.append(interval_key(styles[curves[0].own].colour))
    return handles


def _worst_errors(curves: Sequence[CurveFit]) -> str:
    def worst(model: str) -> str:
        errors = np.concatenate([np.abs(curve.predictions[model] - curve.y)[curve.scored] for curve in curves])
        return f"largest error {np.nanmax(errors):.3g}" if np.isfinite(errors).any() else "no prediction"

    return ", ".join(f"{title_of(model)}: {worst(model)}" for model in curves[0].predictions)
