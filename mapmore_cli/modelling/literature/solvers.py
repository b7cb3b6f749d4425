"""How a formula is fitted: by variable projection, by Levenberg and Marquardt's method, or by the
simplex.

Variable projection needs no starting values with one nonlinear parameter: for every coordinate c of
it the linear parameters follow by least squares, so that `r(c) = Phi(c) Phi(c)^+ y - y` depends on
one number alone. Its sum of squares is scanned over all that the parameter may be, and the valleys
are refined: the deepest is taken, and those that are nearly as deep are its rivals. With several
nonlinear parameters it goes from ten starts, as the other two methods do, which are there for
parity with the papers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.expressions import NotFinite
from mapmore_cli.modelling.literature import linear
from mapmore_cli.modelling.literature.descent import (
    DISTINCT,
    RIVAL,
    SEED,
    STARTS,
    End,
    descend,
    draw,
    lowest,
    onto_bounds,
    rivals,
)
from mapmore_cli.modelling.literature.problem import Problem, Solution, at_limit, failure

METHOD = "variable projection"

SCAN_POINTS = 24  # in each interval of the coordinate
STACK = 2**18  # rows times places of the scan that are computed at once
HALF_DIGITS = (
    1e-4  # relative distance within which the lowest sum of squares surely places the minimum
)
DIGITS = 1e-13  # relative distance within which a place has all the digits that it can have
# relative distance from the minimum of means to that of all samples, beyond which it is looked for
# anew
FAR = 1e-3
WORTH_REFINING = 4.0  # times the lowest sum of squares of the scan, up to which a valley is refined
FLAT = 1e-10  # relative change of the sum of squares over the whole scan
ROUNDING = 1e-24  # of y'y: sums of squares below are rounding


def variable_projection(problem: Problem) -> Solution:
    """Solve `problem` by variable projection, over the whole interval of the nonlinear parameter
    where there is one.

    The scan goes over means of neighbouring samples where there are many, and the deepest valley is
    finished on all samples. The status is `converged` or `at_bound`; a parameter that the data do
    not show is noted. With several parameters, it goes from several starts.
    """
    if len(problem.nonlinear) > 1:
        return _project_several(problem)
    if not problem.nonlinear:
        straight = linear.solve(
            problem.at_levels.regressors(np.empty(0)), problem.target(np.empty(0))
        )
        return Solution(straight.beta, np.empty(0), "converged", "linear least squares")
    parameter, few = problem.nonlinear[0], problem.condensed()
    grids = np.array([np.geomspace(*interval, SCAN_POINTS) for interval in parameter.intervals])
    sse = _sse(few, grids.ravel()).reshape(grids.shape)
    if float(np.ptp(sse)) <= FLAT * float(sse.min()) + ROUNDING * float(problem.y @ problem.y):
        c = min(grids.flat, key=lambda c: abs(np.log(abs(c))))
        arbitrary = f"{parameter.name} is arbitrary: every value fits these data equally well"
        return Solution(
            _projected_at(problem, c).beta, np.array([c]), "converged", METHOD, (arbitrary,)
        )
    places = _valleys(sse)
    valleys = [_refine(few, grids[number], i) for number, i in places]
    depths = _sse(few, np.array([c for c, _ in valleys]))
    deepest = int(np.argmin(depths))
    c, status = valleys[deepest]
    if few is not problem and status == "converged":
        number, i = places[deepest]
        c = (
            _zero(partial(_slope, problem), c - FAR * abs(c), c + FAR * abs(c))
            or _refine(problem, grids[number], i)[0]
        )
    notes = (at_limit(parameter, c),) if status == "at_bound" else ()
    least, by_depth = depths[deepest], np.argsort(depths, kind="stable")
    near = [
        valleys[other][0]
        for other in by_depth
        if (1 + DISTINCT) * least < depths[other] <= RIVAL * least
    ]
    (beta, at), *others = (
        (_projected_at(problem, place).beta, np.array([place])) for place in (c, *near)
    )
    return Solution(beta, at, status, METHOD, notes, tuple(others))


def _valleys(sse: Array) -> list[tuple[int, int]]:
    """Rows and places of the scan that no neighbour lies below and that may come to be as deep as a
    rival; the deepest first.
    """
    padded = np.pad(sse, ((0, 0), (1, 1)), constant_values=np.inf)
    low = (sse <= padded[:, :-2]) & (sse <= padded[:, 2:]) & (sse <= WORTH_REFINING * sse.min())
    places = [(int(row), int(place)) for row, place in np.argwhere(low)]
    return sorted(places, key=lambda at: float(sse[at]))


def _refine(problem: Problem, grid: Array, i: int) -> tuple[float, str]:
    """Return the lowest point of the valley around `grid[i]`, and the status of having got
    there.
    """
    from scipy.optimize import minimize_scalar

    lower, c, upper = (
        float(grid[max(i - 1, 0)]),
        float(grid[i]),
        float(grid[min(i + 1, len(grid) - 1)]),
    )
    slope = cache(partial(_slope, problem))
    outward = slope(c)
    if (i == 0 and outward >= 0) or (i == len(grid) - 1 and outward <= 0):
        return c, "at_bound"
    found = _zero(slope, lower, c) if outward > 0 else _zero(slope, c, upper)
    if found is None:
        options: Any = {"xatol": 1e-8 * abs(c)}
        c = float(
            minimize_scalar(
                lambda at: _sse(problem, np.array([at]))[0],
                bounds=(lower, upper),
                method="bounded",
                options=options,
            ).x
        )
        # A lowest value shows only half the digits of its place; the zero of the slope shows the
        # rest, where it stands out of the rounding.
        found = _zero(
            slope, max(lower, c - HALF_DIGITS * abs(c)), min(upper, c + HALF_DIGITS * abs(c))
        )
    return c if found is None else found, "converged"


def _zero(slope: Callable[[float], float], left: float, right: float) -> float | None:
    """Return where a slope rises through zero between two places; None where it is not below zero
    at one and above at the other.
    """
    from scipy.optimize import brentq

    return (
        float(brentq(slope, left, right, xtol=1e-300, rtol=DIGITS))
        if slope(left) < 0 < slope(right)
        else None
    )


def _sse(problem: Problem, places: Array) -> Array:
    """Return sums of squares at several places of the coordinate, `(s,)`."""
    parts = np.array_split(places[:, None], -(-len(places) * len(problem.y) // STACK))
    return np.concatenate(
        [
            linear.least_sse(problem.each_regressors(part), problem.each_target(part))
            for part in parts
        ]
    )


def _slope(problem: Problem, c: float) -> float:
    """Half of `d sse / dc`, exactly: with the residual outside of the regressors' space, `beta`
    need not be differentiated.
    """
    projected, at = _projected_at(problem, c), np.array([[c]])
    return float(problem.each_slopes(projected.beta[None], at)[0, :, 0] @ projected.residual)


def _projected_at(problem: Problem, c: float) -> linear.LinearFit:
    at = np.array([c])
    return linear.solve(problem.regressors(at), problem.target(at))


STARTS_TOLERANCE = 1e-12  # of the starts (W section III)
FINAL_TOLERANCE = 1e-15


def _project_several(problem: Problem) -> Solution:
    """Solve from seeded starts, with the nonlinear parameters within the outermost ends of their
    intervals.

    The starts go over means of neighbouring samples where there are many; from the lowest end, the
    search is finished on all samples. A note says how many starts agree, and one which parameter
    ends at a bound. The status is `converged`, `at_bound`, `stopped_by_limit`, or `failed` where
    every start overflowed.
    """
    ends = _descents(problem.condensed(), list(draw(problem.nonlinear)), STARTS_TOLERANCE)
    if not ends:
        return failure(problem, METHOD)
    best, agreement = lowest(ends, STARTS)
    finished = _descents(problem, [best.x], FINAL_TOLERANCE)
    if not finished:
        return failure(problem, METHOD)
    end = finished[0]
    c, touched = onto_bounds(end.x, problem.bounds)
    limits = [at_limit(problem.nonlinear[i], c[i]) for i in touched]
    status = "at_bound" if limits else end.status
    others = [other.x for other in rivals(ends, best)]
    places = np.array([c, *others])
    betas = _projected(problem, places).beta
    return Solution(
        betas[0],
        c,
        status,
        METHOD,
        (agreement, *limits),
        tuple(zip(betas[1:], others, strict=True)),
    )


def _descents(problem: Problem, starts: Sequence[Array], tolerance: float) -> list[End]:
    """Return the nearest minima within the bounds, but for starts in which the formula
    overflows.
    """
    unit = float(np.linalg.norm(problem.target(starts[0]))) or 1.0

    def system(c: Array) -> tuple[Array, Array]:
        """r and `dr/dc`, but for a part within the regressors' space, which has no share in the
        gradient (Kaufman).
        """
        found = _projected(problem, c)
        jacobian = problem.each_slopes(found.beta, c)
        outside = jacobian - found.basis @ (found.basis.transpose(0, 2, 1) @ jacobian)
        return found.residual / unit, outside / unit

    return descend(system, starts, problem.bounds, tolerance)


def _projected(problem: Problem, c: Array) -> linear.LinearFit:
    return linear.solve_each(problem.each_regressors(c), problem.each_target(c))


LEVENBERG_MARQUARDT = "levenberg_marquardt"
MINPACK_TOLERANCE = 1e-15
EVALUATIONS = 400
REFUSED = 1e100  # stands for an overflow, so that the step is not taken


def levenberg_marquardt(problem: Problem) -> Solution:
    """Solve `problem` by MINPACK's Levenberg-Marquardt, all parameters at once and without bounds.

    The linear parameters start at zero, the nonlinear ones at seeded random places of their
    intervals, or all of them at the problem's published start; the lowest sum of squares wins, and
    a note says how many starts came to it. The status is `converged`, `stopped_by_limit`, or
    `failed` where every start overflowed.
    """
    starts = list(_starts(problem))
    ends = [end for start in starts if (end := _minpack(problem, start)) is not None]
    if not ends:
        return failure(problem, LEVENBERG_MARQUARDT)
    best, agreement = lowest(ends, len(starts))
    others = tuple(problem.split(end.x) for end in rivals(ends, best))
    return Solution(
        *problem.split(best.x),
        best.status,
        LEVENBERG_MARQUARDT,
        (agreement,) if len(starts) > 1 else (),
        others,
    )


def _starts(problem: Problem) -> Iterator[Array]:
    """Places to descend from, `(m + k,)`: the published one where it is asked for, else seeded
    ones.
    """
    zeros = np.zeros(len(problem.linear))
    if problem.start is not None:
        yield np.array([problem.start[name] for name in problem.names]) * np.concatenate(
            [zeros + 1.0, problem.spans]
        )
        return
    for place in draw(problem.nonlinear):
        yield np.concatenate([zeros, place])


def _minpack(problem: Problem, start: Array) -> End | None:
    """Return the nearest minimum, of residuals over the largest target so that the unit is no
    matter; None where the formula overflows.
    """
    from scipy.optimize import least_squares

    unit = float(np.abs(problem.y).max()) or 1.0

    def residual(x: Array) -> Array:
        values = problem.residual(*problem.split(x)) / unit
        return np.where(np.isfinite(values), values, REFUSED)

    def jacobian(x: Array) -> Array:
        return problem.jacobian(*problem.split(x)) / unit

    limits: Any = {
        "xtol": MINPACK_TOLERANCE,
        "ftol": MINPACK_TOLERANCE,
        "gtol": MINPACK_TOLERANCE,
        "max_nfev": EVALUATIONS,
    }
    try:
        found = least_squares(residual, start, jacobian, method="lm", x_scale="jac", **limits)
    except NotFinite:
        return None
    return End(found.x, float(found.cost), found.status > 0) if found.cost < REFUSED else None


SIMPLEX = "simplex"
FMINSEARCH = 1e-4  # of coordinates and of the sum of squares, fminsearch's
OVERFLOW = 1e300  # stands for an overflow
PER_PARAMETER = 200  # evaluations, fminsearch's


def simplex(problem: Problem) -> Solution:
    """Solve `problem` by ten descents of a simplex over all parameters at once, with the settings
    of `fminsearch`.

    H does not say how its random starts are drawn. Here a linear parameter starts where its term
    alone is at most as large as the target (uniform, of either sign), a nonlinear one in its
    intervals. Sums of squares are over means of neighbouring samples where there are many. The
    status is `converged`, `stopped_by_limit` (of evaluations), or `failed` where every start
    overflowed.
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
        units = np.concatenate(
            [
                np.linalg.norm(few.target(place)) / np.where(lengths > 0.0, lengths, 1.0),
                np.ones(len(place)),
            ]
        )

        def cost(x: Array, units: Array = units) -> float:
            value = few.sse(*few.split(x * units))
            return value if np.isfinite(value) else OVERFLOW

        start = np.concatenate([rng.uniform(-1.0, 1.0, m), place])
        options: Any = {
            "xatol": FMINSEARCH,
            "fatol": FMINSEARCH * cost(0.0 * start),
            "maxfev": PER_PARAMETER * len(start),
        }
        end = minimize(cost, start, method="Nelder-Mead", options=options)
        ends.append(End(end.x * units, float(end.fun), bool(end.success)))
    if not ends:
        return failure(problem, SIMPLEX)
    best, agreement = lowest(ends, STARTS)
    return Solution(*problem.split(best.x), best.status, SIMPLEX, (agreement,))


METHODS: Mapping[str, Callable[[Problem], Solution]] = {
    one.__name__: one for one in (variable_projection, levenberg_marquardt, simplex)
}
