"""A model by itself, over its training range: for notebooks, where there are no recordings."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.domain.models import CurveRange, Formula, Model, Pieces
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.validation.intervals import half_widths_of
from mapmore_cli.reporting.figures.style import level_colours
from mapmore_cli.reporting.inputs import FigureStyle

POINTS = 201


def draw_model(ax: Axes, model: Model, level: float | None = None) -> None:
    """Draw a line for every training curve, over the input that varies most within it; other inputs are held in the middle of their ranges.

    With `level`, as 0.95, the band of that interval around each.

    Raises TypeError for a model that has no training curves: it runs along recordings, or is a sum.
    """
    if not isinstance(model.body, Pieces | Formula):
        raise TypeError(f"{model.name} has no curves to draw; call it with a recording, and draw what it says")
    ranges = model.body.ranges
    along = _varying(model, ranges)
    for colour, one in zip(level_colours(len(ranges)), ranges, strict=True):
        x = np.linspace(*one.limits[along], POINTS)
        held = {name: np.full(POINTS, sum(ends) / 2) for name, ends in one.limits.items()}
        if model.level is not None and one.level is not None:
            held[model.level] = np.full(POINTS, one.level)
        said = predict(model, {**held, along: x})
        ax.plot(x, said, color=colour, label=one.curve)
        if level is not None:
            half = half_widths_of(model, {**held, along: x}, level)
            ax.fill_between(x, said - half, said + half, color=colour, alpha=0.2, linewidth=0)
    style = FigureStyle()
    ax.set_xlabel(style.axis_label(next(quantity for quantity in model.inputs if quantity.name == along)))
    ax.set_ylabel(style.axis_label(model.output))
    ax.legend()


def _varying(model: Model, ranges: tuple[CurveRange, ...]) -> str:
    """Return the first segmented variable, else the input that varies most within a curve beside its range over all curves."""
    if isinstance(model.body, Pieces) and model.body.variables:
        return model.body.variables[0]

    def share(name: str) -> float:
        ends = np.array([one.limits[name] for one in ranges])
        whole = float(np.ptp(ends))
        return float(np.mean(np.ptp(ends, axis=1))) / whole if whole > 0 else 0.0

    return max((quantity.name for quantity in model.inputs if quantity.name != model.level), key=share)
