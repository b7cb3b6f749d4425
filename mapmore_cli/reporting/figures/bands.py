"""Draw the errors of models in bands of the measured value, to show how good the models are at
small values.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.panels import looks_of, plain_logarithm, told_apart
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import title_of
from mapmore_cli.reporting.tables import bands_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return one figure with a line for each model: its RMSE in each band of the measured value.
    The axis of the RMSE is logarithmic if the errors differ by more than a factor of 20.
    """
    sizes, unit = inputs.validation.bands, inputs.target.unit
    models = [model for model in inputs.lines if model not in inputs.failed]
    if len(sizes) < 2 or not models:
        return []
    looks, names = looks_of(inputs), told_apart([*map(title_of, models)], 24)
    errors = {model: np.array([band.rmse[model] for band in sizes]) for model in models}
    positive = [x for line in errors.values() for x in line if np.isfinite(x) and x > 0]

    def on(ax: Axes) -> None:
        for name, (model, line) in zip(names, errors.items(), strict=True):
            look = looks[model]
            ax.plot(line, marker=look.marker, markersize=3, label=name, **look.line)
        if positive and max(positive) > 20 * min(positive):
            plain_logarithm(ax, "y", (1.0, 2.0, 5.0))
        else:
            ax.set_ylim(0, 1.05 * max(positive, default=1.0))
        ends = [f"{_short(band.low)}\N{EN DASH}{_short(band.high)}" for band in sizes]
        ax.set_xticks(range(len(sizes)), ends)
        ax.set_xlim(-0.3, len(sizes) - 0.7)

    table = bands_table(sizes, unit)
    data = dict(zip(table.headings, zip(*table.rows, strict=True), strict=True))
    label = inputs.axis_label(inputs.target, "absolute value of measured")
    caption = (
        "Root mean square error in bands of the absolute measured value, of held-out data if "
        "there are any."
    )
    panel = Panel("", on, label, (f"RMSE ({unit})",), data)
    return [Drawing("bands", caption, (panel,), Layout(2.3))]


def _short(value: float) -> str:
    """Return a positive number or zero as text with three significant digits. A number from 1000
    to 100 000 is rounded to an integer.
    """
    return f"{value:.0f}" if 1000 <= value < 1e5 else f"{value:.3g}"
