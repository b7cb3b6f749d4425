"""All training curves in one panel, with the run's own model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mapmore_cli.reporting.figures.curves import CurveFit, curve_fit
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import (
    DOTS_A_CURVE,
    GREY,
    draw_band,
    level_colours,
    model_styles,
    shortened,
    small,
    some_of,
    thinned,
    zero_line,
)
from mapmore_cli.reporting.figures.thinning import cloud, spread
from mapmore_cli.reporting.inputs import ReportInputs

MOST_CURVES = 10
LABEL_ROOM, LABEL_HEIGHT = 0.24, 0.06
"""What the name of a curve takes of the width and of the height of the panel."""


def training_curve_fits(inputs: ReportInputs) -> list[CurveFit]:
    """Return the training samples of every curve that has some."""
    curves = inputs.dataset.curves
    return [curve_fit(inputs, i, ~curve.held_out) for i, curve in enumerate(curves) if not curve.held_out.all()]


def draw_training_curves(top: Axes, bottom: Axes, curves: Sequence[CurveFit], model: str, own_colour: str) -> None:
    """Draw measured samples coloured by curve with the model's lines over them, and the errors in the same colours."""
    zero_line(bottom)
    for curve, colour in zip(curves, level_colours(len(curves)), strict=True):
        dots = cloud(curve.x, curve.y, DOTS_A_CURVE)
        top.plot(curve.x[dots], curve.y[dots], linestyle="none", marker="o", markersize=2.0, markeredgewidth=0, color=colour)
        if curve.predicted(model):
            predicted = curve.predictions[model]
            draw_band(top, curve.x, predicted, own_colour, linewidth=1.1, zorder=3)
            draw_band(bottom, curve.x, predicted - curve.y, colour, linewidth=0.8)


def label_curves(ax: Axes, curves: Sequence[CurveFit]) -> None:
    """Write the names of the curves beside that end at which they lie further apart; a name that would cover another is left out."""
    colours = level_colours(len(curves))
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
            ax.annotate(
                shortened(curves[i].title, 14),
                (float(curves[i].x[end]), float(ends[i])),
                xytext=(-4 if at_left else 4, 0),
                textcoords="offset points",
                ha="right" if at_left else "left",
                va="center",
                fontsize=small(),
                color=colours[i],
                annotation_clip=False,
            )


def training_figures(inputs: ReportInputs) -> list[Drawing]:
    """One figure for the training curves, or for some of them where they are many."""
    every = training_curve_fits(inputs)
    curves = [every[i] for i in spread(len(every), MOST_CURVES)]
    if not curves:
        return []
    look = model_styles([inputs.own], inputs.style.palette)[inputs.own]

    def on(axes: Sequence[Axes]) -> None:
        draw_training_curves(axes[0], axes[1], curves, inputs.own, look.colour)
        label_curves(axes[0], curves)

    labels = (inputs.axis_label(inputs.target), f"Error ({inputs.target.unit})")
    panel = Panel("", on, inputs.axis_label(inputs.in_curve), labels, _data(inputs, curves))
    dots = Line2D([], [], color=GREY, linestyle="none", marker="o", markersize=3, label="measured")
    line = Line2D([], [], color=look.colour, linewidth=look.width, label=inputs.own)
    caption = (
        f"The training curves with {inputs.own} above, its error (predicted minus measured) below."
        f"{thinned([len(curve.x) for curve in curves])}{some_of(len(curves), len(every), 'training curves')}"
    )
    spoken = ", ".join(curve.title for curve in curves)
    alt = f"Training curves {spoken}, with the predictions of {inputs.own} and their errors."
    return [Drawing("fit_training", caption, alt, (panel,), Grid(height=2.95, stack=(2.2, 1.0)), (dots, line))]


def _data(inputs: ReportInputs, curves: Sequence[CurveFit]) -> dict[str, Values]:
    unit, along = inputs.target.unit, inputs.in_curve
    return {
        "curve": [curve.title for curve in curves for _ in curve.x],
        f"{along.name} [{along.unit}]": np.concatenate([curve.x for curve in curves]),
        f"{inputs.target.name} [{unit}]": np.concatenate([curve.y for curve in curves]),
        f"{inputs.own} [{unit}]": np.concatenate([curve.predictions[inputs.own] for curve in curves]),
    }
