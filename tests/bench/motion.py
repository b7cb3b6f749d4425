"""A swarm over one section of a model of motion, beside least squares and beside a simulation by a
Python loop.
"""

from __future__ import annotations

import numpy as np
from timing import median_seconds

from mapmore_cli.annexes.motion.problem import MotionRecipe, Piece, Problem
from mapmore_cli.annexes.motion.simulation import response
from mapmore_cli.annexes.motion.solvers import ITERATIONS, PARTICLES, SOLVERS

SAMPLES = 20_000
STEP = 0.05  # s
SECTION = (0.451259, 0.305468, 0.519089)  # P table 1, linear
RUNS = 3
LOOPED = 5  # simulations that the loop is timed with; it does nothing else


def motion():
    """Seconds of every solver with 50 particles and 20 iterations, of as many simulations by filter
    and by loop.
    """
    u = 2.5 - 2.5 * np.cos(2 * np.pi * 0.25 * STEP * np.arange(SAMPLES))
    p1, p2, p3 = SECTION
    y = response(p1, p2, p3 * u) + 0.05 * np.random.default_rng(20).standard_normal(SAMPLES)
    piece = Piece(u[:, np.newaxis], y, np.ones(SAMPLES, dtype=bool), np.zeros(SAMPLES, dtype=int))
    recipe = MotionRecipe(input="input", output="displacement", step=STEP)
    simulations = PARTICLES * (ITERATIONS + 1)
    problem = Problem([piece])
    one = (
        median_seconds(lambda: [problem.rmse(p1, p2, np.array([p3])) for _ in range(LOOPED)], RUNS)
        / LOOPED
    )
    loop = median_seconds(lambda: [looped(u.tolist()) for _ in range(LOOPED)], 1) / LOOPED
    return {
        "samples": SAMPLES,
        "simulations": simulations,
        "filter": simulations * one,
        "loop": simulations * loop,
        **{
            name: median_seconds(lambda solve=solve: solve(Problem([piece]), recipe), RUNS)
            for name, solve in SOLVERS.items()
        },
    }


def looped(u):
    p1, p2, p3 = SECTION
    x1 = x2 = p3 * u[0] / (1 - p1 - p2)
    values = []
    for now in u:
        values.append(x1)
        x1, x2 = x2, p1 * x1 + p2 * x2 + p3 * now
    return values
