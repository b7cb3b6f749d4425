"""The simplex of Nelder and Mead from random starts, as H fits its model (section II.C: MATLAB's `fminsearch`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.expressions import NotFinite
from mapmore_cli.modelling.literature.multistart import SEED, STARTS, draw, lowest
from mapmore_cli.modelling.literature.problem import Problem, Solution, failure

METHOD = "simplex"
TOLERANCE = 1e-4  # of coordinates and of the sum of squares, fminsearch's
REFUSED = 1e300  # stands for an overflow
PER_PARAMETER = 200  # evaluations, fminsearch's


@dataclass
class End:
    """Where a descent ended: parameters, their sum of squares, and whether it had converged."""

    x: Array
    cost: float
    success: bool


def fit(problem: Problem) -> Solution:
    """Solve `problem` by ten descents of a simplex over all parameters at once, with the settings of `fminsearch`.

    H does not say how its random starts are drawn. Here a linear parameter starts where its term alone is at most as large as the target
    (uniform, of either sign), a nonlinear one in its intervals. Sums of squares are over means of neighbouring samples where there are
    many. The status is `converged`, `stopped_by_limit` (of evaluations), or `failed` where every start overflowed.
    """
    from scipy.optimize import minimize

    few, m = problem.condensed(), len(problem.linear)
    rng = np.random.default_rng(SEED)
    places = list(draw(problem.nonlinear)) if problem.nonlinear else [np.empty(0)] * STARTS
    ends: list[End] = []
    for place in places:
        try:
            lengths = np.linalg.norm(few.regressors(place), axis=0)
        except NotFinite:
            continue
        units = np.linalg.norm(few.target(place)) / np.where(lengths > 0.0, lengths, 1.0)

        start = np.concatenate([rng.uniform(-1.0, 1.0, m), place])
        options: Any = {"xatol": TOLERANCE, "fatol": TOLERANCE * _cost(0.0 * start, few, units), "maxfev": PER_PARAMETER * len(start)}
        end = minimize(_cost, start, args=(few, units), method="Nelder-Mead", options=options)
        ends.append(End(np.concatenate([end.x[:m] * units, end.x[m:]]), float(end.fun), bool(end.success)))
    if not ends:
        return failure(problem, METHOD)
    best, agreement = lowest(ends, STARTS)
    return Solution(best.x[:m], best.x[m:], "converged" if best.success else "stopped_by_limit", METHOD, (agreement,))


def _cost(x: Array, problem: Problem, units: Array) -> float:
    """Sum of squares at the linear parameters, in their `units`, and the coordinates that follow them in x."""
    m = len(units)
    residual = problem.residual(x[:m] * units, x[m:])
    value = float(residual @ residual)
    return value if np.isfinite(value) else REFUSED
