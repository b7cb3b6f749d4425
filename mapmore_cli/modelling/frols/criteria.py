"""How many terms: criteria that need no tolerance (BIC, AICc), and the leave-one-out error of every number of terms."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.fits import Selection
from mapmore_cli.modelling.frols.moments import Blocks, scaled
from mapmore_cli.modelling.frols.select import Path, Stopping

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
