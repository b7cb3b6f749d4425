"""Draw a model of two inputs as a surface in space, with samples as dots."""

from __future__ import annotations

from typing import Any

from mapmore_cli.reporting.figures.drawing import Drawing, Layout
from mapmore_cli.reporting.figures.panels import DOT
from mapmore_cli.reporting.figures.style import BLACK
from mapmore_cli.reporting.figures.surface import sheet_of
from mapmore_cli.reporting.inputs import ReportInputs

STRIDE = 4
"""The surface is drawn through every fourth point of the grid, along each input."""


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return a figure with one panel if the model has two inputs, otherwise an empty list."""
    sheet = sheet_of(inputs)
    if sheet is None:
        return []

    def on(ax: Any) -> None:
        places = (values[::STRIDE, ::STRIDE] for values in (sheet.across, sheet.up, sheet.output))
        ax.plot_surface(*places, cmap="viridis", rstride=1, cstride=1, antialiased=False)
        ax.plot(*sheet.samples, color=BLACK, **DOT | {"markersize": 1.2})
        ax.set_zlabel(sheet.label)
        ax.view_init(elev=28, azim=-60)

    target, over = inputs.target.name, " and ".join(sheet.plane.names)
    caption = f"The model's {target} over {over} in space, with samples as dots: {target} upwards."
    layout = Layout(2.6, projection="3d")
    return [Drawing("surface_3d", caption, (sheet.panel(on),), layout)]
