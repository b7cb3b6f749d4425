"""Ways to find a section's parameters, by name. A further one is a further file with a `solve`."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from mapmore_cli.modelling.motion.problem import Found, MotionRecipe, Problem
from mapmore_cli.modelling.motion.solvers import differential_evolution, least_squares, swarm

Solver = Callable[[Problem, MotionRecipe], Found]

SOLVERS: Mapping[str, Solver] = {
    "least_squares": least_squares.solve,
    "differential_evolution": differential_evolution.solve,
    "swarm": swarm.solve,
    "swarm_projected": swarm.solve_projected,
}

NAMES = tuple(SOLVERS)


def solve(problem: Problem, recipe: MotionRecipe) -> Found:
    """Return what the recipe's solver finds, polished where it says so."""
    found = SOLVERS[recipe.solver](problem, recipe)
    return least_squares.polish(problem, found) if recipe.polish else found
