"""Variable projection: a formula that is linear in all but one parameter, fitted without starting values (with more: `bounded`).

For every coordinate c of the nonlinear parameter the linear ones follow by least squares, so that `r(c) = Phi(c) Phi(c)^+ y - y`
depends on one number alone. Its sum of squares is scanned over all that the parameter may be, and the valleys are refined: the deepest is
taken, and those that are nearly as deep are its rivals.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.literature import bounded, linear
from mapmore_cli.modelling.literature.multistart import DISTINCT, RIVAL
from mapmore_cli.modelling.literature.problem import Problem, Solution, at_limit

METHOD = "variable projection"

SCAN_POINTS = 24  # in each interval of the coordinate
HALF_DIGITS = 1e-4  # relative distance within which the lowest sum of squares surely places the minimum
WORTH_REFINING = 4.0  # times the lowest sum of squares of the scan, up to which a valley is refined
FLAT = 1e-10  # relative change of the sum of squares over the whole scan
ROUNDING = 1e-24  # of y'y: sums of squares below are rounding


def fit(problem: Problem) -> Solution:
    """Solve `problem`, over the whole interval of the nonlinear parameter where there is one, and from several starts where there are more.

    With one, the solution's status is `converged` or `at_bound`; a parameter that the data do not show is noted.
    """
    if len(problem.nonlinear) > 1:
        return bounded.fit(problem)
    if not problem.nonlinear:
        straight = linear.solve(problem.at_levels.regressors(np.empty(0)), problem.target(np.empty(0)))
        return Solution(straight.beta, np.empty(0), "converged", "linear least squares")
    parameter = problem.nonlinear[0]
    grids = np.array([np.geomspace(*interval, SCAN_POINTS) for interval in parameter.intervals])
    sse = np.array([[_sse(problem, c) for c in grid] for grid in grids])
    if _flat(sse, problem.y):
        c = min(grids.flat, key=lambda c: abs(np.log(abs(c))))
        return _solution(problem, c, "converged", (f"{parameter.name} is arbitrary: every value fits these data equally well",))
    valleys = sorted((_refine(problem, grids[number], i) for number, i in _valleys(sse)), key=lambda valley: _sse(problem, valley[0]))
    c, status = valleys[0]
    least = _sse(problem, c)
    near = [other for other, _ in valleys[1:] if (1 + DISTINCT) * least < _sse(problem, other) <= RIVAL * least]
    solution = _solution(problem, c, status, (at_limit(parameter, c),) if status == "at_bound" else ())
    return replace(solution, rivals=tuple((_project(problem, other).beta, np.array([other])) for other in near))


def _valleys(sse: Array) -> list[tuple[int, int]]:
    """Rows and places of the scan that no neighbour lies below and that may come to be as deep as a rival; the deepest first."""
    padded = np.pad(sse, ((0, 0), (1, 1)), constant_values=np.inf)
    low = (sse <= padded[:, :-2]) & (sse <= padded[:, 2:]) & (sse <= WORTH_REFINING * sse.min())
    places = [(int(row), int(place)) for row, place in np.argwhere(low)]
    return sorted(places, key=lambda at: float(sse[at]))


def _flat(sse: Array, y: Array) -> bool:
    return float(np.ptp(sse)) <= FLAT * float(sse.min()) + ROUNDING * float(y @ y)


def _refine(problem: Problem, grid: Array, i: int) -> tuple[float, str]:
    """The lowest point of the valley around `grid[i]`, and the status of having got there."""
    from scipy.optimize import brentq, minimize_scalar

    lower, c, upper = float(grid[max(i - 1, 0)]), float(grid[i]), float(grid[min(i + 1, len(grid) - 1)])
    outward = _slope(problem, c)
    if (i == 0 and outward >= 0) or (i == len(grid) - 1 and outward <= 0):
        return c, "at_bound"
    c = float(minimize_scalar(lambda c: _sse(problem, c), bounds=(lower, upper), method="bounded", options={"xatol": 1e-8 * abs(c)}).x)
    # A lowest value shows only half the digits of its place; the zero of the slope shows the rest, where it stands out of the rounding.
    left, right = max(lower, c - HALF_DIGITS * abs(c)), min(upper, c + HALF_DIGITS * abs(c))
    if _slope(problem, left) < 0 < _slope(problem, right):
        c = float(brentq(lambda c: _slope(problem, c), left, right, xtol=1e-300))
    return c, "converged"


def _sse(problem: Problem, c: float) -> float:
    at = np.array([c])
    return linear.least_sse(problem.regressors(at), problem.target(at))


def _slope(problem: Problem, c: float) -> float:
    """Half of `d sse / dc`, exactly: with the residual outside of the regressors' space, `beta` need not be differentiated."""
    projected = _project(problem, c)
    return float(problem.jacobian(projected.beta, np.array([c]))[:, -1] @ projected.residual)


def _project(problem: Problem, c: float) -> linear.LinearFit:
    at = np.array([c])
    return linear.solve(problem.regressors(at), problem.target(at))


def _solution(problem: Problem, c: float, status: str, notes: tuple[str, ...]) -> Solution:
    return Solution(_project(problem, c).beta, np.array([c]), status, METHOD, notes)
