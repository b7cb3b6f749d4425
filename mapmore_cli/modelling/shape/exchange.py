"""Fit coefficients so that the output has a required shape. This is least squares with inequalities
on a grid of the output as constraints.

Inequalities are added at all places at which a solution violates the shape. The grid is refined
around the inequalities that bind, until the shape is violated nowhere (an exchange method for
semi-infinite problems: Hettich and Kortanek 1993). If the output is not linear in its coefficients,
the inequalities are linearised at the last solution.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, Ranges, extremes
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import united
from mapmore_cli.modelling.programs import program_of
from mapmore_cli.modelling.shape.least_squares import least_squares_under
from mapmore_cli.modelling.shape.region import Region
from mapmore_cli.modelling.shape.stencils import ShapeWord, Stencils, nodes_of, stencils_on

FINE = 40_000  # number of nodes of the grid on which the shape must hold
CLOSE = 9  # number of nodes along each input of the finer grid around a binding inequality
CLOSER = 3  # number of refinements of the finer grid around a binding inequality
ROUNDS = 60  # largest number of times that inequalities are added on one grid
ADDED = 200  # largest number of inequalities that are added at once for one condition
# smaller violations, as a fraction of the range of the training output, are ignored
ROUNDING = 1e-11
# square root of a small ridge, divided by the length of each column of the regressor matrix
# The ridge keeps coefficients near their starting values if the data do not determine them.
RIDGE = 1e-11
# number of coefficients whose derivatives are computed together, to limit the memory
TOGETHER = 16
# The coefficients of an inequality between very close places may be nothing but rounding errors.
# An inequality is ignored if its coefficients are smaller than this many rounding errors.
ROUNDING_ERRORS = 1000


Values = Callable[[Array, Columns], Array]
"""Function that returns the output for coefficients, (k,) or (k, n), at inputs, (n,) each."""


class Exchange:
    """State of the exchange method: the inequalities so far, `D theta >= d`, and the coefficients
    `theta` that satisfy them with the smallest `|R (theta - start)|`. `start` holds the
    coefficients of the `model` without the shape, and `value` is a function that returns the output
    for given coefficients.

    The derivatives with respect to the coefficients are difference quotients. The change of a
    coefficient in a difference quotient is `step` times the change that would double the output.
    For an output that is linear in its coefficients, any step is exact. `stencils` holds the
    inequalities of the shape, each with its first row in D.
    """

    def __init__(
        self,
        model: Model,
        value: Values,
        start: Array,
        R: Array,
        bounds: tuple[Array, Array],
        step: float = 1.0,
    ) -> None:
        self.model = model
        self.value = value
        self.start = start
        self.inputs = model.input_names
        self.linear = step == 1.0
        self.D, self.d = bounds
        y = R @ self.start
        lengths = np.linalg.norm(R, axis=0)
        lengths[lengths == 0] = 1.0
        self.steps = step * (np.linalg.norm(y) or 1.0) / lengths
        _, self.R = np.linalg.qr(np.vstack([R, RIDGE * np.diag(lengths)]))
        self.f = self.R @ self.start
        self.R_inverse = np.linalg.inv(self.R)
        self.rounding = np.finfo(float).eps * np.linalg.norm(self.R_inverse / self.steps[:, None])
        self.stencils: list[tuple[int, Stencils]] = []
        self._solve()

    def _solve(self) -> None:
        """Compute the coefficients for the present inequalities. Raise FitError if the inequalities
        contradict each other.
        """
        solution = least_squares_under(self.R, self.f, self.D, self.d)
        kept = (self.D @ self.start >= self.d).all()
        self.theta = self.start if kept else solution.theta
        self.force = solution.force
        if not solution.met:
            places = dict.fromkeys(stencils.told for stencils in self.binding())
            raise FitError(
                "fit.shape: no coefficients of the chosen terms fulfil it: "
                f"{'; '.join([*places][:3]) or 'bounds of coefficients'}",
                "allow more or other terms (fit.max_terms, dictionary), raise fit.slack, "
                "or remove a condition",
            )

    def binding(self) -> list[Stencils]:
        """Return the stencils whose inequalities bind, as one object for each stencil."""
        return [
            stencils.at(np.array([row]))
            for first, stencils in self.stencils
            for row in np.flatnonzero(self.force[first : first + len(stencils.nodes)])
        ]

    def where(self) -> dict[ShapeWord, Ranges]:
        """Return, for each condition of the shape, the ranges of the inputs in which its
        inequalities bind.
        """
        ranges: dict[ShapeWord, Ranges] = {}
        for stencils in self.binding():
            limits = {name: extremes(x) for name, x in stencils.columns.items()}
            ranges[stencils.asked] = united([ranges.get(stencils.asked, {}), limits])
        return ranges

    def _values(self, columns: Columns) -> Array:
        return self.value(self.theta, columns)

    def _slopes(self, columns: Columns) -> Array:
        """Return the derivatives of the output with respect to the coefficients, shape (n, k). If
        the output is linear in the coefficients, the derivatives are computed at zero, because
        rounding errors are larger at large coefficients.
        """
        about = np.zeros_like(self.theta) if self.linear else self.theta
        start = self.value(about, columns)
        parts = []
        for first in range(0, len(self.theta), TOGETHER):
            moves = np.diag(self.steps)[:, first : first + TOGETHER]
            moved = np.repeat(about[:, None] + moves, len(start), axis=1)
            tiled = {name: np.tile(x, moves.shape[1]) for name, x in columns.items()}
            parts.append(self.value(moved, tiled).reshape(-1, len(start)) - start)
        return np.asarray(np.vstack(parts).T / self.steps)

    def until_kept(self, asked: Sequence[ShapeWord], region: Region) -> None:
        """Add inequalities until the model has the shape at all nodes of a fine grid. Then do the
        same on finer grids around the places at which an inequality binds.
        """
        axes = region.axes(program_of(self.model).knots, FINE)
        cells = region.nodes_along(FINE)
        clear = _widened(axes, region.holds(nodes_of(axes)))
        self._on([stencils_on(axes, word, clear) for word in asked], region)
        for closer in range(CLOSER):
            reach = (2 / (CLOSE - 1)) ** closer / cells
            steps = {name: reach * (high - low) for name, (low, high) in region.ends.items()}
            self._on([_grid_about(stencils, steps, region) for stencils in self.binding()], region)

    def _on(self, every: Sequence[Stencils], region: Region) -> None:
        """Add inequalities and solve again, until none of the given stencils is violated."""
        if not (every := [stencils for stencils in every if len(stencils.nodes)]):
            return
        for _ in range(ROUNDS):
            values = self._at_nodes(every, self._values)
            rises = [stencils.of(y) for stencils, y in zip(every, values, strict=True)]
            worst = [np.argsort(rise)[:ADDED] for rise in rises]
            least = -ROUNDING * region.span
            violated = [
                stencils.at(rows[rise[rows] < least])
                for stencils, rise, rows in zip(every, rises, worst, strict=True)
                if rise.min(initial=0.0) < least
            ]
            if not violated or not self._add(violated):
                return
            self._solve()
        raise FitError(
            f"fit.shape: no coefficients with this shape were found: {violated[0].told}",
            "interpolate linearly (`fuse: {levels: linear}`), or remove a condition",
        )

    def _at_nodes(self, every: Sequence[Stencils], of: Callable[[Columns], Array]) -> list[Array]:
        """Evaluate the function `of` (the output or its derivatives) at all nodes of the grids of
        the stencils in `every`. Return one array for each element of `every`. The function is
        called only once.
        """
        nodes = {id(stencils.columns): stencils.columns for stencils in every}
        sizes = [len(columns[self.inputs[0]]) for columns in nodes.values()]
        columns = {n: np.concatenate([inputs[n] for inputs in nodes.values()]) for n in self.inputs}
        parts = dict(zip(nodes, np.split(of(columns), np.cumsum(sizes)[:-1]), strict=True))
        return [parts[id(stencils.columns)] for stencils in every]

    def _add(self, violated: Sequence[Stencils]) -> int:
        """Add the inequality of each stencil, linearised around the present coefficients. Return
        the number of inequalities that were added. An inequality is left out if its coefficients
        are as small as rounding errors.
        """
        before = len(self.D)
        values, slopes = (self._at_nodes(violated, of) for of in (self._values, self._slopes))
        for stencils, y, dy in zip(violated, values, slopes, strict=True):
            rows = stencils.of(dy)
            errors = ROUNDING_ERRORS * self.rounding * np.abs(y).max()
            counts = np.linalg.norm(rows @ self.R_inverse, axis=1) > errors
            self.stencils.append((len(self.D), stencils.at(counts)))
            self.D = np.vstack([self.D, rows[counts]])
            self.d = np.append(self.d, (rows @ self.theta - stencils.of(y))[counts])
        return len(self.D) - before


def _widened(axes: Mapping[str, Array], inside: BoolArray) -> BoolArray:
    """Return a mask of the nodes `inside` a region and of their direct neighbours, shape (n,). All
    nodes of a finer grid that lie in the region are then surrounded by nodes of the mask.
    """
    from scipy.ndimage import binary_dilation

    shape = tuple(map(len, axes.values()))
    beside = np.ones((3,) * len(shape), dtype=np.bool_)
    return binary_dilation(inside.reshape(shape), beside).ravel()


def _grid_about(stencil: Stencils, steps: Mapping[str, float], region: Region) -> Stencils:
    """Return the stencils on a finer grid around the middle of one stencil. Along each input, the
    finer grid extends from the middle to both sides by the distance in `steps`, which is the
    distance between two nodes of the coarser grid.
    """
    middles = {name: float(x[stencil.nodes[0]].mean()) for name, x in stencil.columns.items()}
    reach = np.linspace(-1, 1, CLOSE)
    axes = {
        name: np.unique(np.clip(x + reach * steps.get(name, 0.0), *region.ends.get(name, (x, x))))
        for name, x in middles.items()
    }
    return stencils_on(axes, stencil.asked, _widened(axes, region.holds(nodes_of(axes))))
