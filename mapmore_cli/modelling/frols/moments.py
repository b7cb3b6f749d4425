"""Read a tall dictionary (the matrix P of candidate regressors) in row blocks, so that it need not
fit into memory.

`Z = [P y]` has the M candidates and the output as columns. Arrays of the shape (M+1,) have one
value for each column of Z.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.errors import DataError

Blocks = Callable[[], Iterable[tuple[Array, Array]]]
"""Function that starts a pass over the rows: it yields `P`, shape (b, M), and `y`, shape (b,), of
one block after the other.
"""

# number of rows of a block; a block of a usual dictionary then stays in the processor's cache
BLOCK = 4096
# sums of squares within these limits can be multiplied without overflow or underflow
SMALLEST, LARGEST = 1e-140, 1e140


def blocks_of_rows(P: Array, y: Array) -> Blocks:
    """Return the arrays in memory as row blocks. The blocks are views of the arrays."""

    def blocks() -> Iterator[tuple[Array, Array]]:
        for start in range(0, len(y), BLOCK):
            yield P[start : start + BLOCK], y[start : start + BLOCK]

    return blocks


def divided(blocks: Blocks, scale: Array) -> Blocks:
    """Return the blocks with each column of `Z` divided by its `scale`, (M+1,)."""
    if (scale == 1.0).all():
        return blocks
    return standardised(blocks, Standard(np.zeros(len(scale)), scale))


def weighted(blocks: Blocks, uncertainty: Array) -> Blocks:
    """Return the blocks with each row divided by its `uncertainty`, (n,)."""

    def passed() -> Iterator[tuple[Array, Array]]:
        start = 0
        for P, y in blocks():
            sigma = uncertainty[start : start + len(y)]
            yield P / sigma[:, None], y / sigma
            start += len(y)

    return passed


def safe_scale(squares: Array, blocks: Blocks) -> Array:
    """Return a divisor for each column of `Z`, shape (M+1,). `squares`, shape (M+1,), has the sum
    of squares of each column. If this sum is in the safe range, the divisor is one. Otherwise, the
    divisor is the power of two that brings the largest value of the column near one.

    A sum of squares is infinite or NaN if a value is not finite or if its square overflows, and
    zero if squares underflow. In these cases, the values of the column are checked one by one.
    Raises DataError if a value is not finite, with its column and row.
    """
    scale = np.ones(len(squares))
    unsafe = np.flatnonzero(~((squares > SMALLEST) & (squares < LARGEST)))
    if len(unsafe):
        scale[unsafe] = power_of_two(_largest_values(blocks, unsafe))
    return scale


def power_of_two(positive: Array) -> Array:
    """Return, for each value, the smallest power of two above it; one for the value zero. Dividing
    by a power of two is exact.
    """
    return np.ldexp(1.0, np.frexp(positive)[1])


def _largest_values(blocks: Blocks, columns: IntArray) -> Array:
    """Return the largest absolute value in each of the given `columns` of `Z`."""
    largest, start = np.zeros(len(columns)), 0
    for P, y in blocks():
        values = np.abs(np.column_stack([P, y])[:, columns])
        if not np.isfinite(values).all():
            row, place = np.argwhere(~np.isfinite(values))[0]
            at = f"is not finite at row {start + row}"
            if columns[place] == P.shape[1]:
                raise DataError(f"y {at}", "remove or correct the sample before the fit")
            raise DataError(
                f"candidate {columns[place]} {at}",
                "remove or correct the sample, or remove the term",
            )
        np.maximum(largest, values.max(axis=0, initial=0.0), out=largest)
        start += len(y)
    return largest


def gram(blocks: Blocks) -> tuple[Array, Array, int]:
    """Return the Gram matrix `Z'Z` of scaled columns, shape (M+1, M+1); the scales, shape (M+1,);
    and the number of rows n.

    The scales are powers of two, so that the diagonal of `Z'Z` lies between 1/4 and 1. One pass
    over the blocks is enough, unless squares overflow or underflow. In that case, the values are
    scaled before they are squared, which takes three passes. Raises DataError if a value is not
    finite, with its column and row; ValueError if there is no row, or no column.
    """
    matrix, samples = _sum_of_products(blocks)
    scale = safe_scale(np.diag(matrix), blocks)
    if (scale != 1.0).any():
        matrix, samples = _sum_of_products(divided(blocks, scale))
    lengths = power_of_two(np.sqrt(np.diag(matrix)))
    return matrix / lengths / lengths[:, None], scale * lengths, samples


def _sum_of_products(blocks: Blocks) -> tuple[Array, int]:
    total, samples = np.zeros((1, 1)), 0
    for P, y in blocks():
        M = P.shape[1]
        if not samples:
            total = np.zeros((M + 1, M + 1))
        # values that are not finite are reported by `safe_scale`
        with np.errstate(over="ignore", invalid="ignore"):
            # NumPy recognises the transpose and calls the fast BLAS function syrk without a copy
            total[:M, :M] += P.T @ P
            total[M, :M] += P.T @ y
            total[M, M] += y @ y
        samples += len(y)
    if samples == 0 or len(total) == 1:
        raise ValueError(
            "P must have the shape (n, M) with at least one row and one column, but it has no row "
            "or no column"
        )
    total[:-1, -1] = total[-1, :-1]
    return total, samples


# a column is constant if its standard deviation is at most this fraction of its first value
CONSTANT = 1e-12


@dataclass(frozen=True)
class Standard:
    """Mean and standard deviation of the columns of `Z = [P y]`, shape (M+1,) each. The standard
    deviation of a constant column is infinite, so that the standardised column is zero.
    """

    centre: Array
    spread: Array


@dataclass(frozen=True)
class Moments:
    """Sums over n rows of the standardised columns `z = (Z - centre)/spread`. `sums`, (M+1,), holds
    the sum of each column, and `products`, (M+1, M+1), holds the sum of `z_i z_j` for every two
    columns i and j.
    """

    samples: int
    sums: Array
    products: Array

    def without(self, other: Moments) -> Moments:
        """Return the moments of the rows that remain if the rows of `other` are removed. All rows
        of `other` must be among the rows of these moments.
        """
        return Moments(
            self.samples - other.samples, self.sums - other.sums, self.products - other.products
        )

    @property
    def mean(self) -> Array:
        """Mean of z over the rows, (M+1,)."""
        return self.sums / self.samples

    @property
    def covariance(self) -> Array:
        """Covariance matrix of z, the mean of `(z - mean)(z - mean)'`, (M+1, M+1)."""
        mean = self.mean
        return self.products / self.samples - mean[:, None] * mean


def standard(blocks: Blocks) -> Standard:
    """Return the mean and the standard deviation of each column. One pass over the rows is enough,
    or three if squares overflow or underflow.

    Raises DataError if a value is not finite, with its column and row; ValueError if there is no
    row.
    """
    first, shift, variance = _mean_and_variance(blocks)
    scale = safe_scale(variance, blocks)
    if (scale != 1.0).any():
        first, shift, variance = _mean_and_variance(divided(blocks, scale))
    spread = np.sqrt(np.maximum(variance, 0.0))
    return Standard(
        scale * (first + shift), np.where(spread > CONSTANT * np.abs(first), scale * spread, np.inf)
    )


def _mean_and_variance(blocks: Blocks) -> tuple[Array, Array, Array]:
    """Return the first row, the mean of the deviations from the first row, and the variance, shape
    (M+1,) each.

    Deviations from the first row are squared instead of the values, because squares of large values
    would lose the digits of a small variance.
    """
    origin, sums, squares, samples = np.zeros(0), np.zeros(1), np.zeros(1), 0
    # values that are not finite are reported by `safe_scale`
    with np.errstate(over="ignore", invalid="ignore"):
        for P, y in blocks():
            Z = np.column_stack([P, y])
            if len(y):
                origin = origin if samples else Z[0]
                Z = Z - origin
                sums, squares = sums + Z.sum(axis=0), squares + np.einsum("ij,ij->j", Z, Z)
            samples += len(y)
        if samples == 0:
            raise ValueError("there are no rows to standardise")
        shift = sums / samples
        return origin, shift, squares / samples - shift**2


def standardised(blocks: Blocks, by: Standard) -> Blocks:
    """Return the blocks with every column centred and divided by its standard deviation."""

    def passed() -> Iterator[tuple[Array, Array]]:
        for P, y in blocks():
            yield (P - by.centre[:-1]) / by.spread[:-1], (y - by.centre[-1]) / by.spread[-1]

    return passed


def moments(blocks: Blocks) -> Moments:
    """Return the sums of the standardised columns, and of the products of two of them. One pass is
    enough, and the memory is O(M^2 + block).
    """
    sums = np.zeros(1)

    def summed() -> Iterator[tuple[Array, Array]]:
        nonlocal sums
        for P, y in blocks():
            sums = sums + np.append(P.sum(axis=0), y.sum())
            yield P, y

    products, samples = _sum_of_products(summed)
    return Moments(samples, sums, products)
