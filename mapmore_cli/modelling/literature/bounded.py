"""Variable projection with several nonlinear parameters, within their bounds and from several starts.

The linear parameters follow from the coordinates c by least squares, so that only the k coordinates are sought: Levenberg and Marquardt's
method minimises `|r(c)|^2`, `r(c) = Phi(c) Phi(c)^+ y - y`, from all starts at once.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.literature import linear
from mapmore_cli.modelling.literature.descent import Bounds, End, descend, onto_bounds
from mapmore_cli.modelling.literature.multistart import STARTS, draw, lowest, rivals
from mapmore_cli.modelling.literature.problem import Problem, Solution, at_limit, failure

METHOD = "variable projection"
TOLERANCE = 1e-12  # of the starts (W section III)
FINAL_TOLERANCE = 1e-15


def fit(problem: Problem) -> Solution:
    """Solve `problem` from seeded starts, with the nonlinear parameters within the outermost ends of their intervals.

    The starts go over means of neighbouring samples where there are many; from the lowest end, the search is finished on all samples. A
    note says how many starts agree, and one which parameter ends at a bound. The status is `converged`, `at_bound`, `stopped_by_limit`,
    or `failed` where every start overflowed.
    """
    ends = _descents(problem.condensed(), list(draw(problem.nonlinear)), TOLERANCE)
    if not ends:
        return failure(problem, METHOD)
    best, agreement = lowest(ends, STARTS)
    finished = _descents(problem, [best.x], FINAL_TOLERANCE)
    if not finished:
        return failure(problem, METHOD)
    end = finished[0]
    c, touched = onto_bounds(end.x, _bounds(problem))
    limits = [at_limit(problem.nonlinear[i], c[i]) for i in touched]
    status = "at_bound" if limits else "converged" if end.converged else "stopped_by_limit"
    others = [other.x for other in rivals([end for end in ends if end.converged], best)]
    places = np.array([c, *others])
    betas = _projected(problem, places).beta
    return Solution(betas[0], c, status, METHOD, (agreement, *limits), tuple(zip(betas[1:], others, strict=True)))


def _descents(problem: Problem, starts: Sequence[Array], tolerance: float) -> list[End]:
    """Return the nearest minima within the bounds, but for starts in which the formula overflows."""
    unit = float(np.linalg.norm(problem.target(starts[0]))) or 1.0

    def system(c: Array) -> tuple[Array, Array]:
        """r and `dr/dc`, but for a part within the regressors' space, which has no share in the gradient (Kaufman)."""
        found = _projected(problem, c)
        jacobian = problem.each_slopes(found.beta, c)
        outside = jacobian - found.basis @ (found.basis.transpose(0, 2, 1) @ jacobian)
        return found.residual / unit, outside / unit

    return descend(system, starts, _bounds(problem), tolerance)


def _projected(problem: Problem, c: Array) -> linear.LinearFits:
    return linear.solve_each(problem.each_regressors(c), problem.each_target(c))


def _bounds(problem: Problem) -> Bounds:
    lowest, highest = zip(*(parameter.bounds for parameter in problem.nonlinear), strict=True)
    return np.array(lowest), np.array(highest)
