"""Variable projection: a formula that is linear in all but one parameter, fitted without starting values; with several, from ten starts.

For every coordinate c of the nonlinear parameter the linear ones follow by least squares, so that `r(c) = Phi(c) Phi(c)^+ y - y`
depends on one number alone. Its sum of squares is scanned over all that the parameter may be, and the valleys are refined: the deepest is
taken, and those that are nearly as deep are its rivals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.literature import linear
from mapmore_cli.modelling.literature.descent import DISTINCT, RIVAL, STARTS, Bounds, End, descend, draw, lowest, onto_bounds, rivals
from mapmore_cli.modelling.literature.problem import Problem, Solution, at_limit, failure

METHOD = "variable projection"

SCAN_POINTS = 24  # in each interval of the coordinate
STACK = 2**18  # rows times places of the scan that are computed at once
HALF_DIGITS = 1e-4  # relative distance within which the lowest sum of squares surely places the minimum
DIGITS = 1e-13  # relative length of a step below which a place has all the digits that it can have
NOISY = 1e-6  # relative length of a step below which the slopes at its ends differ by little more than rounding
FAR = 1e-2  # relative length of a step to the minimum of all samples that is not to be trusted
TINY = 1e-300  # no absolute end of the digits
STEPS = 30  # most of them: a dozen do, and more only go about in rounding
WORTH_REFINING = 4.0  # times the lowest sum of squares of the scan, up to which a valley is refined
FLAT = 1e-10  # relative change of the sum of squares over the whole scan
ROUNDING = 1e-24  # of y'y: sums of squares below are rounding


def fit(problem: Problem) -> Solution:
    """Solve `problem`, over the whole interval of the nonlinear parameter where there is one, and from several starts where there are more.

    With one, the scan goes over means of neighbouring samples where there are many, and the deepest valley is finished on all samples. The
    status is `converged` or `at_bound`; a parameter that the data do not show is noted.
    """
    if len(problem.nonlinear) > 1:
        return fit_several(problem)
    if not problem.nonlinear:
        straight = linear.solve(problem.at_levels.regressors(np.empty(0)), problem.target(np.empty(0)))
        return Solution(straight.beta, np.empty(0), "converged", "linear least squares")
    parameter, few = problem.nonlinear[0], problem.condensed()
    grids = np.array([np.geomspace(*interval, SCAN_POINTS) for interval in parameter.intervals])
    sse = _sse(few, grids.ravel()).reshape(grids.shape)
    if _flat(sse, problem.y):
        c = min(grids.flat, key=lambda c: abs(np.log(abs(c))))
        return _solution(problem, c, "converged", (f"{parameter.name} is arbitrary: every value fits these data equally well",))
    places = _valleys(sse)
    valleys = [_refine(few, grids[number], i) for number, i in places]
    depths = _sse(few, np.array([c for c, _ in valleys]))
    deepest = int(np.argmin(depths))
    c, status = valleys[deepest]
    if few is not problem and status == "converged":
        number, i = places[deepest]
        c = _finished(problem, few, c) or _refine(problem, grids[number], i)[0]
    solution = _solution(problem, c, status, (at_limit(parameter, c),) if status == "at_bound" else ())
    least, rivals = depths[deepest], np.argsort(depths, kind="stable")
    near = [valleys[other][0] for other in rivals if (1 + DISTINCT) * least < depths[other] <= RIVAL * least]
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
    """Return the lowest point of the valley around `grid[i]`, and the status of having got there."""
    from scipy.optimize import brentq

    lower, c, upper = float(grid[max(i - 1, 0)]), float(grid[i]), float(grid[min(i + 1, len(grid) - 1)])

    @cache
    def slope(place: float) -> float:
        return _slope(problem, place)

    outward = slope(c)
    if (i == 0 and outward >= 0) or (i == len(grid) - 1 and outward <= 0):
        return c, "at_bound"
    left, right = (lower, c) if outward > 0 else (c, upper)
    if not slope(left) < 0 < slope(right):
        c = _lowest(problem, lower, upper, 1e-8 * abs(c))
        # A lowest value shows only half the digits of its place; the zero of the slope shows the rest, where it stands out of the rounding.
        left, right = max(lower, c - HALF_DIGITS * abs(c)), min(upper, c + HALF_DIGITS * abs(c))
    return float(brentq(slope, left, right, xtol=TINY, rtol=DIGITS)) if slope(left) < 0 < slope(right) else c, "converged"


def _lowest(problem: Problem, lower: float, upper: float, within: float) -> float:
    """Return the place with the lowest sum of squares."""
    from scipy.optimize import minimize_scalar

    return float(
        minimize_scalar(lambda c: _sse(problem, np.array([c]))[0], bounds=(lower, upper), method="bounded", options={"xatol": within}).x
    )


def _finished(problem: Problem, few: Problem, c: float) -> float | None:
    """Where the slope of all samples is zero, near `c`, where that of their means is: secants, the first one with the curvature of the
    means. None where they do not lead there."""
    apart = HALF_DIGITS * abs(c)
    curvature = (_slope(few, c + apart) - _slope(few, c - apart)) / (2 * apart)
    slope = _slope(problem, c)
    for _ in range(STEPS):
        step = -slope / curvature if curvature > 0 else np.inf
        if abs(step) > FAR * abs(c):
            return None
        c, before = c + step, slope
        if abs(step) <= DIGITS * abs(c):
            return c
        slope = _slope(problem, c)
        if abs(step) > NOISY * abs(c):
            curvature = (slope - before) / step
        elif abs(slope) > 0.1 * abs(before):  # rounding is all that is left of it
            return c
    return None


def _sse(problem: Problem, places: Array) -> Array:
    """Return sums of squares at several places of the coordinate, `(s,)`."""
    parts = np.array_split(places[:, None], -(-len(places) * len(problem.y) // STACK))
    return np.concatenate([linear.least_sse(problem.each_regressors(part), problem.each_target(part)) for part in parts])


def _slope(problem: Problem, c: float) -> float:
    """Half of `d sse / dc`, exactly: with the residual outside of the regressors' space, `beta` need not be differentiated."""
    projected, at = _project(problem, c), np.array([[c]])
    return float(problem.each_slopes(projected.beta[None], at)[0, :, 0] @ projected.residual)


def _project(problem: Problem, c: float) -> linear.LinearFit:
    at = np.array([c])
    return linear.solve(problem.regressors(at), problem.target(at))


def _solution(problem: Problem, c: float, status: str, notes: tuple[str, ...]) -> Solution:
    return Solution(_project(problem, c).beta, np.array([c]), status, METHOD, notes)


STARTS_TOLERANCE = 1e-12  # of the starts (W section III)
FINAL_TOLERANCE = 1e-15


def fit_several(problem: Problem) -> Solution:
    """Solve `problem` from seeded starts, with the nonlinear parameters within the outermost ends of their intervals.

    The starts go over means of neighbouring samples where there are many; from the lowest end, the search is finished on all samples. A
    note says how many starts agree, and one which parameter ends at a bound. The status is `converged`, `at_bound`, `stopped_by_limit`,
    or `failed` where every start overflowed.
    """
    ends = _descents(problem.condensed(), list(draw(problem.nonlinear)), STARTS_TOLERANCE)
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
