"""FROLS on the dictionary itself, which is only read: an orthonormal basis of the chosen columns and one matrix-vector product a step."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.modelling.frols.moments import Blocks
from mapmore_cli.modelling.frols.select import ratios
from mapmore_cli.modelling.frols.textbook import RANK_TOLERANCE


def triangle(blocks: Blocks) -> tuple[Array, Array]:
    """Triangular factor of `Z = [P y]`, (M+1, M+1), split into its P and y: `Z = Q R` with orthonormal columns of Q.

    Inner products and distances of columns of R are those of Z, therefore FROLS chooses the same terms, with the same numbers, on R as on
    Z. Unlike `Z'Z`, Householder's R loses nothing: each column is that of Z to rounding error. Blocks are folded in one after the other
    (J. Demmel et al. 2012, "Communication-optimal parallel and sequential QR and LU factorizations", sequential TSQR), so the memory is
    O(M^2 + block).
    """
    factor: Array | None = None
    for P, y in blocks():
        kept = 0 if factor is None else len(factor)
        stacked = np.empty((kept + len(y), P.shape[1] + 1), order="F")
        if factor is not None:
            stacked[:kept] = factor
        stacked[kept:, :-1], stacked[kept:, -1] = P, y
        factor = np.asarray(np.linalg.qr(stacked, mode="r"))
    assert factor is not None
    return factor[:, :-1], factor[:, -1]


SMALL = 2**16
"""Number of values up to which a dictionary counts as small: there digits come before speed."""

PIVOT_TOLERANCE, SMALL_PIVOT_TOLERANCE = 1e-6, 1e-2
"""A candidate gets an explicit remainder when its downdated `q'q` has fallen to this fraction of `p'p`."""

RESIDUAL_TOLERANCE = 1e-2
"""The products `y'q` are computed afresh when the residual sum of squares has fallen by this factor since they last were."""


class BasisRemainders:
    """Remainders known by an orthonormal basis `U` of the chosen columns.

    Norms `q'q` and products `y'q` are downdated by `u'P` of each new direction u. A candidate that loses digits that way gets an
    explicit remainder `q = p - U U'p`, orthogonalised twice ("twice is enough": Giraud and Langou 2005) and again in every later step,
    with norm and product computed from it: nothing is lost in ill-conditioned dictionaries, at a cost for those candidates only.

    Parameters
    ----------
    P, y
        Candidates, (n, M), and dependent variable, (n,); neither is changed.
    limit
        Largest number of terms to be chosen.
    """

    def __init__(self, P: Array, y: Array, limit: int) -> None:
        self.P = P
        self.pivot_tolerance = SMALL_PIVOT_TOLERANCE if P.size <= SMALL else PIVOT_TOLERANCE
        self.pp = column_squares(P)
        self.squares = self.pp.copy()
        self.products = P.T @ y
        self.residual = y.copy()
        self.yy = self.sse = self.sse_of_products = float(y @ y)
        self.basis = np.empty((len(y), limit), order="F")
        self.size = 0
        self.live = self.pp > 0
        self.explicit: IntArray = np.empty(0, dtype=np.int64)
        self.remainders = np.empty((len(y), 0))

    def reductions(self) -> tuple[Array, Array]:
        """See `Remainders`."""
        return ratios(self.products, self.squares, self.live, self.yy)

    def choose(self, pick: int) -> Array:
        """See `Remainders`."""
        held = self.explicit == pick
        unit = self._cleared(self._cleared(self.remainders[:, held][:, 0] if held.any() else self.P[:, pick]))
        length = np.linalg.norm(unit)
        unit /= length
        row = np.append(self.P.T @ unit, unit @ self.residual)
        row[pick] = length
        self.basis[:, self.size] = unit
        self.size += 1
        self.live[pick] = False
        self._downdate(row)
        self._renew()
        return row

    def _downdate(self, row: Array) -> None:
        self.squares -= row[:-1] ** 2
        self.products -= row[-1] * row[:-1]
        self.residual = self._cleared(self._cleared(self.residual))
        self.sse = float(self.residual @ self.residual)
        if self.sse < RESIDUAL_TOLERANCE * self.sse_of_products:
            self.products = self.P.T @ self.residual
            self.sse_of_products = self.sse

    def _renew(self) -> None:
        """Form norms and products from explicit remainders where downdating has lost the digits; dependent candidates drop out."""
        lost = self.live & (self.squares < self.pivot_tolerance * self.pp)
        lost[self.explicit] = False
        kept = self.live[self.explicit]
        self.explicit = np.append(self.explicit[kept], np.flatnonzero(lost))
        if len(self.explicit) == 0:
            return
        self.remainders = self._cleared(np.column_stack([self.remainders[:, kept], self._cleared(self.P[:, lost])]))
        self.squares[self.explicit] = column_squares(self.remainders)
        self.products[self.explicit] = self.remainders.T @ self.residual
        self.live[self.explicit] = self.squares[self.explicit] > RANK_TOLERANCE * self.pp[self.explicit]

    def _cleared(self, vectors: Array) -> Array:
        """Return a vector, or the columns of a matrix, without what lies in the basis."""
        basis = self.basis[:, : self.size]
        cleared: Array = vectors - basis @ (basis.T @ vectors)
        return cleared


def column_squares(P: Array) -> Array:
    """Sum of squares of every column, (M,)."""
    squares: Array = np.einsum("ij,ij->j", P, P)
    return squares
