"""A particle swarm (P eq 11 and 12), from an explicit seed."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array

INERTIA, OWN, COMMON = 0.9, 2.0, 2.0
"""P's W, C1 and C2. They lie outside of the region in which a swarm settles: it needs `C1 + C2 < 24 (1 - W^2)/(7 - 5 W)`, here 1.8."""


class Best(NamedTuple):
    """The best place that a swarm found, its cost, and the lowest cost at the start and after every iteration."""

    place: Array
    cost: float
    history: list[float]


def fly(cost: Callable[[Array], float], low: Array, high: Array, particles: int, iterations: int, seed: int) -> Best:
    """Lowest `cost` that a swarm finds in the box between `low` and `high`, (d,) each.

    `v = W v + C1 r1 (own best - x) + C2 r2 (common best - x)`, `x = x + v`, with fresh r1, r2 in 0..1 for every coordinate. Particles begin
    evenly spread and still; one that would leave the box stops at its wall.
    """
    rng = np.random.default_rng(seed)
    x = low + (high - low) * rng.random((particles, len(low)))
    v = np.zeros_like(x)
    own, own_cost = x.copy(), np.array([cost(each) for each in x])
    history = [float(own_cost.min())]
    for _ in range(iterations):
        common = own[np.argmin(own_cost)]
        r1, r2 = rng.random(x.shape), rng.random(x.shape)
        v = INERTIA * v + OWN * r1 * (own - x) + COMMON * r2 * (common - x)
        reached = np.clip(x + v, low, high)
        v = np.where(reached == x + v, v, 0.0)
        x = reached
        now = np.array([cost(each) for each in x])
        better = now < own_cost
        own[better], own_cost[better] = x[better], now[better]
        history.append(float(own_cost.min()))
    winner = int(np.argmin(own_cost))
    return Best(own[winner], float(own_cost[winner]), history)
