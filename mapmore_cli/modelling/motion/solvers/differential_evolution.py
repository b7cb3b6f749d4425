"""`differential_evolution`: SciPy's, over all stable sections; the weights follow by projection."""

from __future__ import annotations

from scipy.optimize import Bounds, differential_evolution

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.motion.problem import Found, MotionRecipe, Problem
from mapmore_cli.modelling.motion.sections import EDGE, of_reflections

POPULATION = 10
"""Members for each coordinate."""


def solve(problem: Problem, recipe: MotionRecipe) -> Found:
    """Return the best of `iterations` generations, or of fewer where the population has settled."""
    history: list[float] = []

    def poles(place: Array) -> tuple[float, float]:
        return of_reflections(float(place[0]), float(place[1]), problem.reach)

    def cost(place: Array) -> float:
        value = problem.projected_rmse(*poles(place))
        history.append(min(value, history[-1]) if history else value)
        return value

    members = POPULATION * 2
    best = differential_evolution(
        cost,
        Bounds([-EDGE, -EDGE], [EDGE, EDGE]),
        popsize=POPULATION,
        maxiter=recipe.iterations,
        tol=1e-6,
        polish=False,
        seed=problem.random,
    )
    return problem.found(*poles(best.x), history[members - 1 :: members])
