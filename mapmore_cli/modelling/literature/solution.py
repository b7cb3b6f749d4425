"""What a fitting method hands back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.literature.problem import Nonlinear, Problem


@dataclass(frozen=True)
class Solution:
    """Linear parameters `beta`, `(m,)`, and coordinates `c`, `(k,)`, of a `Problem`; `status` and `method` as in `FormulaFit`."""

    beta: Array
    c: Array
    status: str
    method: str
    notes: tuple[str, ...] = ()
    rivals: tuple[tuple[Array, Array], ...] = ()  # beta and c of other minima that are nearly as deep


def failure(problem: Problem, method: str) -> Solution:
    """The solution where the formula overflows from every start: NaN throughout."""
    nothing = np.full(len(problem.linear), np.nan), np.full(len(problem.nonlinear), np.nan)
    return Solution(*nothing, "failed", method, ("every start overflowed",))


def at_limit(parameter: Nonlinear, limit: float) -> str:
    """The note for a parameter that ends at the `limit` of its coordinate."""
    return f"{parameter.name} runs to the limit of what is sought, {parameter.written(limit)}"
