"""Errors by the size of what was measured, in bands: how good a model is where little is pulled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.modelling.validation.metrics import ErrorBand, bands
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel
from mapmore_cli.reporting.figures.style import (
    ModelStyle,
    key,
    model_styles,
    plain_logarithm,
    shortened,
)
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import title_of
from mapmore_cli.reporting.tables import bands_table


def draw_bands(
    ax: Axes, found: Sequence[ErrorBand], models: Sequence[str], styles: Mapping[str, ModelStyle]
) -> None:
    """Draw a line for each model over the bands, on a logarithmic scale where the errors differ
    much.
    """
    for model in models:
        values = [band.rmse[model] for band in found]
        ax.plot(
            range(len(found)),
            values,
            marker=styles[model].marker,
            markersize=3,
            **styles[model].line,
        )
    shown = np.array([band.rmse[model] for band in found for model in models])
    positive = shown[np.isfinite(shown) & (shown > 0)]
    if len(positive) and positive.max() > 20 * positive.min():
        plain_logarithm(ax.yaxis, (1.0, 2.0, 5.0))
    else:
        ax.set_ylim(bottom=0)
    ax.set_xticks(
        range(len(found)), [f"{_short(band.low)}\N{EN DASH}{_short(band.high)}" for band in found]
    )
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
    label, table = (
        inputs.axis_label(inputs.target, "absolute value of measured"),
        bands_table(found, ""),
    )
    data = dict(zip(table.headings, zip(*table.rows, strict=True), strict=True))
    panel = Panel(
        "",
        lambda axes: draw_bands(axes[0], found, models, styles),
        label,
        (f"RMSE ({inputs.target.unit})",),
        data,
    )
    looks = {
        model: {"color": look.colour, "linestyle": look.dashes, "marker": look.marker}
        for model, look in styles.items()
    }
    handles = tuple(
        key(shortened(title_of(model), 24), markersize=3, **looks[model]) for model in models
    )
    caption = (
        "Root mean square error by the size of what was measured, of held-out data where "
        "there are any."
    )
    spoken = ", ".join(f"{title_of(model)} {found[0].rmse[model]:.3g}" for model in models)
    alt = (
        f"RMSE where little is measured, up to {found[0].high:.3g} {inputs.target.unit}: {spoken}."
    )
    return [Drawing("bands", caption, alt, (panel,), Grid(height=2.3), handles)]
