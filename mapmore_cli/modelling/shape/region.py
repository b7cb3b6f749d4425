"""Describe the region in which a shape is required: the training range of each curve, without the
places at which the muscle is almost slack.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, Ends
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.ranges import OUTSIDE_TOLERANCE, InputRange, limits
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.modelling.shape.stencils import ShapeWord

if TYPE_CHECKING:
    from scipy.sparse import csr_array

# largest total number of cells in which training samples are averaged
CELLS = 4096
# largest number of evenly spaced nodes of a grid along one input
MOST = 400
# distance of the additional nodes beside a knot, as a fraction of the range of the input
BESIDE = 1e-6


@dataclass(frozen=True)
class Region:
    """Region in which a model must keep a shape: the training range of each curve, extended by the
    fraction `beyond`. Places at which the training output lies in the lowest part of its range (the
    fraction `slack`) do not belong to the region.

    Training samples are averaged in small cells, so that hysteresis and noise are averaged too.
    `places`, (c, inputs), and `values`, (c,), are the means of the inputs and of the output in each
    cell, and `counts`, (c,), are the numbers of samples. `fixed` holds the inputs that do not vary,
    (1,) each.
    """

    names: tuple[str, ...]
    places: Array
    values: Array
    counts: Array
    fixed: Columns
    ranges: tuple[InputRange, ...]
    fit: Fit

    @property
    def span(self) -> float:
        """Width of the range of the training output."""
        return float(np.ptp(self.values))

    @property
    def ends(self) -> dict[str, Ends]:
        """Smallest and largest value of each input in the region."""
        margin = {
            input_range.name: self.fit.beyond * (input_range.high - input_range.low).max()
            for input_range in self.ranges
        }
        return {
            input_range.name: (
                input_range.low.min() - margin[input_range.name],
                input_range.high.max() + margin[input_range.name],
            )
            for input_range in self.ranges
        }

    def between(self, columns: Columns) -> tuple[csr_array, BoolArray]:
        """Return the weights of the cells, shape (n, c), with which the output is interpolated at
        given places, and a mask, shape (n,), of the places that lie between cells.

        The interpolation is linear in the simplex whose corners are the cells around a place. At a
        place outside all simplices, the output of the nearest cell is used, although the inputs of
        this cell may be very different.
        """
        from scipy.sparse import csr_array
        from scipy.spatial import ConvexHull, Delaunay, KDTree, QhullError

        middle = self.places.min(axis=0)
        width = np.ptp(self.places, axis=0)
        places = (self.places - middle) / width
        asked = (np.column_stack([columns[name] for name in self.names]) - middle) / width
        n, d = asked.shape
        vertices = np.repeat(np.asarray(KDTree(places).query(asked)[1])[:, None], d + 1, axis=1)
        shares = np.tile(np.eye(d + 1)[0], (n, 1))
        if d == 1:
            order = np.argsort(places[:, 0])
            right = np.searchsorted(places[order, 0], asked[:, 0]).clip(1, len(order) - 1)
            vertices = np.column_stack([order[right - 1], order[right]])
            low, high = places[vertices, 0].T
            share = ((asked[:, 0] - low) / (high - low)).clip(0, 1)
            shares = np.column_stack([1 - share, share])
            # with one input, no place between the ends is outside
            inside = np.ones(n, dtype=bool)
        else:
            simplex = np.full(n, -1)
            try:
                net = Delaunay(places)
                faces = ConvexHull(places).equations
                # Places outside the hull are left out: `find_simplex` would search all simplices.
                near = (asked @ faces[:, :-1].T + faces[:, -1]).max(axis=1) < OUTSIDE_TOLERANCE
                simplex[near] = net.find_simplex(asked[near])
            except QhullError:  # no simplex exists if all samples lie on a line
                pass
            if (inside := simplex >= 0).any():
                transform = net.transform[simplex[inside]]
                first = np.einsum("nij,nj->ni", transform[:, :d], asked[inside] - transform[:, d])
                shares[inside] = np.column_stack([first, 1 - first.sum(axis=1)])
                vertices[inside] = net.simplices[simplex[inside]]
        starts = np.arange(0, vertices.size + 1, d + 1)
        shape = (n, len(places))
        return csr_array((shares.ravel(), vertices.ravel(), starts), shape=shape), inside

    def output(self, columns: Columns) -> Array:
        """Return the training output at the given places, shape (n,). Between cells, it is
        interpolated linearly. At a place that does not lie between cells, it is the output of the
        nearest cell.
        """
        return self.between(columns)[0] @ self.values

    def holds(self, columns: Columns) -> BoolArray:
        """Return a mask of the places that lie in the region, shape (n,)."""
        inside = np.asarray(self.output(columns) > self.values.min() + self.fit.slack * self.span)
        for input_range in self.ranges:
            (low, high), x = input_range.ends(columns), columns[input_range.name]
            margin = (self.fit.beyond + OUTSIDE_TOLERANCE) * (high - low)
            inside &= (x >= low - margin) & (x <= high + margin)
        return inside

    def asks(self, asked: Sequence[ShapeWord]) -> list[ShapeWord]:
        """Return those of the conditions `asked` that can be tested. The quantity of such a
        condition is the output itself, or an input that varies.
        """
        return [word for word in asked if word.word == "positive" or word.quantity in self.names]

    def nodes_along(self, nodes: int) -> int:
        """Return the number of evenly spaced nodes along each input, if the grid has `nodes`
        nodes.
        """
        return int(np.clip(round(nodes ** (1 / len(self.names))), 3, MOST))

    def axes(self, knots: Mapping[str, Sequence[float]], nodes: int) -> dict[str, Array]:
        """Return the places of the grid lines along each input, for a grid of about `nodes` nodes.
        Most lines are evenly spaced over the range. Further lines lie at each knot and close to
        both sides of it, because the model may have a kink there. A further line lies at zero,
        because a rate is zero when the muscle is at rest.
        """
        axes = dict(self.fixed)
        for name, (low, high) in self.ends.items():
            even = np.linspace(low, high, self.nodes_along(nodes))
            near = np.add.outer(knots.get(name, ()), np.array([-1, 0, 1]) * BESIDE * (high - low))
            near = np.append(near, 0.0)
            axes[name] = np.unique(np.append(even, near[(near >= low) & (near <= high)]))
        return axes


def region_of(model: Model, curves: Sequence[Curve], fit: Fit) -> Region | None:
    """Return the region in which a model must keep a shape, from the training samples of `curves`.
    Return None if no input varies, if the output is constant, or if the range of the model is
    unknown.
    """
    ranges = tuple(limits(getattr(model.body, "ranges", ()), model.level))
    return region_within(ranges, curves, model.output.name, model.input_names, fit)


def region_within(
    ranges: Sequence[InputRange],
    curves: Sequence[Curve],
    target: str,
    inputs: Sequence[str],
    fit: Fit,
) -> Region | None:
    """Return the region for a target and inputs whose training `ranges` are known."""
    samples = pooled_training(curves)
    varied = tuple(
        input_range
        for input_range in ranges
        if (input_range.high > input_range.low).any() and input_range.name in samples
    )
    names = tuple(input_range.name for input_range in varied)
    y = samples[target]
    if not names or np.ptp(y) == 0:
        return None
    X = np.column_stack([samples[name] for name in names])
    width = np.maximum(np.ptp(X, axis=0), np.finfo(float).tiny)
    cells = ((X - X.min(axis=0)) / width * max(4, CELLS ** (1 / len(names)))).astype(int)
    _, number, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    *places, values = (np.bincount(number.ravel(), x) / count for x in (*X.T, y))
    fixed = {name: samples[name][:1] for name in inputs if name not in names}
    return Region(
        names, np.column_stack(places), values, count.astype(np.float64), fixed, varied, fit
    )
