"""Least squares within bounds from several starts, by SciPy's trust region; which minima were
found, and which of them are rivals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import FitError
from mapmore_cli.modelling.literature.problem import Nonlinear

EVALUATIONS = 200
FEWEST_DIGITS = 5e-16  # SciPy refuses tolerances below the rounding of numbers
TOUCHING = 1e-6  # of the range of a coordinate (or absolute, where it has no end)

Bounds = tuple[Array, Array]
System = Callable[[Array], tuple[Array, Array]]
"""From s places, `(s, k)`, to the residuals there, `(s, n)`, and their derivatives, `(s, n, k)`;
not finite where it has no value.
"""


@dataclass(frozen=True)
class End:
    """Where a descent ended, `(k,)`; half the sum of squares there; whether it had converged."""

    x: Array
    cost: float
    converged: bool

    @property
    def status(self) -> str:
        """That of a fit which ends here."""
        return "converged" if self.converged else "stopped_by_limit"


def descend(system: System, starts: Sequence[Array], bounds: Bounds, tolerance: float) -> list[End]:
    """Return the nearest minimum of `|r(x)|^2` from every start in which it is finite, in their
    order.

    `tolerance` is relative, of the steps and of what they gain; `bounds` are the lowest and the
    highest coordinates, each `(k,)`.
    """
    from scipy.optimize import least_squares

    known: dict[bytes, tuple[Array, Array]] = {}

    def at(x: Array) -> tuple[Array, Array]:
        """Both at once: SciPy asks for the derivatives where it has asked for the residuals
        before.
        """
        if x.tobytes() not in known:
            known.clear()
            with np.errstate(all="ignore"):
                r, jacobian = (part[0] for part in system(x[None]))
            known[x.tobytes()] = (
                r if np.isfinite(jacobian).all() else np.full_like(r, np.nan),
                jacobian,
            )
        return known[x.tobytes()]

    def residual(x: Array) -> Array:
        return at(x)[0]

    def slopes(x: Array) -> Array:
        return at(x)[1]

    limit = max(tolerance, FEWEST_DIGITS)
    ends = []
    for start in starts:
        x = np.clip(start, *bounds)
        if np.isfinite(residual(x)).all():
            limits: Any = {"xtol": limit, "ftol": limit, "gtol": limit, "max_nfev": EVALUATIONS}
            found = least_squares(residual, x, slopes, bounds, x_scale="jac", **limits)
            ends.append(End(found.x, float(found.cost), found.status > 0))
    return ends


def onto_bounds(x: Array, bounds: Bounds) -> tuple[Array, list[int]]:
    """Return the coordinates `x`, `(k,)`, moved onto a bound where they all but touch it, and the
    indices of those.
    """
    lower, upper = bounds
    width = upper - lower
    margin = TOUCHING * np.where(np.isfinite(width), width, 1.0)
    moved = np.where(x - lower <= margin, lower, np.where(upper - x <= margin, upper, x))
    return moved, [i for i in range(len(x)) if moved[i] in (lower[i], upper[i])]


STARTS = 10
SEED = 20170714  # any fixed number: the same data give the same fit
AGREEMENT = 1e-6  # relative difference between sums of squares that are called equal
# times the least sum of squares (1.12 times the RMSE), up to which another minimum is told
RIVAL = 1.25
DISTINCT = 1e-3  # relative difference between sums of squares of minima that are called different


def draw(nonlinear: tuple[Nonlinear, ...]) -> Iterator[Array]:
    """Return `STARTS` seeded places in the intervals, each `(k,)` and log-uniform in magnitude; a
    single empty one without parameters.
    """
    rng = np.random.default_rng(SEED)
    for _ in range(STARTS if nonlinear else 1):
        yield np.array([_place(parameter, rng) for parameter in nonlinear])


def lowest(ends: Sequence[End], starts: int) -> tuple[End, str]:
    """Return the end with the lowest cost of those that the `starts` have reached, and a note on
    how many came to it.

    Raises FitError where there is none.
    """
    if not ends:
        raise FitError(
            "the formula has no finite value at any start of its fit",
            "look at the units of its quantities",
        )
    best = min(ends, key=lambda end: end.cost)
    agreeing = sum(end.cost <= (1 + AGREEMENT) * best.cost + 1e-20 for end in ends)
    return best, f"{agreeing} of {starts} starts agree on the sum of squares"


def rivals(ends: Sequence[End], best: End) -> list[End]:
    """Return converged ends in other minima than the best that are nearly as deep, one of each, the
    deepest first.
    """
    found = [best]
    for end in sorted((end for end in ends if end.converged), key=lambda end: end.cost):
        if (1 + DISTINCT) * found[-1].cost < end.cost <= RIVAL * best.cost:
            found.append(end)
    return found[1:]


def _place(parameter: Nonlinear, rng: np.random.Generator) -> float:
    lower, upper = parameter.intervals[rng.integers(len(parameter.intervals))]
    return float(lower * (upper / lower) ** rng.random())
