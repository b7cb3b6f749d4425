"""Least squares within bounds: Levenberg and Marquardt's method from several starts at once.

Over the few rows of a table, fifty descents side by side cost little more than one: the 108 descents of the run of a table of 60 points
take 0.13 s, and 1.8 s one by one in `scipy.optimize.least_squares`, which ends in the same minima (to 1e-6) and would add half to that run.
A step solves

    (J'J + mu D) dx = -J'r,   D = diag(J'J), the largest so far,

for the coordinates that are free; those at a bound are held while the slope leads out of it, and steps are cut off at the bounds. The
damping mu follows Nielsen's rule (the gain of a step beside what the linear model promised).

Most starts of a problem lead to one minimum, and some crawl where no minimum is worth finding. So a descent ends early where it has joined
one that has ended, or where at its pace it cannot come near that one's end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.errors import FitError
from mapmore_cli.modelling.literature.problem import Nonlinear

EVALUATIONS = 200
PACE = 10  # evaluations over which the pace of a descent is measured
FAR_ABOVE = 1.5  # times the least sum of squares of an end: a descent that cannot come below it in the evaluations left is given up
SAME_COST = 1e-6  # relative, and
SAME_PLACE = 1e-2  # of the length of the coordinates (in D): within both, a descent has joined another that has ended
DAMPING = 1e-3  # at the start, of the diagonal
LEAST_DAMPING = 1e-14  # so that dependent coordinates never make the matrix singular
TINY = 1e-300  # of the diagonal: a coordinate on which nothing depends stays where it is
TOUCHING = 1e-6  # of the range of a coordinate (or absolute, where it has no end)

Bounds = tuple[Array, Array]
System = Callable[[Array], tuple[Array, Array]]
"""From s places, `(s, k)`, to the residuals there, `(s, n)`, and their derivatives, `(s, n, k)`; not finite where it has no value."""


@dataclass(frozen=True)
class End:
    """Where a descent ended, `(k,)`; the sum of squares there, up to a factor of its method's; whether it had converged."""

    x: Array
    cost: float
    converged: bool

    @property
    def status(self) -> str:
        """That of a fit which ends here."""
        return "converged" if self.converged else "stopped_by_limit"


@dataclass
class _Descents:
    """The descents that still go on: for every one its number, place, sum of squares, J'J, J'r, D, the damping and what it grows by."""

    number: IntArray
    x: Array
    cost: Array
    square: Array
    slope: Array
    diagonal: Array
    damping: Array
    growth: Array

    def only(self, rows: BoolArray) -> _Descents:
        return _Descents(**{name: values[rows] for name, values in vars(self).items()})


def descend(system: System, starts: Sequence[Array], bounds: Bounds, tolerance: float) -> list[End]:
    """Return the nearest minimum of `|r(x)|^2` from every start in which it is finite, in their order.

    A descent has converged where its steps, or what they gain, fall below the `tolerance` (relative), or where it has joined another that
    has: then its end is that one's. One that cannot come near the end of another in time is given up. `bounds` are the lowest and the
    highest coordinates, each `(k,)`.
    """
    going = _begun(system, np.clip(np.array(starts), *bounds))
    ends: dict[int, End] = {}
    least, lowest = np.inf, np.zeros(going.x.shape[1])
    costs = np.full((EVALUATIONS, len(starts)), np.inf)
    for evaluation in range(EVALUATIONS):
        if not len(going.number):
            break
        costs[evaluation, going.number] = going.cost
        done = _step(going, system, bounds, tolerance)
        if done.any():
            arrived = going.only(done)
            ends |= _ended(arrived, converged=True)
            deepest = int(np.argmin(arrived.cost))
            if arrived.cost[deepest] < least:
                least, lowest = float(arrived.cost[deepest]), arrived.x[deepest]
            going = going.only(~done)
        joined = _joined(going, least, lowest)
        slow = _slow(going, least, costs[max(0, evaluation + 1 - PACE)], EVALUATIONS - evaluation - 1)
        if joined.any() or slow.any():
            ends |= {int(one): End(lowest, 0.5 * least, True) for one in going.number[joined]}
            ends |= _ended(going.only(slow), converged=False)
            going = going.only(~(joined | slow))
    ends |= _ended(going, converged=False)
    return [ends[number] for number in sorted(ends)]


def _joined(at: _Descents, least: float, lowest: Array) -> BoolArray:
    """Which descents, `(s,)`, have come to the deepest end so far: its cost, and place, `(k,)`."""
    apart, length = (np.einsum("si,si->s", at.diagonal, np.broadcast_to(part, at.x.shape) ** 2) for part in (at.x - lowest, lowest))
    return np.asarray((at.cost >= least) & (at.cost <= (1 + SAME_COST) * least) & (apart <= SAME_PLACE**2 * length))


def _slow(at: _Descents, least: float, before: Array, left: int) -> BoolArray:
    """Which descents will not come near the `least` cost in the evaluations `left` at their pace since they had those `before`, `(s,)`."""
    with np.errstate(all="ignore"):
        later = at.cost * (at.cost / before[at.number]) ** (left / PACE)
    return np.asarray((at.cost > FAR_ABOVE * least) & (later > FAR_ABOVE * least) & (EVALUATIONS - left >= PACE))


def _begun(system: System, x: Array) -> _Descents:
    cost, square, slope = _linearised(system, x)
    every, diagonal = np.arange(len(x)), np.maximum(_diagonal(square), TINY)
    begun = _Descents(every, x, cost, square, slope, diagonal, np.full(len(x), DAMPING), np.full(len(x), 2.0))
    return begun.only(np.isfinite(cost))


def _step(at: _Descents, system: System, bounds: Bounds, tolerance: float) -> BoolArray:
    """One step of every descent, taken where it gains; which of them have converged, `(s,)`."""
    x = np.clip(at.x + _towards(at, bounds), *bounds)
    cost, square, slope = _linearised(system, x)
    step, finite = x - at.x, np.isfinite(cost)
    promised = -(2.0 * np.einsum("si,si->s", at.slope, step) + np.einsum("si,sij,sj->s", step, at.square, step))
    gained = at.cost - cost
    small = np.einsum("si,si->s", at.diagonal, step**2) <= tolerance**2 * np.einsum("si,si->s", at.diagonal, at.x**2)
    done = finite & (small | ((np.abs(gained) <= tolerance * at.cost) & (promised <= tolerance * at.cost)))
    taken = gained > 0
    ratio = np.divide(gained, promised, out=np.ones_like(promised), where=promised > 0)
    change = np.where(taken, np.maximum(1 / 3, 1 - (2 * np.clip(ratio, -1.0, 2.0) - 1) ** 3), at.growth)
    at.damping = np.maximum(at.damping * change, LEAST_DAMPING)
    at.growth = np.where(taken, 2.0, 2.0 * at.growth)
    done |= at.damping > 1 / TINY
    at.x[taken], at.cost[taken], at.square[taken], at.slope[taken] = x[taken], cost[taken], square[taken], slope[taken]
    at.diagonal[taken] = np.maximum(at.diagonal[taken], _diagonal(square[taken]))
    return np.asarray(done)


def _towards(at: _Descents, bounds: Bounds) -> Array:
    """Return the damped steps of Gauss and Newton, `(s, k)`, zero where a bound holds a coordinate."""
    lower, upper = bounds
    held = ((at.x <= lower) & (at.slope > 0)) | ((at.x >= upper) & (at.slope < 0))
    free = ~held
    matrix = at.square * (free[:, :, None] & free[:, None, :])
    places = np.arange(at.x.shape[1])
    matrix[:, places, places] = np.where(held, 1.0, _diagonal(at.square) + at.damping[:, None] * at.diagonal)
    lengths = np.sqrt(_diagonal(matrix))
    scaled = matrix / (lengths[:, :, None] * lengths[:, None, :])
    return np.asarray(-np.linalg.solve(scaled, (at.slope * free / lengths)[:, :, None])[:, :, 0] / lengths)


def _ended(at: _Descents, *, converged: bool) -> dict[int, End]:
    return {int(number): End(x, 0.5 * float(cost), converged) for number, x, cost in zip(at.number, at.x, at.cost, strict=True)}


def _linearised(system: System, x: Array) -> tuple[Array, Array, Array]:
    """Sum of squares, `(s,)`, infinite where it has no value; `J'J`, `(s, k, k)`, and `J'r`, `(s, k)`."""
    with np.errstate(all="ignore"):
        r, jacobian = system(x)
        turned = jacobian.transpose(0, 2, 1)
        square, slope = turned @ jacobian, (turned @ r[:, :, None])[:, :, 0]
        cost = np.einsum("sn,sn->s", r, r)
    finite = np.isfinite(cost) & np.isfinite(square).all(axis=(1, 2)) & np.isfinite(slope).all(axis=1)
    return np.where(finite, cost, np.inf), square, slope


def _diagonal(square: Array) -> Array:
    return np.asarray(np.einsum("sii->si", square))


def onto_bounds(x: Array, bounds: Bounds) -> tuple[Array, list[int]]:
    """Return the coordinates `x`, `(k,)`, moved onto a bound where they all but touch it, and the indices of those."""
    lower, upper = bounds
    width = upper - lower
    margin = TOUCHING * np.where(np.isfinite(width), width, 1.0)
    moved = np.where(x - lower <= margin, lower, np.where(upper - x <= margin, upper, x))
    return moved, [i for i in range(len(x)) if moved[i] in (lower[i], upper[i])]


STARTS = 10
SEED = 20170714  # any fixed number: the same data give the same fit
AGREEMENT = 1e-6  # relative difference between sums of squares that are called equal
RIVAL = 1.25  # times the least sum of squares (1.12 times the RMSE), up to which another minimum is told
DISTINCT = 1e-3  # relative difference between sums of squares of minima that are called different


def draw(nonlinear: tuple[Nonlinear, ...]) -> Iterator[Array]:
    """Return `STARTS` seeded places in the intervals, each `(k,)` and log-uniform in magnitude; a single empty one without parameters."""
    rng = np.random.default_rng(SEED)
    for _ in range(STARTS if nonlinear else 1):
        yield np.array([_place(parameter, rng) for parameter in nonlinear])


def lowest(ends: Sequence[End], starts: int) -> tuple[End, str]:
    """Return the end with the lowest cost of those that the `starts` have reached, and a note on how many came to it.

    Raises FitError where there is none.
    """
    if not ends:
        raise FitError("the formula has no finite value at any start of its fit", "look at the units of its quantities")
    best = min(ends, key=lambda end: end.cost)
    agreeing = sum(end.cost <= (1 + AGREEMENT) * best.cost + 1e-20 for end in ends)
    return best, f"{agreeing} of {starts} starts agree on the sum of squares"


def rivals(ends: Sequence[End], best: End) -> list[End]:
    """Return converged ends in other minima than the best that are nearly as deep, one of each, the deepest first."""
    found = [best]
    for end in sorted((end for end in ends if end.converged), key=lambda end: end.cost):
        if (1 + DISTINCT) * found[-1].cost < end.cost <= RIVAL * best.cost:
            found.append(end)
    return found[1:]


def _place(parameter: Nonlinear, rng: np.random.Generator) -> float:
    lower, upper = parameter.intervals[rng.integers(len(parameter.intervals))]
    return float(lower * (upper / lower) ** rng.random())
