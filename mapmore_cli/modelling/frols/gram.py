"""FROLS on the normal equations: a pivoted Cholesky decomposition in which ERR chooses the pivot.

It costs next to nothing beside forming the products, but squares the condition number, and so says when its digits are used up.
"""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.frols.moments import Blocks, residual_products
from mapmore_cli.modelling.frols.select import TIE_TOLERANCE, DigitsLost, ratios

PIVOT_TOLERANCE = 1e-6
"""A downdated `q'q` below this fraction of `p'p` has lost too many digits (anything of 1e-4..1e-10 would serve)."""

RESIDUAL_TOLERANCE = 1e-9
"""A downdated residual sum of squares below this fraction of its last explicit value has lost too many digits."""

ROUNDING = 8 * float(np.finfo(np.float64).eps)
"""Error of a product `p'y`, as a fraction of `|p| |y|`; sums over blocks keep it there whatever n is."""

LEAST_DIGITS = 1e-6
"""Relative accuracy that an ERR must have to be reported."""

BALANCE = 1e-12
"""How far the sum of ERR may be from what the residual says."""


class GramRemainders:
    """Remainders known by their products only: `q'q` and `y'q` are downdated, O(M k) a step.

    Parameters
    ----------
    matrix
        `Z'Z` of scaled columns, (M+1, M+1).
    blocks
        The scaled columns, read once more where the residual is so small that its digits are lost in those of `y'y`.
    """

    def __init__(self, matrix: Array, blocks: Blocks) -> None:
        self.gram = matrix[:-1, :-1]
        self.blocks = blocks
        self.pp = np.diag(self.gram)
        self.squares = self.pp.copy()
        self.products = matrix[-1, :-1].copy()
        self.yy = self.sse = self.sse_of_products = float(matrix[-1, -1])
        self.rows = np.empty((0, len(matrix)))
        self.picks: list[int] = []
        self.live = self.pp > 0

    def reductions(self) -> tuple[Array, Array]:
        """See `Remainders`. Raises DigitsLost where a live `q'q` is mostly rounding error, or the winner is not clear."""
        if (self.squares < PIVOT_TOLERANCE * self.pp)[self.live].any():
            raise DigitsLost
        g, err = ratios(self.products, self.squares, self.live, self.yy)
        if self.live.any() and not self._clear_winner(err):
            if self.sse == self.sse_of_products:
                raise DigitsLost
            self._renew()
            return self.reductions()
        return g, err

    def _clear_winner(self, err: Array) -> bool:
        best = int(np.nanargmax(err))
        error, product = ROUNDING * np.sqrt(self.pp[best] * self.sse_of_products), abs(self.products[best])
        if error <= TIE_TOLERANCE * product:
            return True
        return bool(error <= LEAST_DIGITS * product and np.count_nonzero(err >= err[best] * (1 - error / product)) == 1)

    def choose(self, pick: int) -> Array:
        """See `Remainders`."""
        length = np.sqrt(self.squares[pick])
        row = np.append((self.gram[pick] - self.rows[:, pick] @ self.rows[:, :-1]) / length, self.products[pick] / length)
        row[pick] = length
        self.rows = np.vstack([self.rows, row])
        self.picks.append(pick)
        self.live[pick] = False
        self.squares -= row[:-1] ** 2
        self.products -= row[-1] * row[:-1]
        self.sse -= float(row[-1]) ** 2
        if self.sse < RESIDUAL_TOLERANCE * self.sse_of_products:
            self._renew()
        return row

    def _renew(self) -> None:
        """Products with the residual itself instead of y, so that they keep their digits however small it is.

        What rounding left of the chosen columns in `r = y - P_chosen theta` is `U U'r`, with `R' U'r = P_chosen'r`. Raises DigitsLost where
        residual and sum of ERR together are not `y'y`: the chosen columns have lost too many digits.
        """
        R = np.triu(self.rows[:, self.picks])
        theta = np.asarray(np.linalg.solve(R, self.rows[:, -1]), dtype=np.float64)
        products, square = residual_products(self.blocks, np.array(self.picks), theta)
        along = np.linalg.solve(R.T, products[self.picks])
        self.products = products - along @ self.rows[:, :-1]
        self.sse = self.sse_of_products = max(0.0, square - float(along @ along))
        explained = float(self.rows[:, -1] @ self.rows[:, -1])
        if abs(self.yy - explained - self.sse) > BALANCE * self.yy:
            raise DigitsLost
