"""Draw how a muscle changes over several campaigns (for `mapmore compare`), and draw a single model
(for notebooks).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mapmore_cli.domain.arrays import Columns
from mapmore_cli.domain.models import Formula, Model, Pieces
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.validation.comparison import ReferencePoint
from mapmore_cli.modelling.validation.intervals import half_widths_of
from mapmore_cli.modelling.validation.shown import varying_input
from mapmore_cli.reporting.figures import panels, style
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HELD_OUT: dict[str, Any] = panels.DOT | {"markersize": 2, "color": style.GREY, "zorder": 0}

POINTS = 201


def drift_drawing(
    names: Sequence[str], points: Sequence[ReferencePoint], output: Quantity
) -> Drawing:
    """Return the figure of the drift: a line for each reference point, with a dot for each
    campaign. A dot is the output of the model in per cent of the output in the first campaign.
    """

    def on(ax: Axes) -> None:
        for point, colour in zip(points, style.level_colours(len(points)), strict=True):
            label = ", ".join(f"{name} {value:.3g}" for name, value in point.inputs.items())
            per_cent = [100 * value / point.outputs[0] for value in point.outputs]
            ax.plot(per_cent, color=colour, marker="o", markersize=3, label=label)
        ax.set_xticks(range(len(names)), panels.told_apart(names, 22))

    axis_label = style.PLAIN.axis_label(Quantity(output.name, "% of the first"))
    caption = f"{output.name} at reference points over campaigns, in per cent of the first."
    return Drawing("drift", caption, (Panel("", on, "Campaign", (axis_label,)),), Layout(2.6))


def draw_model(ax: Axes, model: Model, level: float | None, held_out: Sequence[Curve]) -> None:
    """Draw the model for every training curve as a line over the input that varies most within it.
    The other inputs are in the middle of their ranges. For each of the `held_out` curves, draw the
    samples as dots, and the model at these samples as a dashed line.

    If `level` is given, for example 0.95, draw the prediction interval with this probability around
    each line as a band.

    Raises TypeError for a model without training curves: a model with memory, or a sum of models.
    """
    if not isinstance(model.body, Pieces | Formula):
        raise TypeError(
            f"{model.name} has no curves to draw; call it with a recording, and "
            "draw what it returns"
        )
    ranges = model.body.ranges
    along = varying_input(model, [curve_range.limits for curve_range in ranges])
    colours = iter(style.level_colours(len(ranges) + len(held_out)))

    def line(columns: Columns, label: str, dashes: str) -> None:
        x, y, colour = columns[along], predict(model, columns), next(colours)
        ax.plot(x, y, dashes, color=colour, label=label)
        if level is not None:
            half = half_widths_of(model, columns, level)
            panels.shade_between(ax, x, (y - half, y + half), colour)

    for curve_range in ranges:
        columns = {
            name: np.full(POINTS, sum(ends) / 2) for name, ends in curve_range.limits.items()
        }
        if model.level is not None and curve_range.level is not None:
            columns[model.level] = np.full(POINTS, curve_range.level)
        line(
            columns | {along: np.linspace(*curve_range.limits[along], POINTS)},
            curve_range.curve,
            "-",
        )
    for curve in held_out:
        ordered = curve.at(np.argsort(curve.columns[along], kind="stable")).columns
        line(ordered, f"{curve.id}, held out", "--")
        ax.plot(ordered[along], ordered[model.output.name], **HELD_OUT)
    quantity = next(quantity for quantity in model.inputs if quantity.name == along)
    ax.set_xlabel(style.PLAIN.axis_label(quantity))
    ax.set_ylabel(style.PLAIN.axis_label(model.output))
    ax.legend()
