"""Fit a formula by variable projection, by Levenberg and Marquardt's method, or by the simplex
method.

Variable projection searches only the nonlinear coordinates c. For each c, the linear parameters
follow by least squares, so that `r(c) = Phi(c) Phi(c)^+ y - y`. With one coordinate, no starting
values are needed: the sum of squares is computed on a grid over all allowed values, and a search
descends from every local minimum of the grid. With several coordinates, the search begins at ten
random places, and at the best three of 300 further places. The other two methods begin at the ten
random places. They exist for comparison with the papers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.expressions import NotFinite
from mapmore_cli.modelling.literature import linear
from mapmore_cli.modelling.literature.descent import (
    AGREEMENT,
    REFUSED,
    SEED,
    STARTS,
    End,
    agreement,
    descend,
    drawn_starts,
    onto_bounds,
    rivals,
)
from mapmore_cli.modelling.literature.problem import LeastSquares


class Solution(NamedTuple):
    """Solution of a least-squares problem: the linear parameters `beta`, shape (m,), and the
    coordinates `c` of the nonlinear parameters, shape (k,). `status` and `method` have the values
    that `FormulaFit` describes.

    `rivals` holds beta and c of other local minima with nearly as small a sum of squares.
    """

    beta: Array
    c: Array
    status: str
    method: str
    notes: tuple[str, ...] = ()
    rivals: tuple[tuple[Array, Array], ...] = ()


def failure(problem: LeastSquares, method: str) -> Solution:
    """Return a solution in which every parameter is NaN, because the formula overflows at every
    start.
    """
    nothing = np.full(len(problem.linear), np.nan), np.full(len(problem.nonlinear), np.nan)
    return Solution(*nothing, "failed", method, ("every start overflowed",))


PLACES, BEST_PLACES = 300, 3
"""Number of further places at which the sum of squares is computed if several coordinates are
searched, and number of those from which a descent begins. A sum of two formulas can have so many
minima that no random start leads to the deepest one.
"""


METHOD = "variable projection"
SCAN_POINTS = 24  # number of grid points in each interval of the coordinate
# a sum of squares that changes by less than this fraction over the grid is regarded as constant
FLAT = 1e-10
ROUNDING = 1e-24  # a sum of squares below this fraction of y'y is only rounding error


def variable_projection(problem: LeastSquares) -> Solution:
    """Solve `problem` by variable projection.

    If there are many samples, the search uses means of neighbouring samples. If the problem has a
    `start` at which the formula does not overflow, the search begins only there. The best result is
    then refined on all samples. The status is `converged`, `at_bound`, `stopped_by_limit`, or
    `failed` if every start overflows. Notes name a parameter that ends at a bound or that the data
    do not determine, and say how many starts agree.
    """
    if not problem.nonlinear:
        straight = _projected(problem, np.empty(0))
        return Solution(straight.beta, np.empty(0), "converged", "linear least squares")
    few, several = problem.condensed(), len(problem.nonlinear) > 1
    bounds = problem.bounds
    if problem.start is not None:
        place = [problem.start[name] * span for name, span in problem.spans.items()]
        searches, several = [(bounds, [np.array(place)])], False
    else:
        searches = [(bounds, _starts(few))] if several else _valleys(few)
    if not searches:
        places = np.concatenate(_grids(problem))
        c = places[[np.argmin(np.abs(np.log(np.abs(places))))]]
        note = (
            f"{problem.nonlinear[0].name} is arbitrary, because every value fits these data "
            "equally well"
        )
        return Solution(_projected(problem, c).beta, c, "converged", METHOD, (note,))
    ends = [
        (end, within)
        for within, starts in searches
        for end in descend(partial(_projection, few), starts, within)
    ]
    best, bounds = min(ends, key=lambda pair: pair[0].cost, default=(None, bounds))
    finished = [] if best is None else descend(partial(_projection, problem), [best.x], bounds)
    if best is None or not finished:
        if problem.start is not None:
            return variable_projection(replace(problem, start=None))
        return failure(problem, METHOD)
    c, touched = _onto_bounds_of(problem, finished[0].x, bounds)
    reached = [end for end, _ in ends]
    notes = [agreement(reached, best, STARTS + BEST_PLACES)] * several
    for i in touched:
        parameter = problem.nonlinear[i]
        limit = parameter.written(c[i])
        notes.append(f"{parameter.name} went to the limit of its search, {limit}")
    status = "at_bound" if touched else finished[0].status
    others = tuple((_projected(problem, end.x).beta, end.x) for end in rivals(reached, best))
    return Solution(_projected(problem, c).beta, c, status, METHOD, tuple(notes), others)


def _starts(problem: LeastSquares) -> list[Array]:
    """Return the starts of a search for several coordinates: random points, and the points with the
    smallest sums of squares among many further random points.
    """
    places = [*drawn_starts(problem.nonlinear, PLACES, SEED + 1)]
    with np.errstate(all="ignore"):  # if the formula overflows, the sum of squares is infinite
        order = np.argsort([_projected_sse(problem, place) for place in places], kind="stable")
    return [*drawn_starts(problem.nonlinear), *(places[i] for i in order[:BEST_PLACES])]


def _valleys(problem: LeastSquares) -> list[tuple[tuple[Array, Array], list[Array]]]:
    """Compute the sum of squares on a grid of values of the only nonlinear parameter. Return a
    pair for every interval of this parameter: the two ends of the interval, and those grid points
    in it at which the sum of squares has a local minimum. If the sum of squares is constant, the
    list is empty.
    """
    grids = _grids(problem)
    sse = np.array([[_projected_sse(problem, c) for c in grid] for grid in grids])
    if np.ptp(sse) <= FLAT * sse.min() + ROUNDING * (problem.y @ problem.y):
        return []
    padded = np.pad(sse, ((0, 0), (1, 1)), constant_values=np.inf)
    low = (sse <= padded[:, :-2]) & (sse <= padded[:, 2:])
    return [
        ((grid[:1], grid[-1:]), list(grid[in_valley][:, None]))
        for grid, in_valley in zip(grids, low, strict=True)
    ]


def _grids(problem: LeastSquares) -> list[Array]:
    """Return the grid points in every interval of the only nonlinear parameter."""
    (parameter,) = problem.nonlinear
    return [np.geomspace(*interval, SCAN_POINTS) for interval in parameter.intervals]


def _onto_bounds_of(
    problem: LeastSquares, c: Array, bounds: tuple[Array, Array]
) -> tuple[Array, list[int]]:
    """Move coordinates onto the bounds that they almost touch, as `onto_bounds` does, unless the
    sum of squares is larger there. Return the coordinates and the indices of those at a bound.

    The sum of squares is compared because "almost" means a small fraction of the interval. In the
    interval from 0.001 to 10 000, the value 0.005 is almost at the lower bound, although it is five
    times as large.
    """
    moved, touched = onto_bounds(c, bounds)
    if touched:
        before, after = (_projected_sse(problem, place) for place in (c, moved))
        if after > (1 + AGREEMENT) * before + ROUNDING * (problem.y @ problem.y):
            return c, []
    return moved, touched


def _projected_sse(problem: LeastSquares, c: Array) -> float:
    """Return the smallest sum of squares for the coordinates c and any linear parameters; infinity
    if the formula overflows.
    """
    try:
        residual = _projected(problem, np.atleast_1d(c)).residual
    except (NotFinite, np.linalg.LinAlgError):
        return np.inf
    return float(residual @ residual)


def _projected(problem: LeastSquares, c: Array) -> linear.LinearFit:
    return linear.solve_linear(*problem.linear_at(c))


def _projection(problem: LeastSquares, c: Array) -> tuple[Array, Array]:
    """Return the residual r and its derivative `dr/dc`. The part of the derivative that lies in the
    space of the regressors is left out, because it does not contribute to the gradient of the sum
    of squares (Kaufman's approximation). Both results are divided by the largest target, so that
    they do not depend on its unit.
    """
    unit = float(np.abs(problem.y).max()) or 1.0
    best = _projected(problem, c)
    slopes = problem.slopes([parameter.name for parameter in problem.nonlinear], best.beta, c)
    outside = slopes - best.basis @ (best.basis.T @ slopes)
    return best.residual / unit, outside / unit


LEVENBERG_MARQUARDT = "levenberg_marquardt"


def levenberg_marquardt(problem: LeastSquares) -> Solution:
    """Solve `problem` with MINPACK's Levenberg-Marquardt method, for all parameters at once and
    without bounds.

    The linear parameters start at zero, and the nonlinear parameters at random places of their
    intervals with a fixed seed. If the spec requests published starting values, all parameters
    start from these values. The result with the lowest sum of squares is returned, and a note says
    from how many starts it was reached. The status is `converged`, `stopped_by_limit`, or `failed`
    if every start overflowed.
    """
    names, m = list(problem.gradient), len(problem.linear)
    unit = float(np.abs(problem.y).max()) or 1.0

    def system(x: Array) -> tuple[Array, Array]:
        at = x[:m], x[m:]
        return problem.residual(*at) / unit, problem.slopes(names, *at) / unit

    if problem.start is not None:
        spans = [problem.spans.get(name, 1.0) for name in names]
        starts = [np.array([problem.start[name] for name in names]) * spans]
    else:
        places = drawn_starts(problem.nonlinear) if problem.nonlinear else [np.empty(0)]
        starts = [np.concatenate([np.zeros(m), place]) for place in places]
    return _best_solution(
        problem, descend(system, starts, method="lm"), len(starts), LEVENBERG_MARQUARDT
    )


SIMPLEX = "simplex"
FMINSEARCH = 1e-4  # tolerances as in MATLAB's `fminsearch`
PER_PARAMETER = 200  # evaluations per parameter, as in MATLAB's `fminsearch`


def simplex(problem: LeastSquares) -> Solution:
    """Solve `problem` by ten simplex searches over all parameters at once, with the settings of
    MATLAB's `fminsearch`.

    The paper H does not say how its random starting values are drawn. Here, a linear parameter
    starts at a random value, positive or negative, for which its term alone is at most as large as
    the target. A nonlinear parameter starts at a random value within its intervals. If there are
    many samples, the search uses means of neighbouring samples. The status is `converged`,
    `stopped_by_limit` (of evaluations), or `failed` if every start overflowed.
    """
    from scipy.optimize import minimize

    few, m = problem.condensed(), len(problem.linear)
    rng = np.random.default_rng(SEED)
    ends: list[End] = []
    for place in drawn_starts(problem.nonlinear):
        try:
            regressors, target = few.linear_at(place)
        except NotFinite:
            continue
        lengths = np.linalg.norm(regressors, axis=0) / (np.linalg.norm(target) or 1.0)
        units = np.append(1 / np.where(lengths > 0.0, lengths, 1.0), np.ones(len(place)))

        def cost(x: Array, units: Array = units) -> float:
            at = x * units
            return float(np.nan_to_num(few.sse(at[:m], at[m:]), nan=REFUSED, posinf=REFUSED))

        start = np.append(rng.uniform(-1.0, 1.0, m), place)
        end = minimize(
            cost,
            start,
            method="Nelder-Mead",
            options={
                "xatol": FMINSEARCH,
                "fatol": FMINSEARCH * cost(0.0 * start),
                "maxfev": PER_PARAMETER * len(start),
            },
        )
        ends.append(End(end.x * units, float(end.fun), bool(end.success)))
    return _best_solution(problem, ends, STARTS, SIMPLEX)


def _best_solution(
    problem: LeastSquares, ends: Sequence[End], starts: int, method: str
) -> Solution:
    """Return the result with the smallest sum of squares, and its rivals. Results are preferred in
    which every nonlinear parameter has a sign that its intervals allow.
    """
    if not ends:
        return failure(problem, method)
    m = len(problem.linear)
    allowed = [end for end in ends if problem.allows(end.x[m:])]
    notes = ["every start ended with a sign that the source excludes"] * (not allowed)
    ends = allowed or ends
    best = min(ends, key=lambda end: end.cost)
    notes += [agreement(ends, best, starts)] * (starts > 1)
    others = tuple((end.x[:m], end.x[m:]) for end in rivals(ends, best))
    return Solution(best.x[:m], best.x[m:], best.status, method, tuple(notes), others)


METHODS: Mapping[str, Callable[[LeastSquares], Solution]] = {
    solver.__name__: solver for solver in (variable_projection, levenberg_marquardt, simplex)
}
