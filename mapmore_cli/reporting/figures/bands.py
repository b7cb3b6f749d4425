"""Errors by the size of what was measured, in bands: how good a model is where little is pulled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.domain.results import ErrorBand
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.panels import key, plain_logarithm, told_apart
from mapmore_cli.reporting.figures.style import ModelStyle, model_styles
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import title_of
from mapmore_cli.reporting.tables import bands_table


def draw(inputs: ReportInputs) -> list[Drawing]:
    """One figure for all models that lines are drawn of."""
    sizes = inputs.validation.bands
    looks = {
        model: look
        for model, look in model_styles(inputs.lines, inputs.style.palette).items()
        if model not in inputs.failed
    }
    if len(sizes) < 2 or not looks:
        return []
    table, unit = bands_table(sizes, ""), inputs.target.unit
    data = dict(zip(table.headings, zip(*table.rows, strict=True), strict=True))
    label = inputs.axis_label(inputs.target, "absolute value of measured")
    panel = Panel(
        "", partial(draw_bands, sizes=sizes, looks=looks), label, (f"RMSE ({unit})",), data
    )
    names = told_apart([title_of(model) for model in looks], 24)
    handles = [
        key(name, marker=look.marker, markersize=3, **look.line)
        for name, look in zip(names, looks.values(), strict=True)
    ]
    caption = (
        "Root mean square error by the size of what was measured, of held-out data where "
        "there are any."
    )
    return [Drawing("bands", caption, (panel,), Layout(2.3), handles)]


def draw_bands(ax: Axes, sizes: Sequence[ErrorBand], looks: Mapping[str, ModelStyle]) -> None:
    """Draw a line for each model over the bands, on a logarithmic scale where the errors differ
    much.
    """
    errors = np.array([[band.rmse[model] for band in sizes] for model in looks])
    for values, look in zip(errors, looks.values(), strict=True):
        ax.plot(values, marker=look.marker, markersize=3, **look.line)
    positive = errors[np.isfinite(errors) & (errors > 0)]
    if len(positive) and positive.max() > 20 * positive.min():
        plain_logarithm(ax.yaxis, (1.0, 2.0, 5.0))
    else:
        ax.set_ylim(bottom=0)
    names = [f"{_short(band.low)}\N{EN DASH}{_short(band.high)}" for band in sizes]
    ax.set_xticks(range(len(sizes)), names)
    ax.set_xlim(-0.3, len(sizes) - 0.7)


def _short(value: float) -> str:
    """Three digits, and all that stand before the point of what is not long."""
    return f"{value:.0f}" if 1000 <= abs(value) < 1e5 else f"{value:.3g}"
