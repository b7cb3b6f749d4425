"""Least squares within bounds: Levenberg and Marquardt's method from several starts at once.

Over the few rows of a table, ten descents side by side cost hardly more than one. A step solves

    (J'J + mu D) dx = -J'r,   D = diag(J'J), the largest so far,

for the coordinates that are free; those at a bound are held while the slope leads out of it, and steps are cut off at the bounds. The
damping mu follows Nielsen's rule (the gain of a step beside what the linear model promised).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray

EVALUATIONS = 200
PATIENCE = 10  # evaluations in which a descent far above another's end has to gain
LITTLE = 0.01  # of its sum of squares, or it is given up
FAR_ABOVE = 1.5  # times the sum of squares of that end
DAMPING = 1e-3  # at the start, of the diagonal
LEAST_DAMPING = 1e-14  # so that dependent coordinates never make the matrix singular
TINY = 1e-300  # of the diagonal: a coordinate on which nothing depends stays where it is
TOUCHING = 1e-6  # of the range of a coordinate (or absolute, where it has no end)

Bounds = tuple[Array, Array]
System = Callable[[Array], tuple[Array, Array]]
"""From s places, `(s, k)`, to the residuals there, `(s, n)`, and their derivatives, `(s, n, k)`; not finite where it has no value."""


@dataclass(frozen=True)
class End:
    """Where a descent ended, `(k,)`; half of the sum of squares there; whether it had converged."""

    x: Array
    cost: float
    converged: bool


@dataclass
class _Descents:
    """The descents that still go on: for every one its place, sum of squares, J'J, J'r, D, the damping and what it grows by."""

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
    """The nearest minimum of `|r(x)|^2` from every start in which it is finite, in their order.

    A descent has converged where its steps, or what they gain, fall below the `tolerance` (relative). One that crawls far above the end of
    another is given up. `bounds` are the lowest and the highest coordinates, each `(k,)`.
    """
    going = _begun(system, np.clip(np.array(starts), *bounds))
    ends: dict[int, End] = {}
    before = np.full(len(starts), np.inf)
    for evaluation in range(EVALUATIONS):
        if ends and evaluation % PATIENCE == 0:
            least = 2.0 * min(end.cost for end in ends.values())
            crawls = (going.cost > FAR_ABOVE * least) & (going.cost > (1 - LITTLE) * before[going.number])
            ends |= _ended(going.only(crawls), converged=False)
            going = going.only(~crawls)
        if not len(going.number):
            break
        if evaluation % PATIENCE == 0:
            before[going.number] = going.cost
        done = _step(going, system, bounds, tolerance)
        if done.any():
            ends |= _ended(going.only(done), converged=True)
            going = going.only(~done)
    ends |= _ended(going, converged=False)
    return [ends[number] for number in sorted(ends)]


def _begun(system: System, x: Array) -> _Descents:
    cost, square, slope = _linearised(system, x)
    every = np.arange(len(x))
    begun = _Descents(every, x, cost, square, slope, np.maximum(_diagonal(square), TINY), np.full(len(x), DAMPING), np.full(len(x), 2.0))
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
    """The damped steps of Gauss and Newton, `(s, k)`, zero where a bound holds a coordinate."""
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
    """The coordinates `x`, `(k,)`, moved onto a bound where they all but touch it, and the indices of those."""
    lower, upper = bounds
    width = upper - lower
    margin = TOUCHING * np.where(np.isfinite(width), width, 1.0)
    moved = np.where(x - lower <= margin, lower, np.where(upper - x <= margin, upper, x))
    return moved, [i for i in range(len(x)) if moved[i] in (lower[i], upper[i])]
