"""Select terms by forward regression with orthogonal least squares (`frols`, `frols_together`).

In each step, the part of every candidate that is orthogonal to the chosen terms (its remainder) is
needed. The remainders are computed in one of two ways. For a large dictionary with more rows than
columns, and not too many columns, they follow from the Gram matrix `P'P`. Otherwise, or if the Gram
matrix loses too many digits, they are computed with an orthonormal basis of the chosen columns.
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
from mapmore_cli.modelling.frols.remainders import (
    SMALL,
    BasisRemainders,
    DigitsLost,
    GramRemainders,
    Remainders,
    column_squares,
)
from mapmore_cli.modelling.frols.select import (
    Stopping,
    selected,
    to_explain,
    widened,
)
from mapmore_cli.modelling.frols.together import Together, chosen_together
from mapmore_cli.modelling.frols.weighing import Choice, Weighing, reweighted

# If `P` has M columns, computing `P'P` takes about as long as M/16 matrix-vector products with `P`.
# With an orthonormal basis (`BasisRemainders`), each term needs one matrix-vector product with `P`.
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
    y'y` (eq 4), with the uncentred `y'y`; the regressor with the highest ratio is selected (eq 5).
    The coefficients theta of the original regressors follow from `A theta = g`, in which the unit
    upper triangular matrix A describes the orthogonalisation.

    A tall dictionary (`P` has many more rows than columns) is read once, to compute `P'P`. If the
    digits of `P'P` are not enough, it is read again, to compute residuals or its triangular factor.
    A small or wide dictionary is read for every term. The selection is the same in all cases. `P`
    and `y` are not changed, and are copied only if their squares overflow.

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
    selection = choose(P, y, Stopping(max_terms, tolerance, stop), weighing).with_errors()
    M = selection.g_all.shape[1]
    if len(names) not in (0, M):
        raise ValueError(f"{M} candidates need {M} names or none, not {len(names)}")
    return replace(selection, candidates=tuple(names))


def choose(
    P: ArrayLike, y: ArrayLike, stopping: Stopping, weighing: Weighing | None = None
) -> Choice:
    """Choose terms as `frols` does, but without names and without standard errors."""
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
    """Choose terms as `frols_together` does, but without standard errors."""

    def select(sigmas: Sequence[Array | None]) -> Sequence[Selection]:
        if len(problems) == 1:
            return [_by_gram(problems[0].blocks, stopping, *sigmas)]
        chosen, why, M = _shared_terms(problems, sigmas, stopping)
        alone = Stopping(max(1, len(chosen)), 0.0, "tolerance")
        selections = [
            _by_gram(problem.of(chosen), alone, sigma)
            for problem, sigma in zip(problems, sigmas, strict=True)
        ]
        return [replace(widened(selection, chosen, M), stop=why) for selection in selections]

    weighings = [problem.weighing for problem in problems]
    return reweighted(weighings, select, [problem.of for problem in problems])


def _shared_terms(
    problems: Sequence[Regression], sigmas: Sequence[Array | None], stopping: Stopping
) -> tuple[IntArray, str, int]:
    """Return the chosen candidates, which all outputs share, the reason why the selection ended,
    and the number M of all candidates.
    """
    parts, wholes, blocks = list[Remainders](), list[float](), list[Blocks]()
    for problem, sigma in zip(problems, sigmas, strict=True):
        weighted_blocks = problem.blocks if sigma is None else weighted(problem.blocks, sigma)
        _, scale, samples = gram(weighted_blocks)
        blocks.append(divided(weighted_blocks, scale))
        limit = stopping.limit(samples, len(scale) - 1)
        parts.append(BasisRemainders(*_fewer_rows(blocks[-1], samples, len(scale)), limit))
        wholes.append(to_explain(blocks[-1], samples, parts[-1].yy, sigma))
    joint = Together(parts, wholes)
    return *chosen_together(joint, blocks, stopping, limit, samples), len(scale) - 1


def reads_once(n: int, M: int, terms: int) -> bool:
    """Return True if `frols` computes `P'P`, so that the dictionary need not be in memory as a
    whole.

    `P'P` is not computed for a small dictionary, because an orthonormal basis is more accurate and
    fast enough. It is not computed for a very wide dictionary either, because reading the
    dictionary once for each term is then faster.
    """
    return n * M > SMALL and n > M and GRAM_COLUMNS_PER_TERM * (terms + 2) >= M


def _by_gram(blocks: Blocks, stopping: Stopping, sigma: Array | None) -> Selection:
    """Select terms with the Gram matrix. If its rounding errors could affect the choice of a term,
    select the terms with an orthonormal basis instead.
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
    """Return the arrays `P` and `y` of all blocks if they are small. Otherwise, return their
    triangular factor, which has fewer rows.
    """
    if samples * width <= SMALL:
        P, y = map(np.concatenate, zip(*blocks(), strict=True))
        return P, y
    return triangle(blocks)


def _by_basis(P: Array, y: Array, stopping: Stopping, sigma: Array | None = None) -> Selection:
    blocks, limit = blocks_of_rows(P, y), stopping.limit(*P.shape)
    # values that are not finite are reported by `safe_scale`
    with np.errstate(over="ignore", invalid="ignore"):
        squares = np.append(column_squares(P), y @ y)
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
