"""The errors of the model over two inputs: where it is too high, and where too low."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm
from matplotlib.ticker import MaxNLocator

from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.surface import samples_of, two_inputs
from mapmore_cli.reporting.inputs import ReportInputs

STEPS = 11
"""Of the colours, about."""


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return one panel where the model has two inputs; samples that were held out are larger and
    rimmed.
    """
    pair = two_inputs(inputs)
    if pair is None:
        return []
    first, second = pair
    (x, y, z), rows = samples_of(inputs, [first.name, second.name, inputs.dataset.target])
    error = np.concatenate([*inputs.validation.predictions[inputs.own]]) - z
    held = np.concatenate([curve.held_out for curve in inputs.dataset.curves])
    rows = rows[np.isfinite(error[rows])]
    if not len(rows):
        return []
    largest = float(np.quantile(np.abs(error[rows]), 0.98)) or 1.0
    label = f"Predicted less measured ({inputs.target.unit or '–'})"

    def on(axes: Sequence[Axes]) -> None:
        (ax,) = axes
        norm = BoundaryNorm(
            MaxNLocator(STEPS, symmetric=True).tick_values(-largest, largest), 256, extend="both"
        )
        for out in (False, True):
            own = rows[held[rows] == out]
            rim = {"edgecolors": "0.3", "linewidths": 0.3} if out else {"edgecolors": "none"}
            dots = ax.scatter(
                x[own], y[own], c=error[own], s=16 if out else 8, cmap="RdBu_r", norm=norm, **rim
            )
        ax.figure.colorbar(dots, ax=ax, label=label, use_gridspec=False)

    x_label, y_label = inputs.axis_label(first), inputs.axis_label(second)
    data: dict[str, Values] = {
        x_label: x[rows],
        y_label: y[rows],
        label: error[rows],
        "held out": held[rows].astype(int),
    }
    rimmed = "; those with a rim were held out" if held.any() else ""
    caption = (
        f"Errors of {inputs.own} over its inputs{rimmed}. Patches of one colour are a shape "
        "that the model misses."
    )
    alt = (
        f"Errors from {error[rows].min():.3g} to {error[rows].max():.3g} {inputs.target.unit} "
        f"over {first.name} and {second.name}."
    )
    return [
        Drawing(
            "residual_map",
            caption,
            alt,
            (Panel("", on, x_label, (y_label,), data),),
            Grid(height=2.4),
        )
    ]
