"""The model of two inputs as contours, with the samples on it in the same colours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.kinds import outside_range, predict
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel, Values
from mapmore_cli.reporting.figures.panels import DOT, DOTS, SOME_DOTS, evenly
from mapmore_cli.reporting.figures.style import BLACK
from mapmore_cli.reporting.inputs import ReportInputs

CELLS, STRIDE = 61, 4
"""Places along each input, and of how many of them the surface in space has one."""


def two_inputs(inputs: ReportInputs) -> tuple[Quantity, Quantity] | None:
    """Return the two inputs of a model that vary, that of a curve first; None where there are more,
    or fewer, or time plays a part.
    """
    curves, names = inputs.dataset.curves, [one.name for one in inputs.model.inputs]
    measured = all(name in curve.columns for curve in curves for name in names)
    if inputs.timed or len(names) != 2 or not measured:
        return None
    if any(np.ptp(column) == 0 for column in pooled_columns(inputs, names)):
        return None
    first, second = sorted(inputs.model.inputs, key=lambda one: one.name == inputs.dataset.level)
    return first, second


def pooled_columns(inputs: ReportInputs, names: Sequence[str]) -> list[Array]:
    """Return columns of all curves, (n,) each."""
    curves = inputs.dataset.curves
    return [np.concatenate([curve.columns[name] for curve in curves]) for name in names]


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return one panel where the model has two inputs; what lies beyond its training range is left
    white.
    """
    pair = two_inputs(inputs)
    if pair is None or inputs.dataset.target != inputs.model.output.name:
        return []
    first, second = pair
    x, y, z = pooled_columns(inputs, [first.name, second.name, inputs.dataset.target])
    rows = evenly(len(x), DOTS)
    ends = (np.linspace(values.min(), values.max(), CELLS) for values in (x, y))
    across, up = np.meshgrid(*ends)
    grid = {first.name: across.ravel(), second.name: up.ravel()}
    output = np.where(outside_range(inputs.model, grid), np.nan, predict(inputs.model, grid))
    if not np.isfinite(output).any():
        return []
    low, high = np.nanmin(output), np.nanmax(output)
    label = inputs.axis_label(inputs.target)

    def on(ax: Axes) -> None:
        levels = MaxNLocator(12).tick_values(min(low, z.min()), max(high, z.max()))
        filled = ax.contourf(
            across, up, output.reshape(across.shape), levels=levels, cmap="viridis"
        )
        look: dict[str, Any] = {"cmap": "viridis", "edgecolors": "white", "linewidths": 0.3}
        ax.scatter(x[rows], y[rows], 7, z[rows], vmin=levels[0], vmax=levels[-1], **look)
        ax.figure.colorbar(filled, ax=ax, label=label, use_gridspec=False)

    x_label, y_label = inputs.axis_label(first), inputs.axis_label(second)
    data: dict[str, Values] = {x_label: across.ravel(), y_label: up.ravel(), label: output}
    caption = (
        f"The model's {inputs.target.name} over {first.name} and {second.name}, within its "
        "training range; dots are samples in the colours "
        "of what was measured: one that stands out is not "
        f"met.{SOME_DOTS if len(rows) < len(x) else ''}"
    )

    def on_space(ax: Any) -> None:
        shown = output.reshape(across.shape)[::STRIDE, ::STRIDE]
        places = (across[::STRIDE, ::STRIDE], up[::STRIDE, ::STRIDE])
        ax.plot_surface(*places, shown, cmap="viridis", rstride=1, cstride=1, antialiased=False)
        ax.plot(x[rows], y[rows], z[rows], color=BLACK, **DOT | {"markersize": 1.2})
        ax.set_zlabel(label)
        ax.view_init(elev=28, azim=-60)

    flat, space = (Panel("", draw, x_label, (y_label,), data) for draw in (on, on_space))
    shape = Layout(2.6, projection="3d")
    above = f"The same in space, with samples as dots: {inputs.target.name} upwards."
    return [
        Drawing("surface", caption, (flat,), Layout(2.4)),
        Drawing("surface_3d", above, (space,), shape),
    ]
