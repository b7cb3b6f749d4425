"""How many terms: criteria that need no tolerance."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array

ROUNDING = 1e-30
"""Floor of the unexplained fraction: below it the residual is rounding error, and more terms explain nothing."""


def information_criterion(name: str, unexplained: Array, press: Array, n: int) -> int:
    """Number of terms at which a criterion is least; the smaller number wins a tie.

    With SSE the residual sum of squares after k terms of n samples:

    - `bic`: `n ln(SSE/n) + k ln n` (Schwarz 1978);
    - `aicc`: `n ln(SSE/n) + 2k + 2k(k+1)/(n-k-1)` (Hurvich and Tsai 1989);
    - `press`: the leave-one-out sum of squares `sum (r_i / (1 - h_i))^2` (Allen 1974).

    Parameters
    ----------
    unexplained
        `SSE / y'y` after 1, 2, ... terms, (k,).
    press
        PRESS after 1, 2, ... terms, (k,); infinite or NaN where a sample has leverage one.
    n
        Number of samples.
    """
    k = np.arange(1, len(unexplained) + 1)
    likelihood = n * np.log(np.maximum(unexplained, ROUNDING))
    if name == "bic":
        value = likelihood + k * np.log(n)
    elif name == "aicc":
        freedom = n - k - 1
        value = np.where(freedom > 0, likelihood + 2 * k + 2 * k * (k + 1) / np.maximum(freedom, 1), np.inf)
    elif name == "press":
        value = np.where(np.isfinite(press), press, np.inf)
    else:
        raise ValueError(f"unknown stop rule {name!r}: tolerance, bic, aicc or press")
    return int(np.argmin(value)) + 1
