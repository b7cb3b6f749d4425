"""Draw the errors of the model over two inputs, to show where the output is too high or too low."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mapmore_cli.reporting.figures.axis import levels_of
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.panels import DOTS, colour_bar, evenly
from mapmore_cli.reporting.figures.surface import plane_of
from mapmore_cli.reporting.inputs import ReportInputs

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return a figure with one panel if the model has two inputs, otherwise an empty list. Dots of
    held-out samples are larger and have a dark outline.
    """
    plane = plane_of(inputs)
    if plane is None:
        return []
    error = inputs.errors_of(inputs.own)
    rows = np.flatnonzero(np.isfinite(error))
    if not len(rows):
        return []
    rows = rows[evenly(len(rows), 2 * DOTS)]
    x, y, error = (values[rows] for values in (plane.x, plane.y, error))
    held = inputs.pooled_held_out[rows]
    largest = float(np.quantile(np.abs(error), 0.98)) or 1.0
    label = f"Predicted less measured ({inputs.target.unit or '–'})"

    def on(ax: Axes) -> None:
        look: dict[str, Any] = {"vmin": -largest, "vmax": largest, "cmap": "RdBu_r"}
        look["linewidths"] = 0.3
        for some, size, rim in ((~held, 8, "none"), (held, 16, "0.3")):
            dots = ax.scatter(x[some], y[some], size, error[some], edgecolors=rim, **look)
        colour_bar(ax, dots, label, boundaries=levels_of(-largest, largest, 11))

    x_label, y_label = plane.labels
    data = {x_label: x, y_label: y, label: error, "held out": held.astype(int)}
    rimmed = "; those with a rim were held out" if held.any() else ""
    caption = (
        f"Errors of {inputs.own} over its inputs{rimmed}. A patch of one colour shows a shape "
        "that the model does not describe."
    )
    panel = Panel("", on, x_label, (y_label,), data)
    return [Drawing("residual_map", caption, (panel,), Layout(2.4))]
