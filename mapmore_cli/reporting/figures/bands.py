"""Errors by the size of what was measured, in bands: how good a model is where little is pulled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from mapmore_cli.modelling.validation.metrics import Band, bands
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import ModelStyle, model_styles, shortened
from mapmore_cli.reporting.inputs import SINGLE, ReportInputs
from mapmore_cli.reporting.tables import bands_table
from mapmore_cli.reporting.titles import title_of


def draw_bands(ax: Axes, found: Sequence[Band], models: Sequence[str], styles: Mapping[str, ModelStyle]) -> None:
    """Draw a line for each model over the bands, on a logarithmic scale where the errors differ much."""
    for model in models:
        values = [band.rmse[model] for band in found]
        look = styles[model]
        line = {"color": look.colour, "linestyle": look.dashes, "linewidth": look.width, "marker": look.marker, "zorder": look.zorder}
        ax.plot(range(len(found)), values, markersize=3, **line)
    shown = np.array([band.rmse[model] for band in found for model in models])
    positive = shown[np.isfinite(shown) & (shown > 0)]
    if len(positive) and positive.max() > 20 * positive.min():
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_formatter(NullFormatter())
    else:
        ax.set_ylim(bottom=0)
    ax.set_xticks(range(len(found)), [f"{_short(band.low)}\N{EN DASH}{_short(band.high)}" for band in found])
    ax.set_xlim(-0.3, len(found) - 0.7)


def _short(value: float) -> str:
    """Three digits, and all that stand before the point of what is not long."""
    return f"{value:.0f}" if 1000 <= abs(value) < 1e5 else f"{value:.3g}"


def draw(inputs: ReportInputs) -> list[Drawing]:
    """One figure for all models that lines are drawn of."""
    found = bands(inputs.dataset, inputs.validation.predictions)
    models = [model for model in inputs.lines if model not in inputs.failed]
    if len(found) < 2 or not models:
        return []
    styles = model_styles(inputs.lines, inputs.style.palette)
    label = inputs.axis_label(inputs.target, "absolute value of measured")
    panel = Panel("", lambda axes: draw_bands(axes[0], found, models, styles), label, (f"RMSE ({inputs.target.unit})",), _data(found))
    handles = tuple(_handle(model, styles[model]) for model in models)
    caption = "Root mean square error by the size of what was measured, of held-out data where there are any."
    spoken = ", ".join(f"{title_of(model)} {found[0].rmse[model]:.3g}" for model in models)
    alt = f"RMSE where little is measured, up to {found[0].high:.3g} {inputs.target.unit}: {spoken}."
    return [Drawing("bands", caption, alt, (panel,), Grid(width=SINGLE, height=2.3), handles)]


def _handle(model: str, look: ModelStyle) -> Line2D:
    return Line2D([], [], color=look.colour, linestyle=look.dashes, marker=look.marker, markersize=3, label=shortened(title_of(model), 24))


def _data(found: Sequence[Band]) -> dict[str, Values]:
    table = bands_table(found, "")
    return dict(zip(table.headings, zip(*table.rows, strict=True), strict=True))
