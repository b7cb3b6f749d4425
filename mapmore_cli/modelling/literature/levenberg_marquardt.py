"""Levenberg-Marquardt and the simplex from several starting values, for parity with the papers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.expressions import NotFinite
from mapmore_cli.modelling.literature.descent import SEED, STARTS, draw, lowest, rivals
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
            residual, start, jacobian, method="lm", x_scale="jac", xtol=TOLERANCE, ftol=TOLERANCE, gtol=TOLERANCE, max_nfev=EVALUATIONS
        )
    except NotFinite:
        return None
    return found if found.cost < REFUSED else None


SIMPLEX = "simplex"
FMINSEARCH = 1e-4  # of coordinates and of the sum of squares, fminsearch's
OVERFLOW = 1e300  # stands for an overflow
PER_PARAMETER = 200  # evaluations, fminsearch's


@dataclass
class SimplexEnd:
    """Where a descent ended: parameters, their sum of squares, and whether it had converged."""

    x: Array
    cost: float
    success: bool


def fit_simplex(problem: Problem) -> Solution:
    """Solve `problem` by ten descents of a simplex over all parameters at once, with the settings of `fminsearch`.

    H does not say how its random starts are drawn. Here a linear parameter starts where its term alone is at most as large as the target
    (uniform, of either sign), a nonlinear one in its intervals. Sums of squares are over means of neighbouring samples where there are
    many. The status is `converged`, `stopped_by_limit` (of evaluations), or `failed` where every start overflowed.
    """
    from scipy.optimize import minimize

    few, m = problem.condensed(), len(problem.linear)
    rng = np.random.default_rng(SEED)
    places = list(draw(problem.nonlinear)) if problem.nonlinear else [np.empty(0)] * STARTS
    ends: list[SimplexEnd] = []
    for place in places:
        try:
            lengths = np.linalg.norm(few.regressors(place), axis=0)
        except NotFinite:
            continue
        units = np.linalg.norm(few.target(place)) / np.where(lengths > 0.0, lengths, 1.0)

        start = np.concatenate([rng.uniform(-1.0, 1.0, m), place])
        options: Any = {"xatol": FMINSEARCH, "fatol": FMINSEARCH * _cost(0.0 * start, few, units), "maxfev": PER_PARAMETER * len(start)}
        end = minimize(_cost, start, args=(few, units), method="Nelder-Mead", options=options)
        ends.append(SimplexEnd(np.concatenate([end.x[:m] * units, end.x[m:]]), float(end.fun), bool(end.success)))
    if not ends:
        return failure(problem, SIMPLEX)
    best, agreement = lowest(ends, STARTS)
    return Solution(best.x[:m], best.x[m:], "converged" if best.success else "stopped_by_limit", SIMPLEX, (agreement,))


def _cost(x: Array, problem: Problem, units: Array) -> float:
    """Sum of squares at the linear parameters, in their `units`, and the coordinates that follow them in x."""
    m = len(units)
    residual = problem.residual(x[:m] * units, x[m:])
    value = float(residual @ residual)
    return value if np.isfinite(value) else OVERFLOW
