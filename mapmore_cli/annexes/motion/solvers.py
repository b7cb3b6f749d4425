"""Find a section's parameters by least squares or by particle swarms (equations 11 and 12 of Brown
and Xie 2024).

Least squares searches only the poles; for given poles, linear least squares gives the
weights of the drives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from scipy import optimize

from mapmore_cli.annexes.motion.body import poles
from mapmore_cli.annexes.motion.problem import Bounds, Found, MotionRecipe, Piece, Problem
from mapmore_cli.annexes.motion.simulation import angles, of_angles, stable
from mapmore_cli.domain.arrays import Array, root_mean_square
from mapmore_cli.domain.errors import FitError

STRIDES = (1, 3, 10, 30)
"""Numbers of samples between the outputs that a linear regression relates to each other. Small
numbers are sensitive to noise, and large numbers miss fast poles.
"""
NEAREST = 0.999  # largest reflection coefficient of starting values; 1 is the edge of stability
TOLERANCE = 1e-12


def least_squares(problem: Problem, _recipe: MotionRecipe) -> Found:
    """Find the parameters by Gauss-Newton iterations over the poles. The iterations begin at the
    best of the starting values that linear regressions give.
    """
    reach = problem.reach
    starts = (linear_start(problem.pieces, stride) for stride in STRIDES)
    places = [angles(*start, reach, NEAREST) for start in starts if start is not None]
    within = [of_angles(np.array(place), reach) for place in places]
    best = min(within, key=lambda poles: problem.rmse(*poles))
    history: list[float] = []

    def residuals(place: Array) -> Array:
        left = problem.projected(*of_angles(place, reach))[1]
        history.append(root_mean_square(left))
        return left

    end = optimize.least_squares(
        residuals,
        angles(*best, reach, NEAREST),
        jac="3-point",
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=TOLERANCE,
        max_nfev=200,
    )
    return problem.found(*of_angles(end.x, reach), history)


def linear_start(pieces: tuple[Piece, ...], stride: int) -> tuple[float, float] | None:
    """Return P1 and P2 by linear regression of `y[k + 2s] = a y[k + s] + b y[k] + sum_m c_m
    d_m[k]`. The poles of this equation refer to a stride of s samples, and are converted to one
    sample. Only triples of samples at which the section is active are used. The result is None if
    there are too few such triples. The regression predicts only one step ahead, so noise in y
    biases it. Its result is therefore only a starting point.
    """
    rows, targets = [], []
    for piece in pieces:
        samples = np.flatnonzero(
            piece.counts[: -2 * stride] & piece.counts[stride:-stride] & piece.counts[2 * stride :]
        )
        rows.append(
            np.column_stack([piece.y[samples + stride], piece.y[samples], piece.drives[samples]])
        )
        targets.append(piece.y[samples + 2 * stride])
    matrix, y = np.concatenate(rows), np.concatenate(targets)
    if len(y) < matrix.shape[1] and stride > 1:
        return None
    p2, p1 = np.linalg.lstsq(matrix, y, rcond=None)[0][:2].tolist() if len(y) else (0.0, 0.0)
    if stride == 1:
        return p1, p2
    first, second = (pole ** (1.0 / stride) for pole in poles(p1, p2))
    return -(first * second).real, (first + second).real


PARTICLES, ITERATIONS = 50, 20
INERTIA, OWN, COMMON = 0.9, 2.0, 2.0
"""W, C1 and C2 of Brown and Xie 2024. They lie outside the region in which a swarm settles, which
needs `C1 + C2 < 24 (1 - W^2)/(7 - 5 W)`, here 1.8.
"""


def fly(
    cost: Callable[[Array], float],
    walls: Array,
    rng: np.random.Generator,
    begin: Array | None = None,
) -> tuple[Array, list[float]]:
    """Minimise `cost` by a particle swarm in the box between `walls`, (2, d). Return the best
    point, and the lowest cost at the start and after every iteration.

    In every iteration, `v = W v + C1 r1 (own best - x) + C2 r2 (common best - x)` and `x = x + v`,
    with new random numbers r1, r2 in 0..1 for every coordinate. Particles begin at rest, at random
    points of the box `begin`, (2, d), or of the box between `walls` if `begin` is None. A particle
    that would leave the box stops at its wall.
    """
    low, high = walls
    first, last = walls if begin is None else begin
    x = first + (last - first) * rng.random((PARTICLES, len(first)))
    v = np.zeros_like(x)
    own_best, own_cost = x, np.array([cost(each) for each in x])
    history = [float(own_cost.min())]
    for _ in range(ITERATIONS):
        common = own_best[np.argmin(own_cost)]
        r1, r2 = rng.random(x.shape), rng.random(x.shape)
        v = INERTIA * v + OWN * r1 * (own_best - x) + COMMON * r2 * (common - x)
        reached = np.clip(x + v, low, high)
        v = np.where(reached == x + v, v, 0.0)
        x = reached
        now = np.array([cost(each) for each in x])
        better = now < own_cost
        own_best[better], own_cost[better] = x[better], now[better]
        history.append(float(own_cost.min()))
    return own_best[np.argmin(own_cost)], history


# in `|P3| = |gain| |1 - P1 - P2|`, the second factor is smaller than 4 for every stable section
WIDE = 4.0


def swarm(problem: Problem, recipe: MotionRecipe) -> Found:
    """Return the best P1, P2 and P3 that a particle swarm finds in the region that contains all
    stable sections (section 2.2 of Brown and Xie 2024). The error of an unstable particle is larger
    than that of any stable particle.

    The input is the only drive, because the check of the spec refuses other drives. Raises FitError
    if no particle was stable.
    """
    walls = _walls(Bounds(), problem)
    begin = None if recipe.begin is None else _walls(recipe.begin, problem)
    best, history = fly(lambda x: problem.rmse(x[0], x[1], x[2:]), walls, problem.random, begin)
    p1, p2, p3 = best.tolist()
    if not stable(p1, p2):
        raise FitError(
            "`solver: swarm` found no stable parameters for a section",
            "use `solver: least_squares`",
        )
    return Found(p1, p2, np.array([p3]), history[-1], problem.evaluations, np.array(history))


def _walls(box: Bounds, problem: Problem) -> Array:
    """Return the smallest and the largest values of P1, P2 and P3 in the `box`, (2, 3)."""
    inputs = np.concatenate([piece.drives[:, 0] for piece in problem.pieces])
    outputs = np.concatenate([piece.y for piece in problem.pieces])
    widest = WIDE * float(np.ptp(outputs)) / float(np.ptp(inputs))
    return np.transpose([box.p1, box.p2, box.p3 or (-widest, widest)])


SOLVERS: Mapping[str, Callable[[Problem, MotionRecipe], Found]] = {
    solver.__name__: solver for solver in (least_squares, swarm)
}
