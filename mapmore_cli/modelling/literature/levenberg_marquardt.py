"""Levenberg-Marquardt from several starting values, for parity with the papers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.expressions import NotFinite
from mapmore_cli.modelling.literature.multistart import draw, lowest, rivals
from mapmore_cli.modelling.literature.problem import Problem, Solution, failure

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

METHOD = "levenberg_marquardt"
TOLERANCE = 1e-15
EVALUATIONS = 400
REFUSED = 1e100  # stands for an overflow, so that the step is not taken


def fit(problem: Problem) -> Solution:
    """Solve `problem` by MINPACK's Levenberg-Marquardt, all parameters at once and without bounds.

    The linear parameters start at zero, the nonlinear ones at seeded random places of their intervals, or all of them at the problem's
    published start; the lowest sum of squares wins, and a note says how many starts came to it. The status is `converged`,
    `stopped_by_limit`, or `failed` where every start overflowed.
    """
    starts = list(_starts(problem))
    ends = [end for start in starts if (end := _descend(problem, start)) is not None]
    if not ends:
        return failure(problem, METHOD)
    best, agreement = lowest(ends, len(starts))
    m = len(problem.linear)
    status = "converged" if best.status > 0 else "stopped_by_limit"
    others = tuple((end.x[:m], end.x[m:]) for end in rivals([end for end in ends if end.status > 0], best))
    return Solution(best.x[:m], best.x[m:], status, METHOD, (agreement,) if len(starts) > 1 else (), others)


def _starts(problem: Problem) -> Iterator[Array]:
    """Places to descend from, `(m + k,)`: the published one where it is asked for, else seeded ones."""
    if problem.start is not None:
        names = (*problem.linear, *(parameter.name for parameter in problem.nonlinear))
        units = np.concatenate([np.ones(len(problem.linear)), problem.spans])
        yield np.array([problem.start[name] for name in names]) * units
        return
    for place in draw(problem.nonlinear):
        yield np.concatenate([np.zeros(len(problem.linear)), place])


def _descend(problem: Problem, start: Array) -> OptimizeResult | None:
    """Return the nearest minimum, of residuals over the largest target so that the unit is no matter; None where the formula overflows."""
    from scipy.optimize import least_squares

    m = len(problem.linear)
    unit = float(np.abs(problem.y).max()) or 1.0

    def residual(x: Array) -> Array:
        values = problem.residual(x[:m], x[m:]) / unit
        return np.where(np.isfinite(values), values, REFUSED)

    def jacobian(x: Array) -> Array:
        return problem.jacobian(x[:m], x[m:]) / unit

    try:
        found = least_squares(
            residual,
            start,
            jacobian,
            method="lm",
            x_scale="jac",
            xtol=TOLERANCE,
            ftol=TOLERANCE,
            gtol=TOLERANCE,
            max_nfev=EVALUATIONS,
        )
    except NotFinite:
        return None
    return found if found.cost < REFUSED else None
