"""The model of two inputs as contours, with the samples on it in the same colours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.kinds import outside_range, predict
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import SOME_DOTS, spread
from mapmore_cli.reporting.inputs import ReportInputs

CELLS = 60
"""Along each input."""

CONTOURS = 12
MOST_DOTS = 300


def two_inputs(inputs: ReportInputs) -> tuple[Quantity, Quantity] | None:
    """Return the two inputs of a model that vary, that of a curve first; None where there are more,
    or fewer, or time plays a part.
    """
    if inputs.has_memory or inputs.over_time:
        return None
    varied = [
        one
        for one in inputs.model.inputs
        if all(one.name in curve.columns for curve in inputs.dataset.curves)
    ]
    varied = [
        one
        for one in varied
        if np.ptp(np.concatenate([curve.columns[one.name] for curve in inputs.dataset.curves])) > 0
    ]
    if len(varied) != 2 or len(varied) != len(inputs.model.inputs):
        return None
    first, second = sorted(varied, key=lambda one: one.name == inputs.dataset.level)
    return first, second


def samples_of(inputs: ReportInputs, names: Sequence[str]) -> tuple[list[Array], Array]:
    """Return columns of all curves, (n,) each, and the rows of an even share of them."""
    columns = [
        np.concatenate([curve.columns[name] for curve in inputs.dataset.curves]) for name in names
    ]
    return columns, np.array(spread(len(columns[0]), MOST_DOTS))


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return one panel where the model has two inputs; what lies beyond its training range is left
    white.
    """
    pair = two_inputs(inputs)
    if pair is None or inputs.dataset.target != inputs.model.output.name:
        return []
    first, second = pair
    (x, y, z), rows = samples_of(inputs, [first.name, second.name, inputs.dataset.target])
    across, up = np.meshgrid(
        np.linspace(x.min(), x.max(), CELLS), np.linspace(y.min(), y.max(), CELLS)
    )
    grid = {first.name: across.ravel(), second.name: up.ravel()}
    said = np.where(outside_range(inputs.model, grid), np.nan, predict(inputs.model, grid)).reshape(
        across.shape
    )
    if not np.isfinite(said).any():
        return []
    label = inputs.axis_label(inputs.target)

    def on(axes: Sequence[Axes]) -> None:
        (ax,) = axes
        limits = MaxNLocator(CONTOURS).tick_values(
            min(np.nanmin(said), z.min()), max(np.nanmax(said), z.max())
        )
        filled = ax.contourf(across, up, said, levels=limits, cmap="viridis")
        ax.scatter(
            x[rows],
            y[rows],
            c=z[rows],
            s=7,
            cmap="viridis",
            vmin=limits[0],
            vmax=limits[-1],
            edgecolors="white",
            linewidths=0.3,
        )
        ax.figure.colorbar(filled, ax=ax, label=label, use_gridspec=False)

    x_label, y_label = inputs.axis_label(first), inputs.axis_label(second)
    data: dict[str, Values] = {x_label: across.ravel(), y_label: up.ravel(), label: said.ravel()}
    caption = (
        f"The model's {inputs.target.name} over {first.name} and {second.name}, within its "
        "training range; dots are samples in the colours "
        "of what was measured: one that stands out is not "
        f"met.{SOME_DOTS if len(rows) < len(x) else ''}"
    )
    alt = (
        f"Contours of {inputs.target.name} from {np.nanmin(said):.4g} to "
        f"{np.nanmax(said):.4g} {inputs.target.unit}."
    )
    return [
        Drawing(
            "surface", caption, alt, (Panel("", on, x_label, (y_label,), data),), Grid(height=2.4)
        )
    ]
