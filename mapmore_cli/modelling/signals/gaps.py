"""Gaps and resets of the clock: where a record breaks off and goes on later."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray

ROUNDING = 1e-9  # relative: a step of exactly the limit is no gap, however it was rounded


@dataclass(frozen=True)
class Gaps:
    """Gaps in a record of n samples: `after` `(g,)` is the index of the sample before each, `lengths` `(g,)` the steps in time.

    `samples_missing` is how many samples the gaps lack, at the median step of the record.
    """

    after: IntArray
    lengths: Array
    samples_missing: int

    def __len__(self) -> int:
        return len(self.after)


def find_gaps(time: Array, longer_than: float) -> Gaps:
    """Return the gaps longer than `longer_than` between stamps `time` `(n,)`, which never decrease; both in the same unit."""
    steps = np.diff(time)
    slack = ROUNDING * longer_than + 4 * np.finfo(float).eps * float(np.abs(time).max(initial=0.0))
    after = np.flatnonzero(steps > longer_than + slack)
    usual = typical_step(time)
    missing = int(np.round(steps[after] / usual - 1).clip(0).sum()) if usual > 0 else 0
    return Gaps(after, steps[after], missing)


def typical_step(time: Array) -> float:
    """Return the median of the steps that are not zero; zero where there is none."""
    steps = np.diff(time)
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else 0.0


def find_resets(time: Array) -> IntArray:
    """Return the indices of the samples after which time runs backwards."""
    return np.flatnonzero(np.diff(time) < 0)


def pieces(n: int, breaks: IntArray) -> list[slice]:
    """Return the pieces into which n samples fall when they are cut after each index of `breaks`, ascending."""
    edges = [0, *(int(place) + 1 for place in breaks), n]
    return [slice(begin, end) for begin, end in pairwise(edges)]
