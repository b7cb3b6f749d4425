"""Variable projection with several nonlinear parameters, within their bounds and from several starts.

The linear parameters follow from the coordinates c by least squares, so that only the k coordinates are sought: the trust region reflective
method minimises `|r(c)|^2`, `r(c) = Phi(c) Phi(c)^+ y - y`.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.literature import linear, trust_region
from mapmore_cli.modelling.literature.multistart import STARTS, draw, lowest, rivals
from mapmore_cli.modelling.literature.problem import Problem, Solution, at_limit, failure
from mapmore_cli.modelling.terms import NotFinite

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

METHOD = "variable projection"
TOLERANCE = 1e-12  # of the starts (W section III)
FINAL_TOLERANCE = 1e-15


def fit(problem: Problem) -> Solution:
    """Solve `problem` from seeded starts, with the nonlinear parameters within the outermost ends of their intervals.

    The starts go over means of neighbouring samples where there are many; from the lowest end, the search is finished on all samples. A
    note says how many starts agree, and one which parameter ends at a bound. The status is `converged`, `at_bound`, `stopped_by_limit`,
    or `failed` where every start overflowed.
    """
    few = problem.condensed()
    ends = [end for start in draw(problem.nonlinear) if (end := _descend(few, start, TOLERANCE)) is not None]
    if not ends:
        return failure(problem, METHOD)
    best, agreement = lowest(ends, STARTS)
    end = _descend(problem, best.x, FINAL_TOLERANCE)
    if end is None:
        return failure(problem, METHOD)
    c, touched = trust_region.onto_bounds(end.x, _bounds(problem))
    limits = [at_limit(problem.nonlinear[i], c[i]) for i in touched]
    status = "at_bound" if limits else "converged" if end.status > 0 else "stopped_by_limit"
    others = tuple((_project(problem, other.x).beta, other.x) for other in rivals([end for end in ends if end.status > 0], best))
    return Solution(_project(problem, c).beta, c, status, METHOD, (agreement, *limits), others)


def _descend(problem: Problem, start: Array, tolerance: float) -> OptimizeResult | None:
    """The nearest minimum within the bounds; None where the formula overflows on the way."""
    unit = float(np.linalg.norm(problem.target(start))) or 1.0

    @lru_cache(maxsize=2)  # the derivative is asked for where the residual was just computed
    def projection(c: tuple[float, ...]) -> linear.LinearFit:
        return _project(problem, np.array(c))

    def residual(c: Array) -> Array:
        return projection(tuple(c)).residual / unit

    def slopes(c: Array) -> Array:
        """`dr/dc` but for a part within the regressors' space, which has no share in the gradient (Kaufman)."""
        projected = projection(tuple(c))
        jacobian = problem.jacobian(projected.beta, c)[:, len(problem.linear) :]
        return np.asarray((jacobian - projected.basis @ (projected.basis.T @ jacobian)) / unit)

    try:
        return trust_region.descend(residual, slopes, start, _bounds(problem), tolerance)
    except NotFinite:
        return None


def _project(problem: Problem, c: Array) -> linear.LinearFit:
    return linear.solve(problem.regressors(c), problem.target(c))


def _bounds(problem: Problem) -> tuple[Array, Array]:
    lowest, highest = zip(*(parameter.bounds for parameter in problem.nonlinear), strict=True)
    return np.array(lowest), np.array(highest)
