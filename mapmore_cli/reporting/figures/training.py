"""All training curves in one pair of panels, with the run's own model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mapmore_cli.reporting.figures.drawing import Drawing
from mapmore_cli.reporting.figures.fit import FitPanel, fit_panel
from mapmore_cli.reporting.figures.panels import label_pair, pairs
from mapmore_cli.reporting.figures.style import (
    DOTS_A_CURVE,
    GREY,
    OWN_STYLE,
    SINGLE,
    axis_label,
    draw_band,
    level_colours,
    shortened,
    some_of,
    thinned,
    zero_line,
)
from mapmore_cli.reporting.figures.thinning import cloud, spread
from mapmore_cli.reporting.inputs import ReportInputs

MOST_CURVES = 10
LABEL_ROOM, LABEL_HEIGHT = 0.24, 0.06
"""What the name of a curve takes of the width and of the height of the panel."""


def training_panels(inputs: ReportInputs) -> list[FitPanel]:
    """The training samples of every curve that has some."""
    curves = inputs.dataset.curves
    return [fit_panel(inputs, i, ~curve.held_out) for i, curve in enumerate(curves) if not curve.held_out.all()]


def draw_training_curves(top: Axes, bottom: Axes, panels: Sequence[FitPanel], model: str) -> None:
    """Measured samples coloured by curve with the model's lines over them, and the errors in the same colours."""
    zero_line(bottom)
    for panel, colour in zip(panels, level_colours(len(panels)), strict=True):
        dots = cloud(panel.x, panel.y, DOTS_A_CURVE)
        top.plot(panel.x[dots], panel.y[dots], linestyle="none", marker="o", markersize=2.0, markeredgewidth=0, color=colour)
        if panel.predicted(model):
            predicted = panel.predictions[model]
            draw_band(top, panel.x, predicted, OWN_STYLE.colour, linewidth=1.1, zorder=3)
            draw_band(bottom, panel.x, predicted - panel.y, colour, linewidth=0.8)


def label_curves(ax: Axes, panels: Sequence[FitPanel]) -> None:
    """Write the names of the curves beside that end at which they lie further apart; a name that would cover another is left out."""
    colours = level_colours(len(panels))
    left, right = (np.array([panel.y[end] for panel in panels]) for end in (0, -1))
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
                shortened(panels[i].title, 14),
                (float(panels[i].x[end]), float(ends[i])),
                xytext=(-4 if at_left else 4, 0),
                textcoords="offset points",
                ha="right" if at_left else "left",
                va="center",
                fontsize=7,
                color=colours[i],
                annotation_clip=False,
            )


def training_figures(inputs: ReportInputs) -> list[Drawing]:
    """One figure for the training curves, or for some of them where they are many."""
    every = training_panels(inputs)
    panels = [every[i] for i in spread(len(every), MOST_CURVES)]
    if not panels:
        return []
    figure = Figure(figsize=(SINGLE, 3.4), layout="constrained")
    (pair,) = pairs(figure, 1, (2.2, 1.0))
    draw_training_curves(pair.top, pair.bottom, panels, inputs.own)
    label_curves(pair.top, panels)
    label_pair(pair, axis_label(inputs.in_curve), axis_label(inputs.target), f"Error ({inputs.target.unit})")
    figure.align_ylabels()
    dots = Line2D([], [], color=GREY, linestyle="none", marker="o", markersize=3, label="measured")
    line = Line2D([], [], color=OWN_STYLE.colour, linewidth=OWN_STYLE.width, label=inputs.own)
    figure.legend(handles=[dots, line], loc="outside upper left", ncols=2)
    caption = (
        f"The training curves with {inputs.own} above, its error (predicted minus measured) below."
        f"{thinned([len(panel.x) for panel in panels])}{some_of(len(panels), len(every), 'training curves')}"
    )
    spoken = ", ".join(panel.title for panel in panels)
    return [Drawing("fit_training", caption, f"Training curves {spoken}, with the predictions of {inputs.own} and their errors.", figure)]
