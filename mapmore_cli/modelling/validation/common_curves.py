"""Find the curves that two models have in common, and a grid of points along each of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, Ranges
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import CurveRange
from mapmore_cli.modelling.ranges import limits

# If one input varies within a curve, `GRID` is the number of points along this input.
# If several inputs vary, `COARSE_GRID` is the number of points along each of them.
GRID, COARSE_GRID = 41, 11
# Levels of two models are treated as equal if their distance is at most this fraction of the
# smallest distance between two levels of one model.
SAME_LEVEL = 0.05
FEWEST_CURVES = 2  # smallest number of common curves with which two models are compared


class CurvePlace(NamedTuple):
    """A curve along which both models are compared: its name, its level, and True if one of the
    models has no curve at this level and must be interpolated.
    """

    curve: str
    level: float | None
    interpolated: bool = False


def common_curves(before: Model, after: Model) -> list[CurvePlace]:
    """Return the curves of both models at the same level, or with the same name if there are no
    levels.

    If the levels of the models differ, only levels inside the ranges of both models are compared.
    The curves then have the levels of one model, and the other model is interpolated to these
    levels. The levels are those of the model with fewer levels inside both ranges, so that no curve
    is counted twice.
    """
    first, second = _ranges(before), _ranges(after)
    if before.level != after.level:
        raise ValueError(
            f"the curves of {before.name} and of {after.name} have levels of different "
            "quantities, so that they cannot be compared"
        )
    if before.level is None:
        names = {curve_range.curve for curve_range in second}
        places = [
            CurvePlace(curve_range.curve, None)
            for curve_range in first
            if curve_range.curve in names
        ]
    else:
        levels, other_levels = _levels_of(first), _levels_of(second)
        near = SAME_LEVEL * float(
            min(np.concatenate([np.diff(levels), np.diff(other_levels), [math.inf]]))
        )
        pairs = product(zip(first, levels, strict=True), other_levels)
        places = [
            CurvePlace(curve_range.curve, (level + other) / 2)
            for (curve_range, level), other in pairs
            if abs(level - other) <= near
        ]
        if len(places) < FEWEST_CURVES:
            places = min(
                (_places_inside(first, other_levels), _places_inside(second, levels)), key=len
            )
    if len(places) < FEWEST_CURVES:
        raise ValueError(
            f"{before.name} and {after.name} have too few curves in common ({len(places)}); a "
            f"comparison needs at least {FEWEST_CURVES}"
        )
    return places


def _levels_of(ranges: Sequence[CurveRange]) -> list[float]:
    return [curve_range.level for curve_range in ranges if curve_range.level is not None]


def _places_inside(ranges: Sequence[CurveRange], levels: Sequence[float]) -> list[CurvePlace]:
    with_levels = zip(ranges, _levels_of(ranges), strict=True)
    return [
        CurvePlace(curve_range.curve, level, True)
        for curve_range, level in with_levels
        if min(levels) <= level <= max(levels)
    ]


def _ranges(model: Model) -> tuple[CurveRange, ...]:
    ranges: tuple[CurveRange, ...] = getattr(model.body, "ranges", ())
    if not ranges or model.memories:
        raise ValueError(
            f"{model.name} has no curves to compare, because it is a model over time or a sum of "
            "models"
        )
    return ranges


def grid(before: Model, after: Model, place: CurvePlace) -> dict[str, Array]:
    """Return a grid of points inside the ranges of both models, shape (m,) for each input. The
    points are evenly spread along every input that varies.

    Raises ValueError if the ranges do not overlap.
    """
    first, second = (_limits_at(model, place) for model in (before, after))
    ends = {
        name: (max(low, second[name][0]), min(high, second[name][1]))
        for name, (low, high) in first.items()
        if name != before.level
    }
    for name, (low, high) in ends.items():
        if high < low:
            raise ValueError(
                f"{place.curve}: the ranges of {name} in {before.name} and {after.name} do "
                "not overlap"
            )
    varying = sum(high > low for low, high in ends.values())
    count = GRID if varying < 2 else COARSE_GRID
    axes = {
        name: np.linspace(low, high, count if high > low else 1)
        for name, (low, high) in ends.items()
    }
    if before.level is not None:
        axes[before.level] = np.array([place.level])
    points = np.array(list(product(*axes.values())))
    return {name: points[:, number] for number, name in enumerate(axes)}


def _limits_at(model: Model, place: CurvePlace) -> Ranges:
    """Return the training range of every input along a curve. If the curve has a level, the range
    is interpolated between the training curves.
    """
    ranges = _ranges(model)
    if place.level is None:
        return next(
            curve_range.limits for curve_range in ranges if curve_range.curve == place.curve
        )
    return {
        input_range.name: (float(low[0]), float(high[0]))
        for input_range in limits(ranges, model.level)
        if input_range.at is not None
        for low, high in [input_range.ends({input_range.at: np.array([place.level])})]
    }
