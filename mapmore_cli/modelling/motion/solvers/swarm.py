"""`swarm`: the swarm as published, over P1, P2 and P3 (P section 2.2)."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.errors import FitError, SpecError
from mapmore_cli.modelling.motion.plane import stable
from mapmore_cli.modelling.motion.problem import Found, Problem
from mapmore_cli.modelling.motion.recipe import MotionRecipe
from mapmore_cli.modelling.motion.solvers.particles import fly

WIDE = 4.0
"""`|P3| = |gain| |1 - P1 - P2| < 4 |gain|` for stable sections."""


def solve(problem: Problem, recipe: MotionRecipe) -> Found:
    """The best of `iterations` over the recipe's box; an unstable particle costs more than any stable one.

    Raises
    ------
    SpecError
        Where a section has more parameters than P's three.
    FitError
        Where no particle was stable.
    """
    if problem.drives > 1:
        raise SpecError(
            "`solver: swarm` looks for P1, P2 and P3 alone, which an offset, a load or bumpless switching are not",
            "use `swarm_projected`, `differential_evolution` or `least_squares`",
        )
    low, high = np.transpose([recipe.box.p1, recipe.box.p2, recipe.box.p3 or _gains(problem)])
    best = fly(lambda x: problem.rmse(x[0], x[1], x[2:]), low, high, recipe.particles, recipe.iterations, recipe.seed)
    p1, p2, p3 = best.place.tolist()
    if not stable(p1, p2):
        raise FitError(
            f"the swarm found no stable section with P1 in {low[0]:g}..{high[0]:g} and P2 in {low[1]:g}..{high[1]:g}",
            "widen `bounds`: sections are stable where |P1| < 1 and |P2| < 1 - P1",
        )
    return Found(p1, p2, np.array([p3]), best.cost, problem.evaluations, np.array(best.history))


def _gains(problem: Problem) -> tuple[float, float]:
    """Where P3 is looked for: the span of the output over that of the input, fourfold, either sign."""
    inputs = np.concatenate([piece.drives[:, 0] for piece in problem.pieces])
    outputs = np.concatenate([piece.y for piece in problem.pieces])
    widest = WIDE * float(np.ptp(outputs)) / float(np.ptp(inputs))
    return -widest, widest
