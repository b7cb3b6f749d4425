"""Provide `frols` and `frols_together`, and the two numerical forms of the method.

The form with the Gram matrix (`GramRemainders`) reads a tall dictionary only once. The form with an
orthonormal basis of the chosen columns (`BasisRemainders`) reads the dictionary in every step, but
loses no digits. The form with the basis can also work with the triangular factor of the dictionary
instead of the dictionary.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.fits import Selection
from mapmore_cli.modelling.frols.moments import (
    Blocks,
    blocks_of_rows,
    divided,
    gram,
    safe_scale,
    weighted,
)
from mapmore_cli.modelling.frols.select import (
    RANK_TOLERANCE,
    TIE_TOLERANCE,
    DigitsLost,
    Remainders,
    Stopping,
    selected,
    to_explain,
    widened,
)
from mapmore_cli.modelling.frols.together import Together, chosen_together
from mapmore_cli.modelling.frols.weighing import Choice, Weighing, reweighted

# a downdated `q'q` below this fraction of `p'p` has lost too many digits (1e-4 to 1e-10 also work)
PIVOT_TOLERANCE = 1e-6
# below this fraction of its last explicit value, the residual sum of squares is recomputed
RESIDUAL_TOLERANCE = 1e-9

# rounding error of an inner product `p'y`, relative to `|p| |y|`, for any number of samples
ROUNDING = 8 * float(np.finfo(np.float64).eps)
LEAST_DIGITS = 1e-6  # required relative accuracy of a reported ERR
# largest allowed difference between the sum of ERR and 1 - (residual sum of squares)/(y'y)
BALANCE = 1e-12


class GramRemainders(Remainders):
    """Remainders of which only the inner products are computed, in O(M k) per step. `matrix` is the
    Gram matrix `Z'Z` of scaled columns, shape (M+1, M+1).

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
        error, product = (
            ROUNDING * np.sqrt(self.pp[best] * self.sse_of_products),
            abs(self.products[best]),
        )
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

        Because of rounding, `r = y - P_chosen theta` still contains a part of the chosen columns,
        `U U'r` with `R' U'r = P_chosen'r`. If the explained and the residual sum of squares do not
        add up to `y'y`, the chosen columns have lost too many digits, and DigitsLost is raised.
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


# A dictionary with at most this many values counts as small, so accuracy precedes speed.
SMALL = 2**16
# `LOST` is for a large dictionary, and `LOST_OF_SMALL` is for a small one.
# If a downdated `q'q` is below this fraction of `p'p`, the candidate's remainder becomes explicit.
LOST, LOST_OF_SMALL = 1e-6, 1e-2
# When the residual sum of squares has fallen by this factor, `y'q` is computed again.
RENEWED = 1e-2


class BasisRemainders(Remainders):
    """Remainders of the candidates `P`, (n, M), and of `y`, (n,), computed with an orthonormal
    basis of the chosen columns, of which there are at most `limit`.

    For each new direction u, `q'q` and `y'q` are downdated with `u'P`. If a candidate loses digits
    in this way, its remainder `q = p - U U'p` is computed explicitly and orthogonalised twice
    ("twice is enough": Giraud and Langou 2005), and again in every later step. Its `q'q` and `y'q`
    are then computed from q. So ill-conditioned dictionaries lose no digits, and only such
    candidates take more time.
    """

    def __init__(self, P: Array, y: Array, limit: int) -> None:
        super().__init__(_column_squares(P), P.T @ y, float(y @ y))
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
        """For candidates that have lost digits by downdating, compute `q'q` and `y'q` from explicit
        remainders. Drop candidates that depend linearly on the chosen ones.
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
        self.squares[self.explicit] = _column_squares(self.remainders)
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


def _column_squares(P: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->j", P, P))


# number of columns for which `P'P` takes about as long as one matrix-vector product with `P`
# The form with a basis needs one matrix-vector product with `P` for each term.
GRAM_COLUMNS_PER_TERM = 16


def frols(
    P: ArrayLike,
    y: ArrayLike,
    max_terms: int | None = None,
    tolerance: float = 0.0,
    *,
    stop: str = "tolerance",
    names: Sequence[str] = (),
    weighing: Weighing | None = None,
) -> Selection:
    """Select the few columns of `P` that explain `y`, one after the other, by their error reduction
    ratio.

    In each iteration every unselected regressor is orthogonalised against the selected ones (M2 eq
    2), its coefficient is `g = y'q / q'q` (eq 3) and its error reduction ratio `ERR = g^2 q'q /
    y'y` (eq 4), with the uncentred `y'y`; the highest wins (eq 5). The coefficients of the original
    regressors follow from `A theta = g`.

    A tall dictionary is read once, to compute `P'P`, and once more, to compute its triangular
    factor, if `P'P` loses digits. A small or wide dictionary is read for every term. The selection
    is the same in all cases. `P` and `y` are not changed, and are copied only if their squares
    overflow.

    - `P`: candidate regressors, (n, M), in either memory order; `y`: dependent variable, (n,).
    - `max_terms`: largest number of terms (M2 eq 7, read as: stop after so many terms); None for no
      limit.
    - `tolerance`: stop when `1 - sum ERR <= tolerance` (M2 eq 6). If a column of `P` is constant,
      `y'y` is replaced by the sum of squares about the mean of `y`.
    - `stop`: `tolerance`, or one of the criteria `bic`, `ebic`, `aicc`, `press`. With a criterion,
      the selection continues to `max_terms`, or until only rounding error is left (1e-28 of `y'y`,
      or no independent candidate); then the number of terms with the best criterion is kept.
    - `names`: names of the candidates, (M,), for tables and messages; `p0`, `p1`, ... by default.
    - `weighing`: weights of the samples, by their uncertainty or by a robust loss; None for equal
      weights.

    Raises DataError if `P` or `y` has a value that is not finite, with its column and row;
    ValueError if the shapes or the names do not fit, or `max_terms` is below one.

    >>> x = np.linspace(0, 1, 50)
    >>> P = np.column_stack([x**0, x, x**2])
    >>> found = frols(P, 3 * x**2 - 1, max_terms=2, names=["1", "x", "x^2"])
    >>> found
    Selection(3*x^2 - 1; ERR 46.1 %, 53.9 %; stop: tolerance)
    >>> found.names, found.theta.round(12).tolist()
    (('x^2', '1'), [3.0, -1.0])
    >>> bool(np.allclose(found.predict(P), 3 * x**2 - 1))
    True
    """
    found = choose(P, y, Stopping(max_terms, tolerance, stop), weighing).with_errors()
    M = found.g_all.shape[1]
    if len(names) not in (0, M):
        raise ValueError(f"{len(names)} names for {M} candidates")
    return replace(found, candidates=tuple(names))


def choose(
    P: ArrayLike, y: ArrayLike, stopping: Stopping, weighing: Weighing | None = None
) -> Choice:
    """Choose terms like `frols`, without names and without standard errors."""
    P, y = np.asarray(P, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if P.ndim != 2 or y.ndim != 1 or len(P) != len(y) or P.size == 0:
        raise ValueError(
            "P must have the shape (n, M), y must have the shape (n,), and neither may be empty; "
            f"their shapes are {P.shape} and {y.shape}"
        )
    n, M = P.shape

    def select(sigma: Array | None) -> Selection:
        if reads_once(n, M, stopping.limit(n, M)):
            return _by_gram(blocks_of_rows(P, y), stopping, sigma)
        if sigma is None:
            return _by_basis(P, y, stopping)
        return _by_basis(P / sigma[:, None], y / sigma, stopping, sigma)

    return reweighted(
        [weighing or Weighing()],
        lambda sigmas: [select(*sigmas)],
        [lambda chosen: blocks_of_rows(P[:, chosen], y)],
    )[0]


@dataclass(frozen=True)
class Regression:
    """A regression problem with one output: the `blocks` of candidates and output, and the weights
    of the samples. The optional function `only` returns the blocks of some candidates; it is faster
    than selecting columns of `blocks`.
    """

    blocks: Blocks
    weighing: Weighing = field(default_factory=Weighing)
    only: Callable[[IntArray], Blocks] | None = None

    def of(self, chosen: IntArray) -> Blocks:
        """Return the blocks with only the columns of the chosen candidates."""
        if self.only is not None:
            return self.only(chosen)
        return lambda: ((P[:, chosen], y) for P, y in self.blocks())


def frols_together(
    problems: Sequence[Regression],
    max_terms: int | None = None,
    tolerance: float = 0.0,
    *,
    stop: str = "tolerance",
) -> tuple[Selection, ...]:
    """Select terms like `frols` from a dictionary that is read in row blocks, for one or several
    outputs, and return a selection for each. The memory is O(M^2 + block), independent of n.

    Several outputs `y_j` share their terms: the candidate with the largest sum of their error
    reduction ratios wins, `sum_j (y_j'q)^2 / (q'q y_j'y_j)`, so that the units of the outputs do
    not matter (Billings 2013, section 3.4). Each output has its own coefficients. The candidates
    have the same order in all problems. The tolerance stops the selection when it is reached for
    every output; criteria are summed over the outputs.

    Each call of `blocks` yields `P`, shape (b, M), and `y`, shape (b,), of one block after the
    other; blocks of a few thousand rows are fastest. Usually one pass is enough. One more is needed
    if the normal equations lose digits (an ill-conditioned or dependent dictionary, or a residual
    sum of squares below 1e-9 of `y'y`), two more if squares of the values overflow or underflow,
    and one more if the tolerance may stop the selection.

    Raises DataError if a value is not finite, with its column and its row counted over all
    blocks; ValueError if there is no row or no column, or `max_terms` is below one.
    """
    choices = choose_together(problems, Stopping(max_terms, tolerance, stop))
    return tuple(choice.with_errors() for choice in choices)


def choose_together(problems: Sequence[Regression], stopping: Stopping) -> tuple[Choice, ...]:
    """Choose terms like `frols_together`, without standard errors."""

    def select(sigmas: Sequence[Array | None]) -> Sequence[Selection]:
        if len(problems) == 1:
            return [_by_gram(problems[0].blocks, stopping, *sigmas)]
        chosen, why, M = _shared_terms(problems, sigmas, stopping)
        alone = Stopping(max(1, len(chosen)), 0.0, "tolerance")
        found = [
            _by_gram(one.of(chosen), alone, sigma)
            for one, sigma in zip(problems, sigmas, strict=True)
        ]
        return [replace(widened(one, chosen, M), stop=why) for one in found]

    weighings = [one.weighing for one in problems]
    return reweighted(weighings, select, [one.of for one in problems])


def _shared_terms(
    problems: Sequence[Regression], sigmas: Sequence[Array | None], stopping: Stopping
) -> tuple[IntArray, str, int]:
    """Return the chosen candidates, which all outputs share, the reason why the selection ended,
    and the number M of all candidates.
    """
    parts, wholes, blocks = list[Remainders](), list[float](), list[Blocks]()
    for one, sigma in zip(problems, sigmas, strict=True):
        own = one.blocks if sigma is None else weighted(one.blocks, sigma)
        _, scale, samples = gram(own)
        blocks.append(divided(own, scale))
        limit = stopping.limit(samples, len(scale) - 1)
        parts.append(BasisRemainders(*_fewer_rows(blocks[-1], samples, len(scale)), limit))
        wholes.append(to_explain(blocks[-1], samples, parts[-1].yy, sigma))
    joint = Together(parts, wholes)
    return *chosen_together(joint, blocks, stopping, limit, samples), len(scale) - 1


def reads_once(n: int, M: int, terms: int) -> bool:
    """Return True if `frols` computes `P'P`, so that the dictionary need not be in memory as a
    whole.

    `P'P` is not computed for a small dictionary, because the form with the basis is more accurate
    and fast enough. It is not computed for a very wide dictionary either, because reading the
    dictionary once for each term is then faster.
    """
    return n * M > SMALL and n > M and GRAM_COLUMNS_PER_TERM * (terms + 2) >= M


def _by_gram(blocks: Blocks, stopping: Stopping, sigma: Array | None) -> Selection:
    """Select terms with the Gram matrix. If rounding errors of the Gram matrix could affect the
    choice, select them with explicit remainders.
    """
    blocks = blocks if sigma is None else weighted(blocks, sigma)
    matrix, scale, samples = gram(blocks)
    rows, limit = divided(blocks, scale), stopping.limit(samples, len(scale) - 1)
    rest = (stopping, limit, scale, samples, blocks, sigma)
    try:
        return selected(GramRemainders(matrix, rows), *rest)
    except DigitsLost:
        P, y = _fewer_rows(rows, samples, len(scale))
        return selected(BasisRemainders(P, y, limit), *rest)


def _fewer_rows(blocks: Blocks, samples: int, width: int) -> tuple[Array, Array]:
    """Return `P` and `y` unchanged if they are small, and their triangular factor otherwise."""
    if samples * width <= SMALL:
        P, y = map(np.concatenate, zip(*blocks(), strict=True))
        return P, y
    return triangle(blocks)


def _by_basis(P: Array, y: Array, stopping: Stopping, sigma: Array | None = None) -> Selection:
    blocks, limit = blocks_of_rows(P, y), stopping.limit(*P.shape)
    # values that are not finite are reported by `safe_scale`
    with np.errstate(over="ignore", invalid="ignore"):
        squares = np.append(_column_squares(P), y @ y)
    scale = safe_scale(squares, blocks)
    if (scale != 1.0).any():
        P, y = P / scale[:-1], y / scale[-1]
    basis = BasisRemainders(P, y, limit)
    return selected(basis, stopping, limit, scale, len(y), blocks, sigma)


def triangle(blocks: Blocks) -> tuple[Array, Array]:
    """Return the triangular factor R of `Z = [P y]`, shape (M+1, M+1), split into its columns for P
    and its column for y. In `Z = Q R`, Q has orthonormal columns. The columns of R have the same
    inner products as those of Z, so FROLS chooses the same terms with the same coefficients. Unlike
    `Z'Z`, the R of Householder's method loses no digits.

    The blocks are included one after the other (J. Demmel et al. 2012, "Communication-optimal
    parallel and sequential QR and LU factorizations", sequential TSQR), so the memory is O(M^2 +
    block).
    """
    factor = np.empty((0, 0))
    for P, y in blocks():
        Z = np.column_stack([P, y])
        factor = np.asarray(np.linalg.qr(np.vstack([factor.reshape(-1, Z.shape[1]), Z]), mode="r"))
    return factor[:, :-1], factor[:, -1]
