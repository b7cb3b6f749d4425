"""The way between the training levels: the weights of the curves, or what a shape-preserving interpolation makes of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.pieces.weights import level_weights
from mapmore_cli.reporting.figures.drawing import Drawing
from mapmore_cli.reporting.figures.style import SINGLE, axis_label, level_colours
from mapmore_cli.reporting.inputs import ReportInputs

GRID = 401
PLACES = (0.1, 0.5, 0.9)
"""Shares of the range that all curves have in common, at which the model is drawn over the levels."""


def level_figures(inputs: ReportInputs) -> list[Drawing]:
    """One figure where there are levels to interpolate between."""
    levels = np.array([curve.level for curve in inputs.model.curves if curve.level is not None])
    if inputs.model.level is None or len(levels) < 2:
        return []
    level = inputs.dataset.quantities[inputs.model.level]
    figure = Figure(figsize=(SINGLE, 1.5 if inputs.model.fusion.levels == "linear" else 2.2), layout="constrained")
    ax = figure.subplots()
    ax.set_xlabel(axis_label(level))
    if inputs.model.fusion.levels == "linear":
        draw_levels(ax, levels, inputs.model)
        ax.set_yticks([0, 0.5, 1])
        ax.set_ylabel("Weight (–)")
        caption = f"Weights of the {len(levels)} training curves over {level.name}; a dot marks the level of each."
        peaks = ", ".join(f"{value:g}" for value in levels)
        return [Drawing("segments_levels", caption, f"Triangular weights with their peaks at {peaks} {level.unit}.", figure)]
    along = inputs.in_curve
    courses = level_courses(inputs.model, along.name, levels)
    draw_courses(ax, courses, levels)
    ax.set_ylabel(axis_label(inputs.target))
    places = ", ".join(f"{course.place:.3g}" for course in courses)
    at = f"{along.name} {places} {along.unit if along.unit != '1' else ''}".rstrip()
    caption = (
        f"{inputs.own} over {level.name} at {at}; dots mark the training levels. Between them the values of the curves are interpolated so "
        "that they keep their shape: the weights depend on these values, and there is no single weight to draw."
    )
    return [Drawing("segments_levels", caption, f"{inputs.own} over {level.name} at {at}.", figure)]


def draw_levels(ax: Axes, levels: Array, model: Model) -> None:
    """Triangular weights between neighbouring levels; beyond the outer ones as far as the extrapolation acts on the weights."""
    x = _level_grid(model, levels)
    below, above = model.fusion.extrapolation[str(model.level)]
    for colour, level, weight in zip(level_colours(len(levels)), levels, level_weights(x, levels, str(below), str(above)).T, strict=True):
        ax.plot(x, weight, color=colour, linewidth=1.2)
        ax.plot([level], [1.0], color=colour, marker="o", markersize=3)


@dataclass(frozen=True)
class Course:
    """What a model says at one `place` along its curves over the levels: `y` over `x`, and `at_levels` at the training levels."""

    place: float
    x: Array
    y: Array
    at_levels: Array


def level_courses(model: Model, along: str, levels: Array) -> list[Course]:
    """The model at `PLACES` of the range that all its curves have of `along`, other inputs in the middle of their ranges."""
    level = str(model.level)
    limits = {quantity.name: np.array([curve.limits[quantity.name] for curve in model.curves]) for quantity in model.inputs}
    low, high = limits[along][:, 0].max(), limits[along][:, 1].min()
    x = _level_grid(model, levels)
    middle = {name: float(ends.mean()) for name, ends in limits.items()}

    def at(place: float, values: Array) -> Array:
        columns = {name: np.full(len(values), value) for name, value in middle.items()}
        return predict(model, {**columns, along: np.full(len(values), place), level: values})

    places = [float(low + share * (high - low)) for share in PLACES]
    return [Course(place, x, at(place, x), at(place, levels)) for place in places]


def draw_courses(ax: Axes, courses: Sequence[Course], levels: Array) -> None:
    """One line a place, a dot at every training level."""
    for colour, course in zip(level_colours(len(courses)), courses, strict=True):
        ax.plot(course.x, course.y, color=colour, linewidth=1.2)
        ax.plot(levels, course.at_levels, color=colour, linestyle="none", marker="o", markersize=3)


def _level_grid(model: Model, levels: Array) -> Array:
    """Values of the level quantity, a little beyond the outer levels where the model is extrapolated, the levels among them."""
    below, above = model.fusion.extrapolation[str(model.level)]
    margin = 0.08 * (levels[-1] - levels[0])
    low = levels[0] - (margin if isinstance(below, str) else 0.0)
    high = levels[-1] + (margin if isinstance(above, str) else 0.0)
    return np.union1d(np.linspace(low, high, GRID), levels)
