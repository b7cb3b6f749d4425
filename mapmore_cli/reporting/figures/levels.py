"""The way between the training levels: the weights of the curves, or what a shape-preserving interpolation makes of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.models import Model, Pieces
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.pieces.definition import weight_of
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import level_colours
from mapmore_cli.reporting.inputs import ReportInputs

NAME = "segments_levels"
GRID = 401
PLACES = (0.1, 0.5, 0.9)
"""Shares of the range that all curves have in common, at which the model is drawn over the levels."""


def level_figures(inputs: ReportInputs) -> list[Drawing]:
    """One figure where there are levels to interpolate between."""
    pieces = inputs.model.pieces
    if pieces is None or pieces.level is None or len(pieces.curves) < 2:
        return []
    levels = np.array([curve.level for curve in pieces.curves], dtype=np.float64)
    level = inputs.dataset.quantities[pieces.level]
    return [_weights(pieces, inputs, level, levels) if pieces.fusion.levels == "linear" else _courses(inputs, level, levels)]


def _weights(pieces: Pieces, inputs: ReportInputs, level: Quantity, levels: Array) -> Drawing:
    x, weights = level_weights(pieces, levels)

    def on(axes: Sequence[Axes]) -> None:
        draw_levels(axes[0], levels, x, weights)
        axes[0].set_yticks([0, 0.5, 1])

    data: dict[str, Values] = {f"{level.name} [{level.unit}]": x}
    data |= {f"weight of {value:g} {level.unit}": weight for value, weight in zip(levels, weights, strict=True)}
    caption = f"Weights of the {len(levels)} training curves over {level.name}; a dot marks the level of each."
    if pieces.fusion.shrink < 1.0:
        share = f"{pieces.fusion.shrink:.0%}"
        caption += (
            f" Midway between levels, {share} of what the pieces explain on the backbone is carried: the weights sum to less than one."
        )
    peaks = ", ".join(f"{value:g}" for value in levels)
    alt = f"Weights with their peaks at {peaks} {level.unit}."
    return Drawing(NAME, caption, alt, (Panel("", on, inputs.axis_label(level), ("Weight (–)",), data),), Grid(height=1.3))


def _courses(inputs: ReportInputs, level: Quantity, levels: Array) -> Drawing:
    along = inputs.in_curve
    courses = level_courses(inputs.model, along.name, levels)
    places = ", ".join(f"{course.place:.3g}" for course in courses)
    at = f"{along.name} {places} {along.unit if along.unit != '1' else ''}".rstrip()
    caption = (
        f"{inputs.own} over {level.name} at {at}; dots mark the training levels. Between them the values of the curves are interpolated so "
        "that they keep their shape: the weights depend on these values, and there is no single weight to draw."
    )
    data: dict[str, Values] = {f"{level.name} [{level.unit}]": courses[0].x}
    data |= {f"{inputs.own} at {along.name} {course.place:.6g} [{inputs.target.unit}]": course.y for course in courses}
    panel = Panel(
        "", lambda axes: draw_courses(axes[0], courses, levels), inputs.axis_label(level), (inputs.axis_label(inputs.target),), data
    )
    return Drawing(NAME, caption, f"{inputs.own} over {level.name} at {at}.", (panel,), Grid(height=2.0))


def draw_levels(ax: Axes, levels: Array, x: Array, weights: Array) -> None:
    """Draw weights of the curves, `(levels, m)`, as the model has them at `x` between the levels and beyond the outer ones."""
    for colour, level, weight in zip(level_colours(len(levels)), levels, weights, strict=True):
        ax.plot(x, weight, color=colour, linewidth=1.2)
        ax.plot([level], [1.0], color=colour, marker="o", markersize=3)


def level_weights(pieces: Pieces, levels: Array) -> tuple[Array, Array]:
    """Values of the level quantity `(m,)`, and the weight of every curve there `(levels, m)`, in the middle of the other inputs' ranges."""
    x = _level_grid(pieces, levels)
    places = {name: np.full(len(x), np.mean([curve.limits[name] for curve in pieces.curves])) for name in pieces.curves[0].limits}
    columns = {**places, str(pieces.level): x}
    return x, np.array([weight_of(pieces, {segment.id for segment in curve.segments}, columns) for curve in pieces.curves])


@dataclass(frozen=True)
class Course:
    """What a model says at one `place` along its curves over the levels: `y` over `x`, and `at_levels` at the training levels."""

    place: float
    x: Array
    y: Array
    at_levels: Array


def level_courses(model: Model, along: str, levels: Array) -> list[Course]:
    """Return the model at `PLACES` of the range that all its curves have of `along`, other inputs in the middle of their ranges."""
    pieces = model.pieces
    assert pieces is not None
    level = str(pieces.level)
    limits = {quantity.name: np.array([curve.limits[quantity.name] for curve in pieces.curves]) for quantity in model.inputs}
    low, high = limits[along][:, 0].max(), limits[along][:, 1].min()
    x = _level_grid(pieces, levels)
    middle = {name: float(ends.mean()) for name, ends in limits.items()}

    def at(place: float, values: Array) -> Array:
        columns = {name: np.full(len(values), value) for name, value in middle.items()}
        return predict(model, {**columns, along: np.full(len(values), place), level: values})

    places = [float(low + share * (high - low)) for share in PLACES]
    return [Course(place, x, at(place, x), at(place, levels)) for place in places]


def draw_courses(ax: Axes, courses: Sequence[Course], levels: Array) -> None:
    """Draw one line a place, a dot at every training level."""
    for colour, course in zip(level_colours(len(courses)), courses, strict=True):
        ax.plot(course.x, course.y, color=colour, linewidth=1.2)
        ax.plot(levels, course.at_levels, color=colour, linestyle="none", marker="o", markersize=3)


def _level_grid(pieces: Pieces, levels: Array) -> Array:
    """Values of the level quantity, a little beyond the outer levels where the model is extrapolated, the levels among them."""
    below, above = pieces.fusion.extrapolation[str(pieces.level)]
    margin = 0.08 * (levels[-1] - levels[0])
    low = levels[0] - (margin if isinstance(below, str) else 0.0)
    high = levels[-1] + (margin if isinstance(above, str) else 0.0)
    return np.union1d(np.linspace(low, high, GRID), levels)
