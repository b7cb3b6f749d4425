"""The coefficients of all segments together, under what is known of them and of the fused surface.

FROLS has chosen the terms. The sum of squares of all segments is minimised again under linear
inequalities: bounds of coefficients, and the shape on a grid of the fused model, zones and levels
included. Only where a solution violates the shape are inequalities added, and the grid becomes
finer about those that bind, until nothing is violated (an exchange method for semi-infinite
problems: Hettich and Kortanek 1993). With `levels: linear` the model is linear in its coefficients;
with `pchip` the inequalities are linearised where it stands.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.fits import SegmentedCurve
from mapmore_cli.domain.models import (
    CurveFunction,
    Model,
    Pieces,
)
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.expressions import dictionary_matrix, parse
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.pieces.definition import levels_program, pieces_program
from mapmore_cli.modelling.pieces.recipe import Recipe
from mapmore_cli.modelling.pieces.segmentation import samples_at, scaled_inputs, training_curves
from mapmore_cli.modelling.program.model import program_of, with_slopes
from mapmore_cli.modelling.program.values import evaluator
from mapmore_cli.modelling.shape.least_squares import Constrained, least_squares_under
from mapmore_cli.modelling.shape.region import Region, grid_of, region_of
from mapmore_cli.modelling.shape.stencils import Asked, Grid, Stencils, asked_of
from mapmore_cli.modelling.shape.violations import violations, with_shape

# nodes of the grid where the exchange begins, and of the one on which nothing may be violated
COARSE, FINE = 625, 62_500
# nodes along each input of the grid about an inequality that binds, and how often it becomes finer
CLOSE, CLOSER = 9, 3
# rounds of the exchange on one grid; inequalities of a word that are added in one of them
ROUNDS, ADDED = 60, 200
# a fall by this share of the range of the training output, from node to node, is none
ROUNDING = 1e-11
# part of the length of a row below which the coefficients do not count at a place
NOTHING = 1e-12


def shaped(
    model: Model, curves: Sequence[Curve], segmentation: Sequence[SegmentedCurve], recipe: Recipe
) -> Model:
    """Return the fused model with coefficients that keep what the recipe says of them and of the
    shape; the model itself where it says nothing.

    Raises FitError where no coefficients of the chosen terms do.
    """
    body = model.body
    assert isinstance(body, Pieces)
    asked = asked_of(recipe.fit)
    region = region_of(model, curves, recipe.fit) if asked else None
    if not body.segments or (region is None and not recipe.bounds):
        return model
    surface = _Surface(model, body, _factor(body, curves, segmentation, recipe))
    exchange = _Exchange(surface, *_bounds(body, recipe.bounds), region)
    if region is not None:
        exchange.until_kept(asked, region)
    kept = violations(model, asked, region) if region is not None else []
    return with_shape(model, exchange.model, curves, recipe.fit, kept, exchange.where())


def _factor(
    body: Pieces,
    curves: Sequence[Curve],
    segmentation: Sequence[SegmentedCurve],
    recipe: Recipe,
) -> Array:
    """Return the triangular factor of the regressors of all segments, in the target's unit, (k, k):
    all that the sum of squares needs of the samples.
    """
    training = {curve.id: curve for curve in training_curves(curves, recipe.level is not None)}
    rows = {one.id: (curve.curve, one.rows) for curve in segmentation for one in curve.segments}
    blocks: list[Any] = []
    for segment in body.segments:
        curve, own = rows[segment.id]
        samples = samples_at(training[curve].columns, own, segment.scaling.variables)
        z = scaled_inputs(segment.scaling, samples)
        P = dictionary_matrix([parse(text) for text in segment.terms], z, len(own))
        blocks.append(np.linalg.qr(segment.scaling.y_slope * P, mode="r"))
    return np.asarray(block_diag(*blocks))


def _bounds(body: Pieces, bounds: Mapping[str, tuple[float, float]]) -> tuple[Array, Array]:
    """Return rows and right sides of `D theta >= d` for bounds of coefficients in the target's
    unit, by term.
    """
    terms = [(t, one.scaling.y_slope) for one in body.segments for t in one.terms]
    rows, least = [], []
    for number, (term, slope) in enumerate(terms):
        for sign, bound in zip((1.0, -1.0), bounds.get(term, ()), strict=False):
            if np.isfinite(bound):
                rows.append(sign * slope * np.eye(len(terms))[number])
                least.append(sign * bound)
    return np.reshape(rows, (-1, len(terms))), np.array(least)


@dataclass(frozen=True)
class _Surface:
    """A fused model as a function of the coefficients of all its segments; `R` is their factor."""

    start: Model
    body: Pieces
    R: Array

    def model(self, theta: Array) -> Model:
        """Return the model with other coefficients."""
        at, curves = 0, []
        for curve in self.body.curves:
            segments = []
            for one in curve.segments:
                own, at = theta[at : at + len(one.theta)], at + len(one.theta)
                error = one.theta_error if (own == one.theta).all() else own * np.nan
                segments.append(replace(one, theta=own, theta_error=error))
            curves.append(replace(curve, segments=tuple(segments)))
        return replace(self.start, body=replace(self.body, curves=tuple(curves)))

    def derivatives(self, theta: Array, columns: Columns) -> Array:
        """Return the derivatives of the output by the coefficients, (n, k), at inputs (n,) each."""
        by_curve = [np.column_stack([one(columns)[0] for one in curve]) for curve in self._units]
        if self.body.level is None:
            return by_curve[0]
        counts = np.cumsum([0, *(one.shape[1] for one in by_curve)])
        values = {
            f"curve_{number}": offset(columns)[0] + regressors @ theta[first:end]
            for number, (offset, regressors, first, end) in enumerate(
                zip(self._offsets, by_curve, counts, counts[1:], strict=False)
            )
        }
        level = {self.body.level: np.asarray(columns[self.body.level])}
        _, _, *weights = self._across({**level, **values})
        return np.hstack([w[:, None] * P for w, P in zip(weights, by_curve, strict=True)])

    @cached_property
    def _across(self) -> Any:
        return evaluator(with_slopes(levels_program(self.body)))

    @cached_property
    def _offsets(self) -> list[Any]:
        """Each curve with all coefficients zero."""
        return [self._curve(curve, None) for curve in self.body.curves]

    @cached_property
    def _units(self) -> list[list[Any]]:
        """Each curve with one coefficient one, and all else zero."""
        return [
            [self._curve(curve, unit) for unit in np.eye(sum(len(s.theta) for s in curve.segments))]
            for curve in self.body.curves
        ]

    def _curve(self, curve: CurveFunction, theta: Array | None) -> Any:
        """Return a curve by itself, ready to be evaluated, with some coefficients; without any, its
        constants.
        """
        segments, at = [], 0
        for one in curve.segments:
            own = np.zeros(len(one.theta)) if theta is None else theta[at : at + len(one.theta)]
            at += len(one.theta)
            kept = np.flatnonzero(own)
            constant = one.scaling.y_intercept if theta is None else 0.0
            segments.append(
                replace(
                    one,
                    terms=tuple(one.terms[i] for i in kept),
                    theta=own[kept],
                    scaling=replace(one.scaling, y_intercept=constant),
                )
            )
        fusion = self.body.fusion
        if self.body.level is not None:
            sides = {**fusion.extrapolation, self.body.level: ("continue", "continue")}
            fusion = replace(fusion, extrapolation=sides)
        alone = replace(
            self.body, curves=(replace(curve, segments=tuple(segments)),), fusion=fusion
        )
        return evaluator(pieces_program(alone, [one.name for one in self.start.inputs]))


class _Exchange:
    """The inequalities so far, `D theta >= d`, and the coefficients that meet them.

    `stencils` has those of the shape, each with the row that it begins at.
    """

    def __init__(self, surface: _Surface, D: Array, d: Array, region: Region | None) -> None:
        self.surface, self.D, self.d, self.region = surface, D, d, region
        self.stencils: list[tuple[int, Stencils]] = []
        self.start = np.concatenate([one.theta for one in surface.body.segments])
        self._solve()

    def _solve(self) -> None:
        """Solve, with the inequalities as they are; raise FitError where they contradict."""
        R = self.surface.R
        solution = least_squares_under(R, R @ self.start, self.D, self.d)
        if solution.met:
            self.solution, self.model = solution, self.surface.model(solution.theta)
            return
        places = [one.told for one in self.binding(solution)]
        shown = "; ".join(dict.fromkeys(places)) or "bounds of coefficients"
        raise FitError(
            f"fit.shape: no coefficients of the chosen terms keep it: {shown}",
            "allow more terms or others (fit.max_terms, dictionary), raise fit.slack, or ask for "
            "less",
        )

    def binding(self, solution: Constrained) -> list[Stencils]:
        """Return the stencils whose inequalities bind, one by one."""
        return [
            stencils.at(np.array([row]))
            for first, stencils in self.stencils
            for row in np.flatnonzero(solution.force[first : first + len(stencils.weights)])
        ]

    def where(self) -> dict[Asked, dict[str, tuple[float, float]]]:
        """Return the range of the inputs in which each word binds."""
        ranges: dict[Asked, dict[str, tuple[float, float]]] = {}
        for stencils in self.binding(self.solution):
            own = ranges.setdefault(stencils.asked, {})
            for name, x in stencils.points.items():
                low, high = own.get(name, (np.inf, -np.inf))
                own[name] = min(low, float(x.min())), max(high, float(x.max()))
        return ranges

    def until_kept(self, asked: Sequence[Asked], region: Region) -> None:
        """Add inequalities until the shape is kept on a coarse grid, then on a fine one, then close
        to the places where it binds.
        """
        asked = region.asks(asked)
        knots = program_of(self.surface.start).knots
        for nodes in (COARSE, FINE):
            self._on([(grid_of(region, knots, nodes), asked)], region)
        steps = {
            name: (high - low) / FINE ** (1 / len(region.ends))
            for name, (low, high) in region.ends.items()
        }
        for closer in range(CLOSER):
            grids = [
                (_about(stencils, steps, closer), [stencils.asked])
                for stencils in self.binding(self.solution)
            ]
            self._on(grids, region)

    def _on(self, grids: Sequence[tuple[Grid, Sequence[Asked]]], region: Region) -> None:
        """Add inequalities until nothing is violated on some grids."""
        if not grids:
            return
        columns = [grid.columns for grid, _ in grids]
        ends = np.cumsum([len(next(iter(one.values()))) for one in columns])[:-1]
        nodes = {name: np.concatenate([one[name] for one in columns]) for name in columns[0]}
        inside = np.split(region.holds(nodes), ends)
        for _ in range(ROUNDS):
            values = np.split(predict(self.model, nodes), ends)
            violated = [
                stencils
                for (grid, words), y, within in zip(grids, values, inside, strict=True)
                for one in words
                if len((stencils := _violated(grid, one, y, within, region)).weights)
            ]
            if not violated:
                return
            for stencils in violated:
                self._add(stencils)
            self._solve()
        raise FitError(
            f"fit.shape: no coefficients that keep it were found, {violated[0].told}",
            "use `fuse: {levels: linear}`, or ask for less",
        )

    def _add(self, stencils: Stencils) -> None:
        """Add the inequality of each stencil, linear in the coefficients about those so far."""
        theta = self.solution.theta
        rows = stencils.of(self.surface.derivatives(theta, stencils.columns))
        value = stencils.of(predict(self.model, stencils.columns))
        counts = np.linalg.norm(rows, axis=1) > NOTHING
        self.stencils.append((len(self.D), stencils.at(counts)))
        self.D = np.vstack([self.D, rows[counts]])
        self.d = np.append(self.d, (rows @ theta - value)[counts])


def _violated(
    grid: Grid, asked: Asked, values: Array, inside: BoolArray, region: Region
) -> Stencils:
    """Return the stencils at which the shape is violated most."""
    along = grid.along(asked, values, inside)
    worst = np.argsort(along.rises)[:ADDED]
    return along.stencils.at(worst[along.rises[worst] < -ROUNDING * region.output.span])


def _about(stencils: Stencils, steps: Mapping[str, float], closer: int) -> Grid:
    """Return a grid about a stencil: a cell to each side of its middle."""
    axes = {}
    for name, x in stencils.points.items():
        step, middle = steps.get(name, 0.0) * (2 / (CLOSE - 1)) ** closer, float(x[0].mean())
        axes[name] = np.unique(np.linspace(middle - step, middle + step, CLOSE))
    return Grid(axes)
