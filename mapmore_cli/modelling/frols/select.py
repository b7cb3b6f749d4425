"""The greedy choice of FROLS, whatever holds the remainders of the candidates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray

TIE_TOLERANCE = 1e-9
"""Candidates whose ERR lies within this fraction of the best are tied; the lower dictionary index wins."""

NO_GAIN = 1e-28
"""The square of rounding error: a smaller ERR explains nothing, and a smaller residual leaves nothing to explain."""

CRITERIA = ("tolerance", "bic", "aicc", "press")
"""Rules for the number of terms."""


@dataclass(frozen=True)
class Stopping:
    """When enough terms are chosen.

    Attributes
    ----------
    max_terms
        Limit on their number; None for no limit.
    tolerance
        Unexplained fraction of `y'y` at which to stop.
    criterion
        `tolerance`; or `bic`, `aicc`, `press`, by which the number of terms is chosen afterwards.
    """

    max_terms: int | None
    tolerance: float
    criterion: str

    def __post_init__(self) -> None:
        if self.max_terms is not None and self.max_terms < 1:
            raise ValueError(f"max_terms is {self.max_terms}; it must be at least 1")
        if self.criterion not in CRITERIA:
            raise ValueError(f"unknown stop rule {self.criterion!r}: {', '.join(CRITERIA)}")

    def limit(self, n: int, M: int) -> int:
        """Return the most terms that n samples and M candidates allow."""
        return min(n, M) if self.max_terms is None else min(self.max_terms, n, M)


class DigitsLost(Exception):
    """The remainders have lost the digits that the choice depends on."""


class Remainders(Protocol):
    """What the chosen terms leave of y and of every candidate: the vectors `q` of M2 eq 2, in whatever form."""

    yy: float
    """Uncentred `y'y`."""

    sse: float
    """What the chosen terms leave of it."""

    def reductions(self) -> tuple[Array, Array]:
        """`g` and ERR of every candidate, both (M,); NaN where already chosen or dependent. Raises DigitsLost."""
        ...

    def choose(self, pick: int) -> Array:
        """Orthogonalise the others against candidate `pick`.

        Returns `u'[P y]`, (M+1,), with `u` the pick's remainder at unit length: one row of the triangular factor. Raises DigitsLost.
        """
        ...


@dataclass(frozen=True)
class Step:
    """One iteration: the pick, `g` and ERR of all candidates, the row of the triangular factor, what is left of `y'y`."""

    pick: int
    g: Array  # (M,)
    err: Array  # (M,)
    runner_up: int
    tied: int
    row: Array  # (M+1,)
    sse: float


@dataclass(frozen=True)
class Path:
    """All iterations of one selection, and why it ended."""

    steps: tuple[Step, ...]
    yy: float
    stop: str


def greedy(remainders: Remainders, stopping: Stopping, limit: int) -> Path:
    """Choose the candidate of the highest ERR (M2 eq 5) until the error is within the tolerance (eq 6) or `limit` terms are chosen (eq 7).

    The path ends with `tolerance`; `max_terms`; `no_gain` where no candidate explains anything; `rank` where none is independent of the
    chosen ones. Raises DigitsLost as the remainders do.
    """
    steps: list[Step] = []
    stop = "max_terms" if limit == stopping.max_terms else "rank"
    while len(steps) < limit:
        g, err = remainders.reductions()
        if np.isnan(err).all():
            stop = "rank"
            break
        if np.nanmax(err) <= NO_GAIN:
            stop = "no_gain"
            break
        pick, runner_up, tied = _ranking(err)
        row = remainders.choose(pick)
        steps.append(Step(pick, g, err, runner_up, tied, row, remainders.sse))
        if remainders.sse <= max(stopping.tolerance, NO_GAIN) * remainders.yy:
            stop = "tolerance"
            break
    return Path(tuple(steps), remainders.yy, stop)


def _ranking(err: Array) -> tuple[int, int, int]:
    """Return the winner, the second best (-1 where there is none) and the number of others that tie with the winner."""
    ties = _best(err)
    others = err.copy()
    others[ties[0]] = np.nan
    runner_up = -1 if np.isnan(others).all() else int(_best(others)[0])
    return int(ties[0]), runner_up, len(ties) - 1


def _best(err: Array) -> IntArray:
    """Return indices of the best candidate and of those that tie with it, ascending."""
    return np.flatnonzero(err >= np.nanmax(err) * (1 - TIE_TOLERANCE))


def ratios(products: Array, squares: Array, live: BoolArray, yy: float) -> tuple[Array, Array]:
    """`g = y'q / q'q` (M2 eq 3) and `ERR = g^2 q'q / y'y` (eq 4) of the live candidates, NaN elsewhere."""
    g = np.full(len(products), np.nan)
    np.divide(products, squares, out=g, where=live)
    return g, g * products / (yy or 1.0)
