"""Draw a model of two inputs as coloured contours, and samples in the colours of their values."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.modelling.kinds import outside_range, predict
from mapmore_cli.reporting.figures.axis import levels_of
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.panels import DOTS, SOME_DOTS, colour_bar, evenly
from mapmore_cli.reporting.inputs import ReportInputs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CELLS, BISECTIONS = 61, 20
"""Number of grid points along each input, and number of bisections that find the edge of the
training range.
"""


class Plane(NamedTuple):
    """Two inputs of a model with their names and axis labels; the input that varies within a curve
    comes first. `x` and `y` are the values of these inputs at the samples of all curves, and `z` is
    the target there, (n,) each.
    """

    names: tuple[str, ...]
    labels: tuple[str, ...]
    x: Array
    y: Array
    z: Array


def plane_of(inputs: ReportInputs) -> Plane | None:
    """Return the two inputs of a model with their samples. Return None if the model has more or
    fewer inputs, if one of them was not measured or does not vary, or if curves are drawn over
    time.
    """
    pair = sorted(inputs.model.inputs, key=lambda quantity: quantity.name == inputs.dataset.level)
    names, curves = tuple(quantity.name for quantity in pair), inputs.dataset.curves
    measured = all(name in curve.columns for curve in curves for name in names)
    if inputs.timed or len(names) != 2 or not measured:
        return None
    x, y, z = map(inputs.pooled, (*names, inputs.dataset.target))
    if 0 in (np.ptp(x), np.ptp(y)):
        return None
    return Plane(names, tuple(map(inputs.axis_label, pair)), x, y, z)


class SurfaceGrid(NamedTuple):
    """Output of a model on a grid over its two inputs.

    - `across`, `up`, `output`: the two inputs and the output, (CELLS, CELLS) each. Each row of the
      grid covers the part of the row inside the training range. Outside this range, `output` is
      NaN.
    - `rows`: the samples that a panel shows.
    - `label`: axis label of the output.
    """

    plane: Plane
    across: Array
    up: Array
    output: Array
    rows: list[int]
    label: str

    def panel(self, draw: Callable[..., None]) -> Panel:
        """Return a panel that shows this surface; `draw` is the function that draws it."""
        x_label, y_label = self.plane.labels
        columns = (self.across.ravel(), self.up.ravel(), self.output.ravel())
        data = dict(zip((x_label, y_label, self.label), columns, strict=True))
        return Panel("", draw, x_label, (y_label,), data)

    @property
    def samples(self) -> tuple[Array, Array, Array]:
        """The samples that are drawn: both inputs and the target, (m,) each."""
        x, y, z = (values[self.rows] for values in self.plane[2:])
        return x, y, z


def sheet_of(inputs: ReportInputs) -> SurfaceGrid | None:
    """Return the output of a model over its two inputs. Return None if the model has more or fewer
    inputs, if the report shows another quantity than the output, or if no output is finite.
    """
    plane, model = plane_of(inputs), inputs.model
    if plane is None or inputs.dataset.target != model.output.name:
        return None

    def grid(across: Array, up: Array) -> dict[str, Array]:
        return dict(zip(plane.names, (across.ravel(), up.ravel()), strict=True))

    def beyond(across: Array, up: Array) -> BoolArray:
        return outside_range(model, grid(across, up)).reshape(across.shape)

    ends = (np.linspace(values.min(), values.max(), CELLS) for values in (plane.x, plane.y))
    across, up = np.meshgrid(*ends)
    across = _up_to_the_rim(across, up, beyond)
    output = np.where(
        beyond(across, up), np.nan, predict(model, grid(across, up)).reshape(up.shape)
    )
    if not np.isfinite(output).any():
        return None
    rows, label = evenly(len(plane.x), DOTS), inputs.axis_label(inputs.target)
    return SurfaceGrid(plane, across, up, output, rows, label)


Beyond = Callable[[Array, Array], BoolArray]
"""Function of the horizontal and vertical coordinates of points. It returns True for each point
outside the training range.
"""


def _up_to_the_rim(across: Array, up: Array, beyond: Beyond) -> Array:
    """Return new horizontal coordinates of a grid. In each row, the points are spread evenly over
    the part of the row that lies inside the training range.
    """
    inside = ~beyond(across, up)
    rows = np.flatnonzero(inside.any(axis=1))
    inside, x, y = inside[rows], across[rows], up[rows, 0]
    first, last = inside.argmax(axis=1), CELLS - 1 - inside[:, ::-1].argmax(axis=1)
    each = np.arange(len(rows))
    low = _rim(x[each, first], x[each, np.maximum(first - 1, 0)], y, beyond)
    high = _rim(x[each, last], x[each, np.minimum(last + 1, CELLS - 1)], y, beyond)
    stretched = across.copy()
    stretched[rows] = np.linspace(low, high, CELLS, axis=1)
    return stretched


def _rim(inner: Array, outer: Array, up: Array, beyond: Beyond) -> Array:
    """Return the edge of the training range in each row, found by bisection between a point inside
    the range (`inner`) and a point outside it (`outer`).
    """
    for _ in range(BISECTIONS):
        middle = (inner + outer) / 2
        out = beyond(middle, up)
        inner, outer = np.where(out, inner, middle), np.where(out, middle, outer)
    return inner


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return a figure with one panel if the model has two inputs, otherwise an empty list. The area
    outside the training range is left white.
    """
    sheet = sheet_of(inputs)
    if sheet is None:
        return []
    (x, y, z), output = sheet.samples, sheet.output

    def on(ax: Axes) -> None:
        every = [*sheet.plane.z, *output[np.isfinite(output)]]
        levels = np.array(levels_of(min(every), max(every), 12))
        filled = ax.contourf(sheet.across, sheet.up, output, levels=levels, cmap="viridis")
        look: dict[str, Any] = {"cmap": "viridis", "edgecolors": "white", "linewidths": 0.3}
        ax.scatter(x, y, 7, z, vmin=levels[0], vmax=levels[-1], **look)
        colour_bar(ax, filled, sheet.label)

    caption = (
        f"The model's {inputs.target.name} over {' and '.join(sheet.plane.names)}, within its "
        "training range; dots are samples in the colours of the measured values: the model is "
        "wrong at a dot that stands "
        f"out.{SOME_DOTS if len(sheet.rows) < len(sheet.plane.x) else ''}"
    )
    return [Drawing("surface", caption, (sheet.panel(on),), Layout(2.4))]
