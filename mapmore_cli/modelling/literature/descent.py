"""Descend from starting values to minima of a sum of squares, and compare the minima that the
descents reach.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.expressions import NotFinite
from mapmore_cli.modelling.literature.problem import Nonlinear

Bounds = tuple[Array | float, Array | float]
System = Callable[[Array], tuple[Array, Array]]
"""Function from coordinates, shape (k,), to the residuals, shape (n,), and their derivatives, shape
(n, k). It may raise `NotFinite`.
"""


class End(NamedTuple):
    """Result of one search from one start: the final coordinates, shape (k,), half the sum of
    squares there, and True if the search converged.
    """

    x: Array
    cost: float
    converged: bool

    @property
    def status(self) -> str:
        """Return the status of a fit that has this result."""
        return "converged" if self.converged else "stopped_by_limit"


# the search ends when the coordinates or the sum of squares change by less than this fraction
TOLERANCE = 1e-15
EVALUATIONS = 400
# residual in place of an overflow; it is so large that the search rejects the step
REFUSED = 1e100


def descend(
    system: System,
    starts: Sequence[Array],
    bounds: Bounds = (-np.inf, np.inf),
    method: Literal["trf", "lm"] = "trf",
    evaluations: int | None = None,
) -> list[End]:
    """Minimise `|r(x)|^2` with SciPy's least squares from every start at which r and its
    derivatives are finite, and return the results in the order of the starts.

    `bounds` holds the lower and upper bounds of the coordinates, shape (k,) each; the method `lm`
    has no bounds. From each start, at most `evaluations` evaluations are made, by default
    `EVALUATIONS`.
    """
    from scipy.optimize import least_squares

    # cached, because SciPy asks for residuals and then for derivatives at the same point
    @lru_cache(maxsize=1)
    def at(place: bytes) -> tuple[Array, Array] | None:
        try:
            with np.errstate(all="ignore"):
                both = system(np.frombuffer(place))
        except NotFinite:
            return None
        return both if all(np.isfinite(part).all() for part in both) else None

    def residual(x: Array) -> Array:
        both = at(x.tobytes())
        return refused if both is None else both[0]

    def slopes(x: Array) -> Array:
        both = at(x.tobytes())
        assert both is not None
        return both[1]

    ends = []
    for start in starts:
        x = np.clip(start, *bounds)
        first = at(x.tobytes())
        if first is not None:
            refused = np.full(len(first[0]), REFUSED)
            end = least_squares(
                residual,
                x,
                slopes,
                bounds,
                method,
                ftol=TOLERANCE,
                xtol=TOLERANCE,
                gtol=TOLERANCE,
                x_scale="jac",
                max_nfev=evaluations or EVALUATIONS,
            )
            ends.append(End(end.x, float(end.cost), end.status > 0))
    return ends


# A coordinate is at a bound if its distance from the bound is at most this fraction of its range.
# If the range is infinite, the distance itself must be at most this number.
TOUCHING = 1e-6


def onto_bounds(x: Array, bounds: tuple[Array, Array]) -> tuple[Array, list[int]]:
    """Return the coordinates `x`, shape (k,), with each coordinate that is very close to a bound
    moved to the bound. Also return the indices of the coordinates at a bound.
    """
    lower, upper = bounds
    width = upper - lower
    margin = TOUCHING * np.where(np.isfinite(width), width, 1.0)
    moved = np.where(x - lower <= margin, lower, np.where(upper - x <= margin, upper, x))
    return moved, [i for i in range(len(x)) if moved[i] in (lower[i], upper[i])]


AGREEMENT = 1e-6  # sums of squares with a smaller relative difference are regarded as equal
# another minimum is reported if its sum of squares is at most this multiple of the smallest one
RIVAL = 1.25
# minima are different if the relative difference of their sums of squares is larger than this
DISTINCT = 1e-3


def agreement(ends: Sequence[End], best: End, starts: int) -> str:
    """Return a note that says from how many of the `starts` the search reached the smallest sum of
    squares.
    """
    agreeing = sum(end.cost <= (1 + AGREEMENT) * best.cost + 1e-20 for end in ends)
    return f"{agreeing} of {starts} starts found the same sum of squares"


def rivals(ends: Sequence[End], best: End) -> list[End]:
    """Return the results at other local minima that are nearly as low as the best one. There is one
    converged result for each minimum, and the lowest minimum comes first.
    """
    distinct = [best]
    for end in sorted(ends, key=lambda end: end.cost):
        if end.converged and (1 + DISTINCT) * distinct[-1].cost < end.cost <= RIVAL * best.cost:
            distinct.append(end)
    return distinct[1:]


STARTS = 10
SEED = 20170714  # fixed seed of the random starts, so that the same data give the same fit


def drawn_starts(
    nonlinear: tuple[Nonlinear, ...], count: int = STARTS, seed: int = SEED
) -> Iterator[Array]:
    """Yield random points in the intervals of the k nonlinear parameters, shape (k,) each. The
    logarithms of the magnitudes are distributed uniformly. The same seed gives the same points.
    """
    rng = np.random.default_rng(seed)
    for _ in range(count):
        place = []
        for parameter in nonlinear:
            low, high = parameter.intervals[rng.integers(len(parameter.intervals))]
            place.append(low * (high / low) ** rng.random())
        yield np.array(place)
