"""The errors of the model over two inputs: where it is too high, and where too low."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm
from matplotlib.ticker import MaxNLocator

from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.panels import DOTS, evenly
from mapmore_cli.reporting.figures.surface import plane_of
from mapmore_cli.reporting.inputs import ReportInputs


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return one panel where the model has two inputs; samples that were held out are larger and
    rimmed.
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
        steps = MaxNLocator(11, symmetric=True).tick_values(-largest, largest)
        norm = BoundaryNorm(steps, 256, extend="both")
        look: dict[str, Any] = {"norm": norm, "cmap": "RdBu_r", "linewidths": 0.3}
        for some, size, rim in ((~held, 8, "none"), (held, 16, "0.3")):
            dots = ax.scatter(x[some], y[some], size, error[some], edgecolors=rim, **look)
        ax.figure.colorbar(dots, ax=ax, label=label, use_gridspec=False)

    x_label, y_label = plane.labels
    data = {x_label: x, y_label: y, label: error, "held out": held.astype(int)}
    rimmed = "; those with a rim were held out" if held.any() else ""
    caption = (
        f"Errors of {inputs.own} over its inputs{rimmed}. Patches of one colour are a shape "
        "that the model misses."
    )
    panel = Panel("", on, x_label, (y_label,), data)
    return [Drawing("residual_map", caption, (panel,), Layout(2.4))]
