"""Levenberg-Marquardt and the simplex from several starting values, for parity with the papers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.expressions import NotFinite
from mapmore_cli.modelling.literature.descent import SEED, STARTS, End, draw, lowest, rivals
from mapmore_cli.modelling.literature.problem import Problem, Solution, failure

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
    status = "converged" if best.converged else "stopped_by_limit"
    others = tuple(problem.split(end.x) for end in rivals(ends, best))
    return Solution(*problem.split(best.x), status, METHOD, (agreement,) if len(starts) > 1 else (), others)


def _starts(problem: Problem) -> Iterator[Array]:
    """Places to descend from, `(m + k,)`: the published one where it is asked for, else seeded ones."""
    zeros = np.zeros(len(problem.linear))
    if problem.start is not None:
        yield np.array([problem.start[name] for name in problem.names]) * np.concatenate([zeros + 1.0, problem.spans])
        return
    for place in draw(problem.nonlinear):
        yield np.concatenate([zeros, place])


def _descend(problem: Problem, start: Array) -> End | None:
    """Return the nearest minimum, of residuals over the largest target so that the unit is no matter; None where the formula overflows."""
    from scipy.optimize import least_squares

    unit = float(np.abs(problem.y).max()) or 1.0

    def residual(x: Array) -> Array:
        values = problem.residual(*problem.split(x)) / unit
        return np.where(np.isfinite(values), values, REFUSED)

    def jacobian(x: Array) -> Array:
        return problem.jacobian(*problem.split(x)) / unit

    limits: Any = {"xtol": TOLERANCE, "ftol": TOLERANCE, "gtol": TOLERANCE, "max_nfev": EVALUATIONS}
    try:
        found = least_squares(residual, start, jacobian, method="lm", x_scale="jac", **limits)
    except NotFinite:
        return None
    return End(found.x, float(found.cost), found.status > 0) if found.cost < REFUSED else None


SIMPLEX = "simplex"
FMINSEARCH = 1e-4  # of coordinates and of the sum of squares, fminsearch's
OVERFLOW = 1e300  # stands for an overflow
PER_PARAMETER = 200  # evaluations, fminsearch's


def fit_simplex(problem: Problem) -> Solution:
    """Solve `problem` by ten descents of a simplex over all parameters at once, with the settings of `fminsearch`.

    H does not say how its random starts are drawn. Here a linear parameter starts where its term alone is at most as large as the target
    (uniform, of either sign), a nonlinear one in its intervals. Sums of squares are over means of neighbouring samples where there are
    many. The status is `converged`, `stopped_by_limit` (of evaluations), or `failed` where every start overflowed.
    """
    from scipy.optimize import minimize

    few, m = problem.condensed(), len(problem.linear)
    rng = np.random.default_rng(SEED)
    ends: list[End] = []
    for place in list(draw(problem.nonlinear)) if problem.nonlinear else [np.empty(0)] * STARTS:
        try:
            lengths = np.linalg.norm(few.regressors(place), axis=0)
        except NotFinite:
            continue
        units = np.concatenate([np.linalg.norm(few.target(place)) / np.where(lengths > 0.0, lengths, 1.0), np.ones(len(place))])

        def cost(x: Array, units: Array = units) -> float:
            value = few.sse(*few.split(x * units))
            return value if np.isfinite(value) else OVERFLOW

        start = np.concatenate([rng.uniform(-1.0, 1.0, m), place])
        options: Any = {"xatol": FMINSEARCH, "fatol": FMINSEARCH * cost(0.0 * start), "maxfev": PER_PARAMETER * len(start)}
        end = minimize(cost, start, method="Nelder-Mead", options=options)
        ends.append(End(end.x * units, float(end.fun), bool(end.success)))
    if not ends:
        return failure(problem, SIMPLEX)
    best, agreement = lowest(ends, STARTS)
    return Solution(*problem.split(best.x), "converged" if best.converged else "stopped_by_limit", SIMPLEX, (agreement,))
