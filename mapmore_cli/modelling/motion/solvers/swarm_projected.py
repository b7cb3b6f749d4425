"""`swarm_projected`: the same swarm over the logarithm of the natural frequency and the damping ratio; the weights follow by projection."""

from __future__ import annotations

import math

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.motion.problem import Found, MotionRecipe, Problem
from mapmore_cli.modelling.motion.sections import FASTEST, LEAST_DAMPED, MOST_DAMPED, SLOWEST, of_oscillator
from mapmore_cli.modelling.motion.solvers.swarm import fly


def solve(problem: Problem, recipe: MotionRecipe) -> Found:
    """Return the best of `iterations` over all frequencies and dampings of `plane`."""
    low = np.array([math.log(SLOWEST), LEAST_DAMPED])
    high = np.array([math.log(FASTEST), MOST_DAMPED])

    def poles(place: Array) -> tuple[float, float]:
        return of_oscillator(math.exp(place[0]), float(place[1]))

    best = fly(
        lambda place: problem.projected_rmse(*poles(place)), np.array([low, high]), recipe.particles, recipe.iterations, problem.random
    )
    return problem.found(*poles(best.place), best.history)
