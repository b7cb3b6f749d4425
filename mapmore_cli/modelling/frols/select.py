"""The greedy choice of FROLS, whatever holds the remainders of the candidates; and the criteria that choose the number of terms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.fits import Selection
from mapmore_cli.modelling.frols.moments import Blocks, scaled

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


ROUNDING = 1e-30
"""Floor of the unexplained fraction: below it the residual is rounding error, and more terms explain nothing."""


def information_criterion(name: str, unexplained: Array, n: int) -> Array:
    """Value of a criterion after 1, 2, ... terms, (k,); the least is the best. Infinite where the samples are too few to say.

    With SSE the residual sum of squares after k terms of n samples:

    - `bic`: `n ln(SSE/n) + k ln n` (Schwarz 1978);
    - `aicc`: `n ln(SSE/n) + 2k + 2k(k+1)/(n-k-1)` (Hurvich and Tsai 1989).

    The third criterion, the leave-one-out error, needs the samples: see `frols.press`.

    Parameters
    ----------
    name
        `bic` or `aicc`.
    unexplained
        `SSE / y'y` after 1, 2, ... terms, (k,).
    n
        Number of samples.
    """
    k = np.arange(1, len(unexplained) + 1)
    likelihood: Array = n * np.log(np.maximum(unexplained, ROUNDING))
    if name == "bic":
        bic: Array = likelihood + k * np.log(n)
        return bic
    freedom = n - k - 1
    aicc: Array = np.where(freedom > 0, likelihood + 2 * k + 2 * k * (k + 1) / np.maximum(freedom, 1), np.inf)
    return aicc


def fewest(values: Array) -> int:
    """Return number of terms at which a criterion is least; the smaller number wins a tie."""
    return int(np.argmin(values)) + 1


FULL_LEVERAGE = 1e-8
"""A sample with `1 - h` below this alone decides a coefficient; its error when left out is unknown."""


def press(blocks: Blocks, chosen: IntArray, factor: Array, projections: Array) -> Array:
    """`PRESS_k = sum_i (r_ik / (1 - h_ik))^2` after 1, 2, ... terms (Allen 1974), (k,); infinite where a sample has leverage one.

    The rows of the orthonormal basis are those of `U = P_chosen R^-1`; its first k columns give the leverages `h_ik = sum_j U_ij^2` and the
    residuals `r_ik = y_i - sum_j U_ij c_j`.

    Parameters
    ----------
    chosen
        Indices of the chosen candidates in the order of selection, (k,).
    factor
        Upper triangular R of the chosen candidates, (k, k).
    projections
        `c = U'y`, (k,).
    """
    total = np.zeros(len(chosen))
    for P, y in blocks():
        U = np.linalg.solve(factor.T, P[:, chosen].T).T
        residual = y[:, None] - np.cumsum(U * projections, axis=1)
        left = 1 - np.cumsum(U**2, axis=1)
        total += np.square(residual / np.where(left > FULL_LEVERAGE, left, np.nan)).sum(axis=0)
    return np.where(np.isnan(total), np.inf, total)


def finished(path: Path, scale: Array, samples: int, blocks: Blocks, stopping: Stopping) -> Selection:
    """Return the selection at the number of terms that the stop rule prefers.

    Parameters
    ----------
    path
        Iterations on columns of `Z = [P y]` divided by `scale`, (M+1,).
    blocks
        The rows of `Z` before scaling; read for `press` only.
    """
    k, criterion = len(path.steps), stopping.criterion
    if criterion == "tolerance" or k == 0:
        return _selection(path, k, path.stop, scale, samples)
    if criterion == "press":
        best = fewest(press(scaled(blocks, scale), *_factor(path, k, len(scale))))
    else:
        unexplained = np.array([step.sse for step in path.steps]) / path.yy
        best = fewest(information_criterion(criterion, unexplained, samples))
    return _selection(path, best, criterion if best < k else path.stop, scale, samples)


def _factor(path: Path, k: int, width: int) -> tuple[IntArray, Array, Array]:
    """Return the first k chosen indices, their triangular factor R (k, k), and the projections `c = U'y` (k,)."""
    chosen = np.array([step.pick for step in path.steps[:k]], dtype=np.int64)
    rows = np.array([step.row for step in path.steps[:k]]).reshape(k, width)
    return chosen, np.triu(rows[:, chosen]), rows[:, -1]


def _selection(path: Path, k: int, stop: str, scale: Array, samples: int) -> Selection:
    steps, M = path.steps[:k], len(scale) - 1
    chosen, R, projections = _factor(path, k, len(scale))
    column_scale, y_scale = scale[chosen], float(scale[-1])
    lengths = np.diag(R)
    g = projections / lengths
    sse = steps[-1].sse if k else path.yy
    inverse = np.linalg.inv(R)
    variance = sse / (samples - k) if samples > k else np.nan
    return Selection(
        chosen=chosen,
        g=g * y_scale / column_scale,
        err=projections**2 / path.yy,
        theta=np.linalg.solve(R, projections) * y_scale / column_scale,
        theta_error=np.sqrt(variance) * np.linalg.norm(inverse, axis=1) * y_scale / column_scale,
        a=R / lengths[:, None] * column_scale / column_scale[:, None],
        g_all=np.array([step.g for step in steps]).reshape(k, M) * y_scale / scale[:-1],
        err_all=np.array([step.err for step in steps]).reshape(k, M),
        runner_up=np.array([step.runner_up for step in steps], dtype=np.int64),
        tied=np.array([step.tied for step in steps], dtype=np.int64),
        condition=float(np.linalg.cond(R * column_scale)) if k else 1.0,
        sse=sse * y_scale**2,
        yy=path.yy * y_scale**2,
        samples=samples,
        stop=stop,
    )
