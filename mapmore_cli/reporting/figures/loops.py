"""Paths of the target over the quantity that drives it, measured and predicted: hysteresis loops."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.recording import Curve
from mapmore_cli.reporting.figures.drawing import Drawing
from mapmore_cli.reporting.figures.motion import MEASURED, shown_models
from mapmore_cli.reporting.figures.panels import columns_for
from mapmore_cli.reporting.figures.style import BLACK, DOUBLE, OWN_STYLE, SINGLE, ModelStyle, axis_label, model_styles, shortened, some_of
from mapmore_cli.reporting.figures.thinning import envelope, spread
from mapmore_cli.reporting.inputs import ReportInputs

MOST_RECORDINGS = 3
MOST_RIVALS = 2
POINTS_A_PATH = 600


def loop_figures(inputs: ReportInputs) -> list[Drawing]:
    """A row of panels for each held-out recording: the run's own model over the measured loops, and its best competitors likewise."""
    numbers = [i for i, curve in enumerate(inputs.dataset.curves) if curve.held_out.any()]
    shown = [numbers[i] for i in spread(len(numbers), MOST_RECORDINGS)]
    if not shown:
        return []
    models = shown_models(inputs, MOST_RIVALS)
    styles = model_styles(models)
    columns = columns_for(len(models))
    rows = math.ceil(len(models) / columns)
    figure = Figure(figsize=(SINGLE if columns == 1 else DOUBLE, 0.4 + 2.3 * rows * len(shown)), layout="constrained")
    axes = figure.subplots(rows * len(shown), columns, sharey="row", squeeze=False)
    for place, number in enumerate(shown):
        own = axes[place * rows : (place + 1) * rows].ravel()
        for ax, model in zip(own, models, strict=False):
            _draw(ax, inputs, number, model, styles[model])
        for ax in own[len(models) :]:
            ax.remove()
        own[0].set_ylabel(axis_label(inputs.target))
    figure.legend(handles=_legend(styles), loc="outside upper left", ncols=4)
    what = f"Measured and predicted {inputs.target.name} over {inputs.in_curve.name}"
    left_out = some_of(len(shown), len(numbers), "recordings with held-out samples")
    best = f" The best {len(models) - 1} of {len(inputs.models) - 1} competitors are drawn." if len(models) < len(inputs.models) else ""
    caption = f"{what} along the held-out samples, in the order of time.{best}{left_out}"
    return [Drawing("loops", caption, f"{what}, held-out samples in the order of time.", figure)]


def _draw(ax: Axes, inputs: ReportInputs, number: int, model: str, style: ModelStyle) -> None:
    curve = inputs.dataset.curves[number]
    x, measured = curve.columns[inputs.in_curve.name], curve.columns[inputs.dataset.target]
    predicted = inputs.validation.predictions[model][number]
    for piece in _held_out_pieces(curve):
        _path(ax, x[piece], measured[piece], color=BLACK, linewidth=MEASURED, zorder=2)
        _path(ax, x[piece], predicted[piece], color=style.colour, linewidth=OWN_STYLE.width, zorder=3)
    ax.set_title(f"{shortened(inputs.curve_label(curve), 22)}: {shortened(model, 24)}", fontsize=7)
    ax.set_xlabel(axis_label(inputs.in_curve))


def _path(ax: Axes, x: Array, y: Array, **look: object) -> None:
    rows = np.union1d(envelope(x, POINTS_A_PATH // 2), envelope(y, POINTS_A_PATH // 2))
    ax.plot(x[rows], y[rows], **look)  # type: ignore[arg-type]


def _held_out_pieces(curve: Curve) -> list[IntArray]:
    """Row numbers of every run of held-out samples of one recording."""
    pieces: list[IntArray] = []
    for rows in curve.logs:
        held = rows[curve.held_out[rows]]
        pieces += [piece for piece in np.split(held, np.flatnonzero(np.diff(held) > 1) + 1) if len(piece)]
    return pieces


def _legend(styles: dict[str, ModelStyle]) -> list[Line2D]:
    measured = Line2D([], [], color=BLACK, linewidth=MEASURED, label="measured")
    return [measured, *(Line2D([], [], color=style.colour, linewidth=OWN_STYLE.width, label=model) for model, style in styles.items())]
