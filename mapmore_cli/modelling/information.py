"""How many terms: criteria that need no tolerance."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array

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
    """Number of terms at which a criterion is least; the smaller number wins a tie."""
    return int(np.argmin(values)) + 1
