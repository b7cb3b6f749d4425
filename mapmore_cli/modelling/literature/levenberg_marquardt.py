"""Levenberg-Marquardt from several starting values, for parity with the papers (W: ten starts)."""

from __future__ import annotations

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.literature.problem import Nonlinear, Problem
from mapmore_cli.modelling.literature.solution import Solution
from mapmore_cli.modelling.terms import NotFinite

METHOD = "levenberg_marquardt"
STARTS = 10
SEED = 20170714  # any fixed number: the same data give the same fit
TOLERANCE = 1e-15
EVALUATIONS = 400
REFUSED = 1e100  # stands for an overflow, so that the step is not taken
AGREEMENT = 1e-6  # relative difference between sums of squares that are called equal


def fit(problem: Problem) -> Solution:
    """Solve `problem` by MINPACK's Levenberg-Marquardt, all parameters at once.

    The linear parameters start at zero, the nonlinear ones at seeded random places of their intervals; the lowest sum of squares wins, and
    a note says how many starts came to it. The status is `converged`, `stopped_by_limit`, or `failed` where every start overflowed.
    """
    rng = np.random.default_rng(SEED)
    starts = [np.array([_start(parameter, rng) for parameter in problem.nonlinear]) for _ in range(STARTS if problem.nonlinear else 1)]
    results = sorted((found for start in starts if (found := _descend(problem, start)) is not None), key=lambda found: found.cost)
    m = len(problem.linear)
    if not results:
        return Solution(np.full(m, np.nan), np.full(len(problem.nonlinear), np.nan), "failed", METHOD, ("every start overflowed",))
    best = results[0]
    agreeing = sum(found.cost <= (1 + AGREEMENT) * best.cost + 1e-20 for found in results)
    status = "converged" if best.status > 0 else "stopped_by_limit"
    note = f"{agreeing} of {len(starts)} starts agree on the sum of squares"
    return Solution(best.x[:m], best.x[m:], status, METHOD, (note,) if problem.nonlinear else ())


def _start(parameter: Nonlinear, rng: np.random.Generator) -> float:
    lower, upper = parameter.intervals[rng.integers(len(parameter.intervals))]
    return float(lower * (upper / lower) ** rng.random())


def _descend(problem: Problem, start: Array) -> OptimizeResult | None:
    """The nearest minimum, of residuals divided by the largest target so that the unit is no matter; None where the formula overflows."""
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
            np.concatenate([np.zeros(m), start]),
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
