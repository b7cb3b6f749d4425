"""Held-out curves with fit and error panels, as M2's figures 9 and 10."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.reporting.figures.drawing import Drawing
from mapmore_cli.reporting.figures.panels import Pair, columns_for, label_pair, pairs, width_for
from mapmore_cli.reporting.figures.style import (
    BLACK,
    DOTS_A_CURVE,
    GREY,
    ModelStyle,
    axis_label,
    best_of,
    beyond_scale,
    draw_band,
    hold_scale,
    model_styles,
    shortened,
    some_of,
    thinned,
    zero_line,
)
from mapmore_cli.reporting.figures.thinning import cloud, spread
from mapmore_cli.reporting.inputs import ReportInputs

MOST_PANELS = 9
MOST_SPANS = 6


@dataclass(frozen=True)
class FitPanel:
    """One curve in the order of the in-curve quantity: measured `y` over `x`, and every model's prediction, each `(n,)`."""

    title: str
    x: Array
    y: Array
    held_out: BoolArray
    predictions: Mapping[str, Array]

    def predicted(self, model: str) -> bool:
        """False where the model gave no prediction, because its fit failed."""
        return bool(np.isfinite(self.predictions[model]).any())


def fit_panel(inputs: ReportInputs, number: int, rows: BoolArray | None = None) -> FitPanel:
    """Curve `number` of the dataset, or only some of its rows."""
    curve = inputs.dataset.curves[number]
    x = curve.columns[inputs.in_curve.name]
    order = np.argsort(x, kind="stable")
    if rows is not None:
        order = order[rows[order]]
    predictions = {model: inputs.validation.predictions[model][number][order] for model in inputs.lines}
    return FitPanel(inputs.curve_label(curve), x[order], curve.columns[inputs.dataset.target][order], curve.held_out[order], predictions)


def held_out_spans(x: Array, held_out: BoolArray) -> list[tuple[float, float]]:
    """Runs of held-out samples along sorted `x` as (start, end), each reaching halfway to the neighbouring training samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held_out, [False]]).astype(int)))
    middle = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2, x[-1:]])
    return [(float(middle[start]), float(middle[end])) for start, end in edges.reshape(-1, 2)]


def draw_fit(ax: Axes, panel: FitPanel, styles: Mapping[str, ModelStyle]) -> None:
    """Measured samples as dots, filled where held out, and every model as a line. A model without prediction draws nothing."""
    for rows, face, edge in ((~panel.held_out, "none", GREY), (panel.held_out, BLACK, BLACK)):
        if rows.any():
            dots = np.flatnonzero(rows)[cloud(panel.x[rows], panel.y[rows], DOTS_A_CURVE)]
            look: dict[str, Any] = {"markersize": 2.2, "markeredgewidth": 0.5, "markerfacecolor": face, "markeredgecolor": edge}
            ax.plot(panel.x[dots], panel.y[dots], linestyle="none", marker="o", zorder=2, **look)
    _draw_models(ax, panel.x, {model: values for model, values in panel.predictions.items() if panel.predicted(model)}, styles)


def draw_error(ax: Axes, panel: FitPanel, styles: Mapping[str, ModelStyle]) -> None:
    """Predicted minus measured, one line a model."""
    zero_line(ax)
    errors = {model: values - panel.y for model, values in panel.predictions.items() if panel.predicted(model)}
    _draw_models(ax, panel.x, errors, styles)


def _draw_models(ax: Axes, x: Array, lines: Mapping[str, Array], styles: Mapping[str, ModelStyle]) -> None:
    for model, values in lines.items():
        style = styles[model]
        draw_band(ax, x, values, style.colour, linestyle=style.dashes, linewidth=style.width, zorder=style.zorder, label=model)


def mark_held_out(ax: Axes, panel: FitPanel) -> None:
    """Shade the held-out regions of a curve that has training samples too; scattered ones are told by their dots alone."""
    spans = held_out_spans(panel.x, panel.held_out)
    if not panel.held_out.all() and len(spans) <= MOST_SPANS:
        for start, end in spans:
            ax.axvspan(start, end, color="#f0f0f0", zorder=-1, linewidth=0)


def fit_figures(inputs: ReportInputs) -> list[Drawing]:
    """One pair of panels a curve that has held-out samples; no figure where nothing was held out."""
    numbers = [i for i, curve in enumerate(inputs.dataset.curves) if curve.held_out.any()]
    panels = [fit_panel(inputs, numbers[i]) for i in spread(len(numbers), MOST_PANELS)]
    if not panels:
        return []
    styles = model_styles(inputs.lines)
    far_off = [model for model in inputs.far_off if model in inputs.lines]
    rows = math.ceil(len(panels) / columns_for(len(panels)))
    figure = Figure(figsize=(width_for(len(panels)), 0.45 + 2.65 * rows), layout="constrained")
    drawn = list(zip(pairs(figure, len(panels), (2.0, 1.0)), panels, strict=True))
    for pair, panel in drawn:
        _draw_pair(pair, panel, styles)
        label_pair(pair, axis_label(inputs.in_curve), axis_label(inputs.target), f"Error ({inputs.target.unit})")
    if far_off:
        _hold_rows(drawn, far_off)
    figure.align_ylabels()
    mixed = any(not panel.held_out.all() for panel in panels)
    figure.legend(handles=_legend(panels, styles, mixed), loc="outside upper left", ncols=2 if len(panels) == 1 else 6)
    what = f"Measured and predicted {inputs.target.name}"
    marked = " Filled dots and grey bands mark held-out samples, open dots training samples." if mixed else ""
    left_out = some_of(len(panels), len(numbers), "curves with held-out samples") + best_of(len(styles), len(inputs.models))
    shown = f"{thinned([len(panel.x) for panel in panels])}{left_out}{beyond_scale(far_off)}"
    caption = f"{what} of the held-out curves above, predicted minus measured below.{marked}{shown}"
    return [Drawing("fit", caption, f"{what} over {inputs.in_curve.name}: {_worst_errors(panels)}.", figure)]


def _hold_rows(drawn: Sequence[tuple[Pair, FitPanel]], far_off: Sequence[str]) -> None:
    """Scale every row of panels, whose y axes are common, to what was measured and to the models that are not far off."""
    columns = columns_for(len(drawn))
    for start in range(0, len(drawn), columns):
        row = drawn[start : start + columns]
        near = [(panel, values) for _, panel in row for model, values in panel.predictions.items() if model not in far_off]
        hold_scale(row[0][0].top, [*(panel.y for _, panel in row), *(values for _, values in near)])
        hold_scale(row[0][0].bottom, [values - panel.y for panel, values in near])


def _draw_pair(pair: Pair, panel: FitPanel, styles: Mapping[str, ModelStyle]) -> None:
    for ax, draw in ((pair.top, draw_fit), (pair.bottom, draw_error)):
        mark_held_out(ax, panel)
        draw(ax, panel, styles)
    pair.top.set_title(shortened(panel.title, 34))


def _legend(panels: Sequence[FitPanel], styles: Mapping[str, ModelStyle], mixed: bool) -> list[Line2D]:
    dots: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 3}
    handles = [Line2D([], [], color=BLACK, label="held out" if mixed else "measured", **dots)]
    if mixed:
        handles.append(Line2D([], [], markerfacecolor="none", markeredgecolor=GREY, label="training", **dots))
    for model, style in styles.items():
        failed = not any(panel.predicted(model) for panel in panels)
        look: dict[str, Any] = {"linestyle": "none", "marker": "x"} if failed else {"linestyle": style.dashes}
        name = f"{model} (failed)" if failed else model
        handles.append(Line2D([], [], color=style.colour, linewidth=style.width, label=name, **look))
    return handles


def _worst_errors(panels: Sequence[FitPanel]) -> str:
    def worst(model: str) -> str:
        errors = np.concatenate([np.abs(panel.predictions[model] - panel.y)[panel.held_out] for panel in panels])
        return f"largest error {np.nanmax(errors):.3g}" if np.isfinite(errors).any() else "no prediction"

    return ", ".join(f"{model}: {worst(model)}" for model in panels[0].predictions)
