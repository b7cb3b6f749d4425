"""The model of two inputs as contours, with the samples on it in the same colours."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.kinds import outside_range, predict
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.panels import DOT, DOTS, SOME_DOTS, evenly
from mapmore_cli.reporting.figures.style import BLACK
from mapmore_cli.reporting.inputs import ReportInputs

CELLS, STRIDE = 61, 4
"""Places along each input, and of how many of them the surface in space has one."""


class Plane(NamedTuple):
    """The two inputs of a model, that of a curve first: their names and the labels of their axes;
    and the samples of all curves, (n,) each, with the target as `z`.
    """

    names: tuple[str, ...]
    labels: tuple[str, ...]
    x: Array
    y: Array
    z: Array


def plane_of(inputs: ReportInputs) -> Plane | None:
    """Return the plane of a model of two inputs that vary; None where there are more, or fewer, or
    time plays a part.
    """
    pair = sorted(inputs.model.inputs, key=lambda one: one.name == inputs.dataset.level)
    names, curves = tuple(one.name for one in pair), inputs.dataset.curves
    measured = all(name in curve.columns for curve in curves for name in names)
    if inputs.timed or len(names) != 2 or not measured:
        return None
    x, y, z = map(inputs.pooled, (*names, inputs.dataset.target))
    if 0 in (np.ptp(x), np.ptp(y)):
        return None
    return Plane(names, tuple(map(inputs.axis_label, pair)), x, y, z)


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return one panel where the model has two inputs, and the same in space; what lies beyond its
    training range is left white.
    """
    plane = plane_of(inputs)
    if plane is None or inputs.dataset.target != inputs.model.output.name:
        return []
    rows = evenly(len(plane.x), DOTS)
    x, y, z = (values[rows] for values in plane[2:])
    ends = (np.linspace(values.min(), values.max(), CELLS) for values in (plane.x, plane.y))
    across, up = np.meshgrid(*ends)
    grid = dict(zip(plane.names, (across.ravel(), up.ravel()), strict=True))
    output = np.where(outside_range(inputs.model, grid), np.nan, predict(inputs.model, grid))
    if not np.isfinite(output).any():
        return []
    label = inputs.axis_label(inputs.target)
    shown = output.reshape(across.shape)

    def on(ax: Axes) -> None:
        every = [*plane.z, *output[np.isfinite(output)]]
        levels = MaxNLocator(12).tick_values(min(every), max(every))
        filled = ax.contourf(across, up, shown, levels=levels, cmap="viridis")
        look: dict[str, Any] = {"cmap": "viridis", "edgecolors": "white", "linewidths": 0.3}
        ax.scatter(x, y, 7, z, vmin=levels[0], vmax=levels[-1], **look)
        ax.figure.colorbar(filled, ax=ax, label=label, use_gridspec=False)

    def in_space(ax: Any) -> None:
        places = (values[::STRIDE, ::STRIDE] for values in (across, up, shown))
        ax.plot_surface(*places, cmap="viridis", rstride=1, cstride=1, antialiased=False)
        ax.plot(x, y, z, color=BLACK, **DOT | {"markersize": 1.2})
        ax.set_zlabel(label)
        ax.view_init(elev=28, azim=-60)

    x_label, y_label = plane.labels
    data = {x_label: across.ravel(), y_label: up.ravel(), label: output}
    flat, space = (Panel("", draw, x_label, (y_label,), data) for draw in (on, in_space))
    target, over = inputs.target.name, " and ".join(plane.names)
    caption = (
        f"The model's {target} over {over}, within its "
        "training range; dots are samples in the colours "
        "of what was measured: one that stands out is not "
        f"met.{SOME_DOTS if len(rows) < len(plane.x) else ''}"
    )
    above = f"The same in space, with samples as dots: {target} upwards."
    return [
        Drawing("surface", caption, (flat,), Layout(2.4)),
        Drawing("surface_3d", above, (space,), Layout(2.6, projection="3d")),
    ]
