"""Draw segments with their weights, as in figures 5 and 6 of Veale, Xie and Anderson 2018, and draw
the model over the levels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.joining import Fusion
from mapmore_cli.domain.models import Pieces
from mapmore_cli.domain.recording import DIRECTION
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.pieces.definition import cell_weights, zones
from mapmore_cli.modelling.pieces.segmentation import training_curves
from mapmore_cli.reporting.figures import panels, style
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.inputs import ReportInputs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LOOKS = (
    (style.BLUE, "o", "-"),
    (style.ORANGE, "s", "--"),
    (style.GREEN, "^", "-."),
    (style.PURPLE, "D", ":"),
)
"""Colour, marker and line style of the segments. The fifth segment is drawn like the first."""
GRID = 401


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return a figure of the segments for each segmented variable, and a figure of the model over
    the levels.
    """
    pieces = inputs.model.pieces
    if pieces is None or not pieces.segments:
        return []
    cut = [
        _variable_figure(inputs, pieces.fusion, j, name)
        for j, name in enumerate(pieces.variables)
        if name != DIRECTION
    ]
    return [*cut, *level_figures(inputs, pieces)]


@dataclass(frozen=True)
class SegmentCurve:
    """Training samples of one curve with their segments along one variable.

    `x`, `y` and `cell`, (n,) each, are the variable, the target, and the number of the sample's
    segment (from 1). `boundaries`, (count + 1,), are the limits of the segments, including both
    ends.
    """

    id: str
    title: str
    x: Array
    y: Array
    cell: IntArray
    boundaries: Array


def segment_curves(inputs: ReportInputs, variable: int) -> list[SegmentCurve]:
    """Return the training samples of every segmented curve, with their segments along the variable
    with this index.
    """
    training = training_curves(inputs.dataset.curves, by_level=inputs.model.level is not None)
    curves = {curve.id: curve for curve in training}
    made = []
    for segmented in inputs.segmentation:
        curve, ends = curves[segmented.curve], segmented.boundaries[variable]
        names = (segmented.variables[variable], inputs.fitted)
        x, y = (curve.columns[name][curve.training] for name in names)
        cell = np.clip(np.searchsorted(ends, x, side="right"), 1, len(ends) - 1)
        made.append(SegmentCurve(curve.id, inputs.curve_label(curve), x, y, cell, ends))
    return made


def _variable_figure(inputs: ReportInputs, fusion: Fusion, variable: int, name: str) -> Drawing:
    every = segment_curves(inputs, variable)
    shown = [every[i] for i in panels.places(inputs, [curve.id for curve in every])]
    along, target = (inputs.dataset.quantities[key] for key in (name, inputs.fitted))
    drawn = []
    for curve in shown:
        weights = cell_weights(curve.x, curve.boundaries, fusion).T
        data = {
            panels.heading(along): curve.x,
            panels.heading(target): curve.y,
            "segment": curve.cell,
            **{
                f"weight of segment {place}": weight
                for place, weight in enumerate(weights, start=1)
            },
        }
        labels = (inputs.axis_label(along), (inputs.axis_label(target), "Weight (–)"))
        on = partial(draw_segments, curve=curve, fusion=fusion)
        drawn.append(Panel(curve.id, on, *labels, data, curve.title))
    caption = (
        f"Training samples by segment of {name}, and the segments' weights within their curve "
        "below: boundaries as lines, transition zones shaded "
        f"({fusion.transition} transitions, z_s = {fusion.z_s:g})."
        f"{panels.some_of(len(shown), len(every), 'curves')}"
    )
    stem = "segments" if variable == 0 else f"segments_{name}"
    return Drawing(stem, caption, tuple(drawn), Layout(2.2, (2.0, 0.8), common_y="row"))


def draw_segments(top: Axes, bottom: Axes, curve: SegmentCurve, fusion: Fusion) -> None:
    """Draw the samples, coloured and marked by segment, and below them the weights of the segments.

    Boundaries are vertical lines, and transition zones are shaded (equations 10 and 11 of Veale,
    Xie and Anderson 2018).
    """
    starts, ends = zones(curve.boundaries, fusion)
    x = np.linspace(curve.boundaries[0], curve.boundaries[-1], GRID)
    x = np.unique([*x, *starts, *ends])
    weights = cell_weights(x, curve.boundaries, fusion).T
    for place, weight in enumerate(weights):
        colour, marker, line = LOOKS[place % len(LOOKS)]
        rows = curve.cell == place + 1
        dots = {"color": colour, "marker": marker, "markersize": 2.8}
        panels.draw_dots(top, curve.x[rows], curve.y[rows], panels.DOTS // len(weights), **dots)
        positive = np.where(weight > 0, weight, np.nan)
        bottom.plot(x, positive, color=colour, linestyle=line, linewidth=1.2)
    bottom.set_yticks([0, 0.5, 1])
    for ax in (top, bottom):
        for start, end in zip(starts, ends, strict=True):
            ax.axvspan(start, end, color=style.SHADE, linewidth=0, zorder=-1)
        for boundary in curve.boundaries:
            ax.axvline(boundary, color=style.GREY, linewidth=0.5, zorder=0)


def level_figures(inputs: ReportInputs, pieces: Pieces) -> list[Drawing]:
    """Return a figure of the model over the levels. It has a line for each of three values of the
    quantity that varies within a curve; these values lie in the range that all curves share. All
    other inputs are in the middle of their ranges.

    Return an empty list if there are fewer than two levels, or if the weights of the levels depend
    on the values of the curves (`pchip`).
    """
    if pieces.level is None or len(pieces.curves) < 2 or pieces.fusion.levels != "linear":
        return []
    levels = np.array([curve.level for curve in pieces.curves], dtype=np.float64)
    level, along = inputs.dataset.quantities[pieces.level], inputs.along
    output, x = inputs.model.output, _level_grid(pieces, levels)
    limits = {
        quantity.name: np.array([curve.limits[quantity.name] for curve in pieces.curves])
        for quantity in inputs.model.inputs
    }
    columns = {name: np.full(len(x), ends.mean()) for name, ends in limits.items()}
    columns[pieces.level] = x
    low, high = limits[along.name][:, 0].max(), limits[along.name][:, 1].min()
    places = [float(low + share * (high - low)) for share in (0.1, 0.5, 0.9)]
    courses = [
        predict(inputs.model, columns | {along.name: np.full(len(x), place)}) for place in places
    ]

    marked = levels[panels.evenly(len(levels), panels.DOTS)]

    def on(ax: Axes) -> None:
        for colour, y in zip(style.level_colours(len(courses)), courses, strict=True):
            panels.draw_trace(ax, x, y, color=colour, linewidth=1.2)
            ax.plot(marked, y[np.isin(x, marked)], color=colour, **panels.DOT)

    data = {panels.heading(level): x}
    for place, y in zip(places, courses, strict=True):
        data[f"{inputs.own} at {along.name} {place:.6g} [{output.unit}]"] = y
    at = f"{along.name} {', '.join(f'{place:.3g}' for place in places)}"
    at += "" if along.unit == "1" else f" {along.unit}"
    drawn = f"{inputs.own} over {level.name} at {at}"
    caption = f"The {output.name} of {drawn}; dots mark the training levels."
    caption += panels.some_of(len(marked), len(levels), "training levels")
    if pieces.fusion.shrink < 1.0:
        caption += (
            f" Midway between levels, {pieces.fusion.shrink:.0%} of what the pieces add to the "
            "backbone remains."
        )
    panel = Panel("", on, inputs.axis_label(level), (inputs.axis_label(output),), data)
    return [Drawing("segments_levels", caption, (panel,), Layout(2.0))]


def _level_grid(pieces: Pieces, levels: Array) -> Array:
    """Return the values of the level quantity at which the model is drawn. They include all levels.
    If the model extrapolates, they also reach a little beyond the lowest and the highest level.
    """
    sides = pieces.fusion.extrapolation[str(pieces.level)]
    below, above = (0.08 * np.ptp(levels) * isinstance(side, str) for side in sides)
    return np.union1d(np.linspace(levels[0] - below, levels[-1] + above, GRID), levels)
