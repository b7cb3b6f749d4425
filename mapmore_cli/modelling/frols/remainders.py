"""Represent the remainders of the candidates and of the output during the selection of terms: what
is left after their components along the chosen terms are subtracted.

`GramRemainders` computes inner products of the remainders from the Gram matrix, so that a tall
dictionary is read only once. `BasisRemainders` computes them with an orthonormal basis of the
chosen columns. It reads the dictionary in every step, but loses no digits. Instead of the
dictionary itself, `BasisRemainders` can also work with the triangular factor of the dictionary.
"""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.modelling.frols.moments import Blocks

# Candidates are tied if their ERR is within this fraction of the highest ERR.
# The tied candidate with the lowest index in the dictionary is chosen.
TIE_TOLERANCE = 1e-9
# a regressor p with the remainder q is linearly dependent if `q'q <= RANK_TOLERANCE p'p`
RANK_TOLERANCE = 1e-24

# `q'q` is updated by subtraction; below this fraction of `p'p`, it has lost too many digits
# Tolerances from 1e-4 to 1e-10 also work.
PIVOT_TOLERANCE = 1e-6
# The residual sum of squares is updated by subtraction in each step.
# Below this fraction of the last exact value, the residual sum of squares is computed exactly.
RESIDUAL_TOLERANCE = 1e-9

# rounding error of an inner product `p'y`, relative to `|p| |y|`, for any number of samples
ROUNDING = 8 * float(np.finfo(np.float64).eps)
LEAST_DIGITS = 1e-6  # required relative accuracy of a reported ERR
# largest allowed difference between the sum of ERR and 1 - (residual sum of squares)/(y'y)
BALANCE = 1e-12


class DigitsLost(Exception):
    """Error for remainders whose rounding errors could change the choice of a term."""


class Remainders:
    """Remainders of y and of every candidate: what is left after the components along the chosen
    terms are subtracted. For a candidate, the remainder is the vector `q` of M2 eq 2. Subclasses
    differ in how they represent it.

    `squares` holds `q'q` and `products` holds `y'q`, (M,) each; in each step, the part along the
    new term is subtracted from both. `pp` holds the sums of squares of the candidates, `yy` is the
    sum of squares of y, and `sse` is the sum of squares of the remainder of y.
    """

    def __init__(self, pp: Array, products: Array, yy: float) -> None:
        self.pp, self.squares, self.products = pp, pp.copy(), products
        self.yy = self.sse = self.sse_of_products = yy
        self.live = pp > 0

    def reductions(self) -> tuple[Array, Array]:
        """Return `g = y'q / q'q` (M2 eq 3) and `ERR = g^2 q'q / y'y` (eq 4), shape (M,) each; NaN
        for chosen or dependent candidates. Raises DigitsLost if rounding errors could change the
        choice of a term.
        """
        g = np.full(len(self.products), np.nan)
        np.divide(self.products, self.squares, out=g, where=self.live)
        return g, self.relative(g * self.products)

    def relative(self, squares: Array | float) -> Array:
        """Return sums of squares divided by `y'y`; zeros if y is zero."""
        return np.asarray(squares / self.yy if self.yy else 0 * squares)

    def choose(self, pick: int) -> Array:
        """Choose the candidate `pick`, and orthogonalise all other candidates against it.

        Return `u'[P y]`, shape (M+1,), where `u` is the remainder of the chosen candidate, scaled
        to unit length. This is one row of the triangular factor of the chosen columns. Raises
        DigitsLost if rounding errors could change the choice of a term.
        """
        raise NotImplementedError

    def _downdate(self, pick: int, row: Array) -> None:
        self.live[pick] = False
        self.squares -= row[:-1] ** 2
        self.products -= row[-1] * row[:-1]


class GramRemainders(Remainders):
    """Remainders of which only the inner products are computed. A step needs O(M k) operations if k
    terms have been chosen. `matrix` is the Gram matrix `Z'Z` of scaled columns, shape (M+1, M+1).

    The `blocks` of the dictionary are read once more if the residual is so small that `y'y` does
    not have enough digits to compute it.
    """

    def __init__(self, matrix: Array, blocks: Blocks) -> None:
        self.gram, self.blocks = matrix[:-1, :-1], blocks
        super().__init__(np.diag(self.gram), matrix[-1, :-1], float(matrix[-1, -1]))
        self.rows = np.empty((0, len(matrix)))
        self.picks: list[int] = []

    def reductions(self) -> tuple[Array, Array]:
        """Return g and ERR of each candidate (see `Remainders`). Raises DigitsLost if a `q'q`
        consists mostly of rounding errors, or if rounding errors could change which candidate is
        chosen.
        """
        if (self.squares < PIVOT_TOLERANCE * self.pp)[self.live].any():
            raise DigitsLost
        g, err = super().reductions()
        if not self.live.any() or self._clear_winner(err):
            return g, err
        if self.sse == self.sse_of_products:
            raise DigitsLost
        self._renew()
        return self.reductions()

    def _clear_winner(self, err: Array) -> bool:
        best = int(np.nanargmax(err))
        product = abs(self.products[best])
        error = ROUNDING * np.sqrt(self.pp[best] * self.sse_of_products)
        if error <= TIE_TOLERANCE * product:
            return True
        return bool(
            error <= LEAST_DIGITS * product
            and np.count_nonzero(err >= err[best] * (1 - error / product)) == 1
        )

    def choose(self, pick: int) -> Array:
        """Choose the candidate `pick`, and return its row of the triangular factor.

        `Remainders.choose` describes this row.
        """
        length = np.sqrt(self.squares[pick])
        row: Array = (
            np.append(self.gram[pick] - self.rows[:, pick] @ self.rows[:, :-1], self.products[pick])
            / length
        )
        row[pick] = length
        self.rows = np.vstack([self.rows, row])
        self.picks.append(pick)
        self._downdate(pick, row)
        self.sse -= float(row[-1]) ** 2
        if self.sse < RESIDUAL_TOLERANCE * self.sse_of_products:
            self._renew()
        return row

    def _renew(self) -> None:
        """Compute the products of the remainders with the residual instead of y. These products
        keep their digits even if the residual is very small.

        Because of rounding, `r = y - P_chosen theta` still has a component along the chosen
        columns, `U U'r` with `R' U'r = P_chosen'r`. This component is subtracted. If the explained
        and the residual sum of squares do not add up to `y'y`, the chosen columns have lost too
        many digits, and DigitsLost is raised.
        """
        R = np.triu(self.rows[:, self.picks])
        theta = np.linalg.solve(R, self.rows[:, -1])
        products, square = np.zeros(1), 0.0
        for P, y in self.blocks():
            residual = y - P[:, self.picks] @ theta
            products = products + P.T @ residual
            square += float(residual @ residual)
        along = np.linalg.solve(R.T, products[self.picks])
        self.products = products - along @ self.rows[:, :-1]
        self.sse = self.sse_of_products = max(0.0, square - float(along @ along))
        explained = float(self.rows[:, -1] @ self.rows[:, -1])
        if abs(self.yy - explained - self.sse) > BALANCE * self.yy:
            raise DigitsLost


# A dictionary with at most this many values is small, so that accuracy matters more than speed.
SMALL = 2**16
# If an updated `q'q` is below this fraction of `p'p`, the remainder q is computed explicitly.
# `LOST` is used for a large dictionary, and `LOST_OF_SMALL` for a small one.
LOST, LOST_OF_SMALL = 1e-6, 1e-2
# `y'q` is computed again each time the residual sum of squares has fallen to this fraction.
RENEWED = 1e-2


class BasisRemainders(Remainders):
    """Remainders of the candidates `P`, (n, M), and of `y`, (n,), computed with an orthonormal
    basis of the chosen columns, of which there are at most `limit`.

    When a unit vector u is added to the basis, `(u'p)^2` is subtracted from each `q'q`, and `u'y
    u'p` from each `y'q`. If a candidate loses digits in this way, its remainder `q = p - U U'p` is
    computed explicitly and orthogonalised twice ("twice is enough": Giraud and Langou 2005), and
    again in every later step. Its `q'q` and `y'q` are then computed from q. So ill-conditioned
    dictionaries lose no digits, and only such candidates take more time.
    """

    def __init__(self, P: Array, y: Array, limit: int) -> None:
        super().__init__(column_squares(P), P.T @ y, float(y @ y))
        self.P, self.residual = P, y
        self.lost_below = (LOST_OF_SMALL if P.size <= SMALL else LOST) * self.pp
        self.basis, self.size = np.empty((len(y), limit), order="F"), 0
        self.explicit: IntArray = np.empty(0, dtype=np.int64)
        self.remainders = np.empty((len(y), 0))

    def choose(self, pick: int) -> Array:
        """Choose the candidate `pick`, and return its row of the triangular factor.

        `Remainders.choose` describes this row.
        """
        held = self.explicit == pick
        unit = self._cleared(
            self._cleared(self.remainders[:, held][:, 0] if held.any() else self.P[:, pick])
        )
        length = np.linalg.norm(unit)
        unit /= length
        row = np.append(self.P.T @ unit, unit @ self.residual)
        row[pick] = length
        self.basis[:, self.size] = unit
        self.size += 1
        self._downdate(pick, row)
        self.residual = self._cleared(self._cleared(self.residual))
        self.sse = float(self.residual @ self.residual)
        if self.sse < RENEWED * self.sse_of_products:
            self.products = self.P.T @ self.residual
            self.sse_of_products = self.sse
        self._renew()
        return row

    def _renew(self) -> None:
        """For candidates that have lost digits by subtraction, compute `q'q` and `y'q` from
        explicit remainders. Drop candidates that depend linearly on the chosen ones.
        """
        lost = self.live & (self.squares < self.lost_below)
        lost[self.explicit] = False
        kept = self.live[self.explicit]
        self.explicit = np.append(self.explicit[kept], np.flatnonzero(lost))
        if len(self.explicit) == 0:
            return
        self.remainders = self._cleared(
            np.column_stack([self.remainders[:, kept], self._cleared(self.P[:, lost])])
        )
        self.squares[self.explicit] = column_squares(self.remainders)
        self.products[self.explicit] = self.remainders.T @ self.residual
        self.live[self.explicit] = (
            self.squares[self.explicit] > RANK_TOLERANCE * self.pp[self.explicit]
        )

    def _cleared(self, vectors: Array) -> Array:
        """Return a vector, or the columns of a matrix, after subtracting the components along the
        basis.
        """
        basis = self.basis[:, : self.size]
        return vectors - basis @ (basis.T @ vectors)


def column_squares(P: Array) -> Array:
    """Return the sum of squares of each column of a matrix, shape (M,)."""
    return np.asarray(np.einsum("ij,ij->j", P, P))
