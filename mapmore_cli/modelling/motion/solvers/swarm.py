"""`swarm`: a particle swarm (P eq 11-12), as published over P1, P2 and P3 (P 2.2); `swarm_projected`: over frequency and damping."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import FitError, SpecError
from mapmore_cli.modelling.motion.problem import Bounds, Found, MotionRecipe, Problem
from mapmore_cli.modelling.motion.sections import FASTEST, LEAST_DAMPED, MOST_DAMPED, SLOWEST, of_oscillator, stable

INERTIA, OWN, COMMON = 0.9, 2.0, 2.0
"""P's W, C1 and C2. They lie outside of the region in which a swarm settles: it needs `C1 + C2 < 24 (1 - W^2)/(7 - 5 W)`, here 1.8."""


class Best(NamedTuple):
    """The best place that a swarm found, its cost, and the lowest cost at the start and after every iteration."""

    place: Array
    cost: float
    history: list[float]


def fly(
    cost: Callable[[Array], float], walls: Array, particles: int, iterations: int, rng: np.random.Generator, begin: Array | None = None
) -> Best:
    """Find the lowest `cost` in the box between `walls`, (2, d); particles begin within `begin`, (2, d), by default everywhere.

    `v = W v + C1 r1 (own best - x) + C2 r2 (common best - x)`, `x = x + v`, with fresh r1, r2 in 0..1 for every coordinate. Particles begin
    evenly spread and still; one that would leave the box stops at its wall.
    """
    low, high = walls
    first, last = walls if begin is None else begin
    x = first + (last - first) * rng.random((particles, len(first)))
    v = np.zeros_like(x)
    own, own_cost = x.copy(), np.array([cost(each) for each in x])
    history = [float(own_cost.min())]
    for _ in range(iterations):
        common = own[np.argmin(own_cost)]
        r1, r2 = rng.random(x.shape), rng.random(x.shape)
        v = INERTIA * v + OWN * r1 * (own - x) + COMMON * r2 * (common - x)
        reached = np.clip(x + v, low, high)
        v = np.where(reached == x + v, v, 0.0)
        x = reached
        now = np.array([cost(each) for each in x])
        better = now < own_cost
        own[better], own_cost[better] = x[better], now[better]
        history.append(float(own_cost.min()))
    winner = int(np.argmin(own_cost))
    return Best(own[winner], float(own_cost[winner]), history)


WIDE = 4.0
"""`|P3| = |gain| |1 - P1 - P2| < 4 |gain|` for stable sections."""


def solve(problem: Problem, recipe: MotionRecipe) -> Found:
    """Return the best of `iterations` over the recipe's bounds; an unstable particle costs more than any stable one.

    Raises SpecError where a section has more parameters than P's three; FitError where no particle was stable.
    """
    if problem.drives > 1:
        raise SpecError(
            "`solver: swarm` looks for P1, P2 and P3 alone, which an offset, a load or bumpless switching are not",
            "use `swarm_projected`, `differential_evolution` or `least_squares`",
        )
    walls = _walls(recipe.bounds or Bounds(), problem)
    begin = None if recipe.begin is None else _walls(recipe.begin, problem)
    best = fly(lambda x: problem.rmse(x[0], x[1], x[2:]), walls, recipe.particles, recipe.iterations, problem.random, begin)
    p1, p2, p3 = best.place.tolist()
    if not stable(p1, p2):
        raise FitError(
            f"the swarm found no stable section with P1 in {walls[0, 0]:g}..{walls[1, 0]:g} and P2 in {walls[0, 1]:g}..{walls[1, 1]:g}",
            "widen `bounds`: sections are stable where |P1| < 1 and |P2| < 1 - P1",
        )
    return Found(p1, p2, np.array([p3]), best.cost, problem.evaluations, np.array(best.history))


def _walls(box: Bounds, problem: Problem) -> Array:
    """Return the lower and the upper end of P1, P2, P3, (2, 3)."""
    return np.transpose([box.p1, box.p2, box.p3 or _gains(problem)])


def _gains(problem: Problem) -> tuple[float, float]:
    """Where P3 is looked for: the span of the output over that of the input, fourfold, either sign."""
    inputs = np.concatenate([piece.drives[:, 0] for piece in problem.pieces])
    outputs = np.concatenate([piece.y for piece in problem.pieces])
    widest = WIDE * float(np.ptp(outputs)) / float(np.ptp(inputs))
    return -widest, widest


def solve_projected(problem: Problem, recipe: MotionRecipe) -> Found:
    """Return the best of `iterations` over all frequencies and dampings of `plane`."""
    low = np.array([math.log(SLOWEST), LEAST_DAMPED])
    high = np.array([math.log(FASTEST), MOST_DAMPED])

    def poles(place: Array) -> tuple[float, float]:
        return of_oscillator(math.exp(place[0]), float(place[1]))

    best = fly(
        lambda place: problem.projected_rmse(*poles(place)), np.array([low, high]), recipe.particles, recipe.iterations, problem.random
    )
    return problem.found(*poles(best.place), best.history)
