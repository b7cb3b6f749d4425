"""The coefficients of all segments together, under what is known of them and of the fused surface.

FROLS has chosen the terms. The sum of squares of all segments is minimised again under linear
inequalities: bounds of coefficients, and the shape on a grid of the fused model, zones and levels
included. Inequalities are added where a solution violates the shape, and the grid becomes finer
about those that bind, until nothing is violated (an exchange method for semi-infinite problems:
Hettich and Kortanek 1993). With `levels: linear` the model is linear in its coefficients; with
`pchip` the inequalities are linearised about the last solution.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, Ranges, extremes
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.fits import SegmentedCurve
from mapmore_cli.domain.models import Model, Pieces, SegmentFunction
from mapmore_cli.domain.recording import Curve, uncertainty_of, united
from mapmore_cli.modelling.expressions import dictionary_matrix, parse
from mapmore_cli.modelling.literature.model import backbone_values
from mapmore_cli.modelling.pieces.definition import pieces_program
from mapmore_cli.modelling.pieces.recipe import Recipe
from mapmore_cli.modelling.pieces.segmentation import samples_at, scaled_inputs, training_curves
from mapmore_cli.modelling.program.model import program_of
from mapmore_cli.modelling.program.values import evaluator
from mapmore_cli.modelling.shape.least_squares import least_squares_under
from mapmore_cli.modelling.shape.region import Region, refuse_unsupported, region_of
from mapmore_cli.modelling.shape.stencils import (
    Asked,
    Stencils,
    asked_of,
    nodes_of,
    stencils_on,
)
from mapmore_cli.modelling.shape.violations import verified, with_shape

# nodes of the grid on which nothing may be violated; of each input about an inequality that binds,
# and how often that grid becomes finer
FINE, CLOSE, CLOSER = 40_000, 9, 3
# rounds of the exchange on one grid; inequalities of a word that are added in one of them
ROUNDS, ADDED = 60, 200
# a fall by this share of the range of the training output, from node to node, is none
ROUNDING = 1e-11
# step of a coefficient for a derivative, as a part of what would change the output by its size; a
# model that is linear in them may go as far as it likes
STEPS = {"linear": 1.0, "pchip": 1e-4}
# root of a ridge, as a part of each column, for terms that the data hardly tell apart
RIDGE = 1e-5
# coefficients whose derivatives are computed together
TOGETHER = 16
# part of the output below which coefficients count for nothing at a place
NOTHING = 1e-12


def shaped(
    model: Model, curves: Sequence[Curve], segmentation: Sequence[SegmentedCurve], recipe: Recipe
) -> Model:
    """Return the fused model with coefficients that keep what the recipe says of them and of the
    shape; the model itself where it says nothing.

    Raises FitError where no coefficients of the chosen terms do.
    """
    body, asked = model.body, asked_of(recipe.fit)
    assert isinstance(body, Pieces)
    if not body.segments:  # the backbone stands alone
        return verified(model, curves, recipe.fit)
    region = region_of(model, curves, recipe.fit) if asked else None
    if region is None and not recipe.bounds:
        return model
    if region is not None:
        refuse_unsupported(model, curves, recipe.fit, fewest=0)
    exchange = _Exchange(model, body, _factor(body, curves, segmentation, recipe), recipe.bounds)
    if region is not None:
        exchange.until_kept(region.asks(asked), region)
    kept = replace(model, body=_with_coefficients(body, exchange.theta))
    return with_shape(model, kept, curves, region, recipe.fit, exchange.where())


def _factor(
    body: Pieces, curves: Sequence[Curve], segmentation: Sequence[SegmentedCurve], recipe: Recipe
) -> Array:
    """Return the triangular factor of the regressors of all segments, in the target's unit, (k, k):
    all that the sum of squares needs of the samples.
    """
    from scipy.linalg import block_diag

    training = {curve.id: curve for curve in training_curves(curves, recipe.level is not None)}
    rows = {one.id: (curve.curve, one.rows) for curve in segmentation for one in curve.segments}
    blocks: list[Any] = []
    unsure = uncertainty_of(recipe.target)
    for segment in body.segments:
        curve, own = rows[segment.id]
        given = [unsure] if unsure in training[curve].columns else []
        samples = samples_at(training[curve].columns, own, (*segment.scaling.variables, *given))
        z = scaled_inputs(segment.scaling, samples)
        P = dictionary_matrix([parse(text) for text in segment.terms], z, len(own))
        P = P / samples[unsure][:, None] if given else P
        blocks.append(np.linalg.qr(segment.scaling.y_slope * P, mode="r"))
    return np.asarray(block_diag(*blocks))


def _with_coefficients(body: Pieces, theta: Array) -> Pieces:
    """Return the pieces with other coefficients; those that changed have no standard error."""
    parts = iter(np.split(theta, np.cumsum([len(one.theta) for one in body.segments])))

    def changed(one: SegmentFunction) -> SegmentFunction:
        own = next(parts)
        same = np.allclose(own, one.theta, rtol=1e-9, atol=0.0)
        return one if same else replace(one, theta=own, theta_error=np.full(len(own), np.nan))

    curves = [replace(c, segments=tuple(map(changed, c.segments))) for c in body.curves]
    return replace(body, curves=tuple(curves))


def _of_coefficients(body: Pieces, names: Sequence[str]) -> Pieces:
    """Return the pieces with their coefficients as inputs of these names: `name*term` with the
    coefficient one.
    """
    left, everywhere = iter(names), dict.fromkeys(names, (-1e300, 1e300))
    sides = {**body.fusion.extrapolation, **dict.fromkeys(names, ("continue", "continue"))}

    def opened(one: SegmentFunction) -> SegmentFunction:
        own = [next(left) for _ in one.terms]
        ones, scaling = np.ones(len(own)), one.scaling
        return replace(
            one,
            terms=tuple(f"{name}*({term})" for name, term in zip(own, one.terms, strict=True)),
            theta=ones,
            scaling=replace(
                scaling,
                variables=(*scaling.variables, *own),
                slope=np.append(scaling.slope, ones),
                intercept=np.append(scaling.intercept, 0 * ones),
            ),
        )

    curves = [
        replace(c, segments=tuple(map(opened, c.segments)), limits={**c.limits, **everywhere})
        for c in body.curves
    ]
    return replace(body, curves=tuple(curves), fusion=replace(body.fusion, extrapolation=sides))


class _Exchange:
    """The inequalities so far, `D theta >= d`, and the coefficients `theta` that meet them.

    `stencils` has those of the shape, each with the row of D that it begins at.
    """

    def __init__(
        self, model: Model, body: Pieces, R: Array, bounds: Mapping[str, tuple[float, float]]
    ) -> None:
        self.model, self.body = model, body
        self.start = np.concatenate([one.theta for one in body.segments])
        self.inputs = [one.name for one in model.inputs]
        self.names = [f"coefficient_{number}" for number in range(len(self.start))]
        self.value = evaluator(
            pieces_program(_of_coefficients(body, self.names), [*self.inputs, *self.names])
        )
        y, lengths = R @ self.start, np.linalg.norm(R, axis=0)
        lengths[lengths == 0] = 1.0
        self.steps = STEPS[body.fusion.levels] * (np.linalg.norm(y) or 1.0) / lengths
        Q, self.R = np.linalg.qr(np.vstack([R, RIDGE * np.diag(lengths)]))
        self.f = Q.T @ np.append(y, 0 * y)
        self.stencils: list[tuple[int, Stencils]] = []
        self.D, self.d = self._bounds(bounds)
        self._solve()

    def _bounds(self, bounds: Mapping[str, tuple[float, float]]) -> tuple[Array, Array]:
        """Return the inequalities of bounds of coefficients in the target's unit, by term."""
        terms = [(term, one.scaling.y_slope) for one in self.body.segments for term in one.terms]
        of_all = np.array([bounds.get(term, (-np.inf, np.inf)) for term, _ in terms])
        slopes = np.diag([slope for _, slope in terms])
        D, d = np.vstack([slopes, -slopes]), np.append(of_all[:, 0], -of_all[:, 1])
        return D[np.isfinite(d)], d[np.isfinite(d)]

    def _solve(self) -> None:
        """Solve, with the inequalities as they are; raise FitError where they contradict."""
        solution = least_squares_under(self.R, self.f, self.D, self.d)
        kept = (self.D @ self.start >= self.d).all()
        self.theta, self.force = self.start if kept else solution.theta, solution.force
        if not solution.met:
            places = dict.fromkeys(one.told for one in self.binding())
            raise FitError(
                "fit.shape: no coefficients of the chosen terms keep it: "
                f"{'; '.join([*places][:3]) or 'bounds of coefficients'}",
                "allow more terms or others (fit.max_terms, dictionary), raise fit.slack, or ask "
                "for less",
            )

    def binding(self) -> list[Stencils]:
        """Return the stencils whose inequalities bind, one by one."""
        return [
            stencils.at(np.array([row]))
            for first, stencils in self.stencils
            for row in np.flatnonzero(self.force[first : first + len(stencils.nodes)])
        ]

    def where(self) -> dict[Asked, Ranges]:
        """Return the range of the inputs in which each word binds."""
        found: dict[Asked, Ranges] = {}
        for one in self.binding():
            own = {name: extremes(x) for name, x in one.columns.items()}
            found[one.asked] = united([found.get(one.asked, {}), own])
        return found

    def values(self, columns: Columns) -> Array:
        """Return the output at inputs, (n,) each."""
        n = len(next(iter(columns.values())))
        found = self.value({**columns, **dict(zip(self.names, self.theta, strict=True))})[0]
        return np.asarray(found + backbone_values(self.body.backbone, columns, n))

    def derivatives(self, columns: Columns) -> Array:
        """Return the derivatives of the output by the coefficients, (n, k)."""
        at, parts = dict(zip(self.names, self.theta, strict=True)), []
        start = self.value({**columns, **at})[0]
        for first in range(0, len(self.names), TOGETHER):
            own = slice(first, first + TOGETHER)
            steps = np.repeat(np.diag(self.steps[own]), len(start), axis=1)
            moved = dict(zip(self.names[own], self.theta[own, None] + steps, strict=True))
            tiled = {name: np.tile(x, len(steps)) for name, x in columns.items()}
            found = self.value({**tiled, **at, **moved})[0].reshape(len(steps), len(start))
            parts.append(found - start)
        return np.asarray(np.vstack(parts).T / self.steps)

    def until_kept(self, asked: Sequence[Asked], region: Region) -> None:
        """Add inequalities until the shape is kept on a fine grid, and close to the places where it
        binds.
        """
        axes, cells = region.axes(program_of(self.model).knots, FINE), region.nodes_along(FINE)
        clear = _widened(axes, region.holds(nodes_of(axes)))
        self._on([stencils_on(axes, one, clear) for one in asked], region)
        for closer in range(CLOSER):
            reach = (2 / (CLOSE - 1)) ** closer / cells
            steps = {name: reach * (high - low) for name, (low, high) in region.ends.items()}
            self._on([_about(one, steps, region) for one in self.binding()], region)

    def _on(self, every: Sequence[Stencils], region: Region) -> None:
        """Add inequalities until none of the stencils is violated."""
        if not (every := [one for one in every if len(one.nodes)]):
            return
        for _ in range(ROUNDS):
            values = self._at_nodes(every, self.values)
            rises = [one.of(own) for one, own in zip(every, values, strict=True)]
            worst = [np.argsort(own)[:ADDED] for own in rises]
            least = -ROUNDING * region.span
            violated = [
                one.at(rows[own[rows] < least])
                for one, own, rows in zip(every, rises, worst, strict=True)
                if own.min(initial=0.0) < least
            ]
            if not violated:
                return
            self._add(violated)
            self._solve()
        raise FitError(
            f"fit.shape: no coefficients that keep it were found, {violated[0].told}",
            "interpolate linearly (`fuse: {levels: linear}`), or ask for less",
        )

    def _at_nodes(self, every: Sequence[Stencils], of: Callable[[Columns], Array]) -> list[Array]:
        """Return the values or derivatives at the nodes of each, all computed together."""
        nodes = {id(one.columns): one.columns for one in every}
        sizes = [len(one[self.inputs[0]]) for one in nodes.values()]
        columns = {n: np.concatenate([one[n] for one in nodes.values()]) for n in self.inputs}
        parts = dict(zip(nodes, np.split(of(columns), np.cumsum(sizes)[:-1]), strict=True))
        return [parts[id(one.columns)] for one in every]

    def _add(self, violated: Sequence[Stencils]) -> None:
        """Add the inequality of each stencil, linear in the coefficients about those so far."""
        values, slopes = (self._at_nodes(violated, of) for of in (self.values, self.derivatives))
        for one, y, dy in zip(violated, values, slopes, strict=True):
            rows = one.of(dy)
            counts = np.linalg.norm(rows * self.steps, axis=1) > NOTHING * np.abs(y).max()
            self.stencils.append((len(self.D), one.at(counts)))
            self.D = np.vstack([self.D, rows[counts]])
            self.d = np.append(self.d, (rows @ self.theta - one.of(y))[counts])


def _widened(axes: Mapping[str, Array], inside: BoolArray) -> BoolArray:
    """Return a region with the nodes beside it, (n,), so that a finer grid has no more."""
    from scipy.ndimage import binary_dilation

    shape = tuple(map(len, axes.values()))
    beside = np.ones((3,) * len(shape), dtype=np.bool_)
    return np.asarray(binary_dilation(inside.reshape(shape), beside).ravel())


def _about(stencil: Stencils, steps: Mapping[str, float], region: Region) -> Stencils:
    """Return the stencils of a grid about one, a step to each side of its middle."""
    middles = {name: float(x[stencil.nodes[0]].mean()) for name, x in stencil.columns.items()}
    reach = np.linspace(-1, 1, CLOSE)
    axes = {name: np.unique(x + reach * steps.get(name, 0.0)) for name, x in middles.items()}
    return stencils_on(axes, stencil.asked, _widened(axes, region.holds(nodes_of(axes))))
