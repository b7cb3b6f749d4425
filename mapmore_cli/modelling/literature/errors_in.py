"""Least squares on the error of an input: for a table in which the target was set and that input was measured.

Where weights hang on a muscle and its length is read, the noise lies in the strain. Here the formula is solved for the input,
`f(x, parameters) = y`, and `sum (x - x_measured)^2` is minimised, from a fit of the target on. By the implicit function theorem
`dx/dparameter = -(df/dparameter) / (df/dx)` at the root. Rows at which the formula does not depend on the input say nothing of it: a force
that is proportional to the pressure, at no pressure.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.modelling.expressions import Expression, derivative, evaluate
from mapmore_cli.modelling.literature.descent import descend, lowest, onto_bounds
from mapmore_cli.modelling.literature.problem import Problem, Solution

REACH = 1.0
"""Roots are looked for beyond the measured range by this share of it on each side."""

CELLS, BISECTIONS = 64, 45
"""The range is scanned in so many cells; the root that is nearest to what was measured is then halved down to rounding."""

FLAT = 1e-9
"""Of the largest target: a formula that varies less along the input does not depend on it."""

TOLERANCE = 1e-12
"""As W's."""


@dataclass(frozen=True)
class Along:
    """A problem seen along one of its inputs, `name`."""

    problem: Problem
    name: str

    @property
    def measured(self) -> Array:
        """The input as measured, (n,)."""
        return self.problem.columns[self.name]

    def value(self, expression: Expression, x: Array, place: Array) -> Array:
        """Return an expression of inputs and parameters at a place of the search, with the input at `x`, (n,)."""
        values = self.problem.values(*self.problem.split(place))
        columns = {**self.problem.columns, self.name: x, **{name: np.asarray(value) for name, value in values.items()}}
        return evaluate(expression, columns, len(x))

    def roots(self, place: Array, *, beyond: bool = True) -> Array:
        """Return the input at which the formula gives the target, nearest to what was measured, (n,).

        Without one within reach, it is where a straight line of the mean slope leads from the end at which less is missing; else NaN.
        """
        edges, missing = self.scan(place)
        crosses = np.sign(missing[:-1]) * np.sign(missing[1:]) <= 0
        middle = (edges[:-1] + edges[1:]) / 2
        cell = np.argmin(np.where(crosses, np.abs(middle[:, None] - self.measured), np.inf), axis=0)
        left, right = edges[cell], edges[cell + 1]
        rises = np.take_along_axis(missing, cell[None] + 1, axis=0)[0] > 0
        for _ in range(BISECTIONS):
            x = (left + right) / 2
            above = self.value(self.problem.expression, x, place) - self.problem.y > 0
            left, right = np.where(above == rises, left, x), np.where(above == rises, x, right)
        first, last = np.abs(missing[0]), np.abs(missing[-1])
        slope = np.maximum(np.abs(missing[-1] - missing[0]), 1e-12 * np.abs(self.problem.y).max()) / (edges[-1] - edges[0])
        line = np.where(first < last, edges[0] - first / slope, edges[-1] + last / slope) if beyond else np.nan
        return np.where(crosses.any(axis=0), (left + right) / 2, line)

    def scan(self, place: Array) -> tuple[Array, Array]:
        """Places along the input, (CELLS + 1,), and what is missing to the target there, (CELLS + 1, n)."""
        low, high = self.measured.min(), self.measured.max()
        span = REACH * (high - low)
        edges = np.linspace(low - span, high + span, CELLS + 1)
        missing = np.stack([self.value(self.problem.expression, np.full(len(self.measured), x), place) - self.problem.y for x in edges])
        return edges, np.where(np.isfinite(missing), missing, np.inf)

    def jacobian(self, place: Array) -> Array:
        """Return derivative of the roots for the parameters, (n, m + k)."""
        x = self.roots(place)
        matrix = np.stack([self.value(self.problem.gradient[name], x, place) for name in self.problem.names], axis=1)
        matrix[:, len(self.problem.linear) :] /= self.problem.spans
        return -(matrix.T / self.slope(x, place)).T

    def slope(self, x: Array, place: Array) -> Array:
        """Return derivative of the formula for the input, (n,); not zero."""
        slope = self.value(derivative(self.problem.expression, self.name), x, place)
        least = 1e-9 * float(np.abs(self.problem.y).max() or 1.0)
        return np.where(np.abs(slope) < least, least, slope)


def refined(problem: Problem, solution: Solution, name: str) -> tuple[Solution, Columns, Array, Array]:
    """Return the minimum of the error of the input `name` that is reached from a fit of the target; its other minima are not told.

    It is in the coordinates of the whole problem. Behind it come the n rows at which the formula depends on the input, with the input where
    the formula gives the target; the errors of the input, and the derivatives of the formula for it, `(n,)` each.
    """
    missing = Along(problem, name).scan(np.concatenate([solution.beta, solution.c]))[1]
    rows = np.ptp(missing, axis=0) > FLAT * float(np.abs(problem.y).max())
    told = replace(problem, columns={one: column[rows] for one, column in problem.columns.items()}, y=problem.y[rows])
    along, rescaled = Along(told, name), told.spans / problem.spans
    count, unit = len(told.linear), float(np.ptp(along.measured)) or 1.0
    low, high = told.bounds
    margin = 1e-3 * np.where(np.isfinite(high - low), high - low, 1.0)
    free = np.full(count, np.inf)
    bounds = np.concatenate([-free, low]), np.concatenate([free, high])
    start = np.concatenate([solution.beta, np.clip(solution.c * rescaled, low + margin, high - margin)])

    def system(places: Array) -> tuple[Array, Array]:
        missed = [(along.roots(place) - along.measured) / unit for place in places]
        return np.stack(missed), np.stack([along.jacobian(place) / unit for place in places])

    found, _ = lowest(descend(system, [start], bounds, TOLERANCE), 1)
    place, touched = onto_bounds(found.x, bounds)
    status = "at_bound" if touched and found.converged else found.status
    beta, c = told.split(place)
    moved = Solution(beta, c / rescaled, status, f"{solution.method}, then the error of {name}")
    x = along.roots(place)
    return moved, {**told.columns, name: x}, x - along.measured, along.slope(x, place)
