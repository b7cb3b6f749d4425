"""Compute standard errors of least squares when neighbouring samples of a recording have correlated
errors.

The covariance of the coefficients is `(P'P)^-1 P' Omega P (P'P)^-1`. Omega is the covariance of the
noise, `white I + drift kept^|i-j|` within a recording: white noise, and a drift of which the
fraction `kept` remains after one sample. Estimators that sum the autocovariance of the residuals
over lags (Newey and West, Econometrica 55, 1987) give at most half of the true covariance for
`kept` = 0.97. The reason is that a fit also follows the noise, most of all its slow part, which is
then missing from the residuals. Therefore, `matched` searches the values of `white`, `drift` and
`kept` for which the residuals of such a fit have, on average, the measured autocovariance.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapmore_cli.domain.arrays import Array

# the noise is estimated from at most this number of samples, those at the beginning
PART = 1 << 14
# with more values (samples times terms) than this, the correlation is ignored, to save memory
MOST = 1 << 21
FEWEST = 20  # smallest number of samples of a recording from which the noise can be estimated
CHANCE = 0.01  # probability with which white noise is mistaken for a drift
# step and tolerance of the search for the logarithm of the drift's time constant
COARSE, FINE = np.log(3.0), 0.05


@dataclass(frozen=True)
class Noise:
    """Noise of a recording: the variances of its white part and of its drift, and the fraction of
    the drift that remains after one sample (`kept`).
    """

    white: float
    drift: float = 0.0
    kept: float = 0.0

    @property
    def worth(self) -> float:
        """Number of independent samples that are worth as much as one of these correlated samples
        for estimating a mean. It is below one if neighbouring samples are alike.
        """
        slow = self.drift * (1 + self.kept) / (1 - self.kept)
        return (self.white + self.drift) / (self.white + slow) if self.white + slow else 1.0


def correlated_errors(
    P: Array, residual: Array, lengths: Sequence[int], ridge: Array | None = None
) -> tuple[Array, float]:
    """Return the standard errors of the coefficients, shape (k,), and the number of independent
    samples to which the n samples are equivalent.

    `P`, shape (n, k), and `residual`, shape (n,), hold recordings with these `lengths` one after
    the other, each in the order of time. `ridge`, shape (k,), is added to the diagonal of P'P. The
    errors are NaN if n <= k, because no degree of freedom is left.
    """
    n, k = P.shape
    if n <= k:
        return np.full(k, np.nan), float(n)
    basis, factor = np.linalg.qr(P)
    noise = matched(_Records(basis, residual, lengths))
    inner = noise.white * np.eye(k)
    if noise.drift:
        inner += noise.drift * basis.T @ _together(basis, lengths, noise.kept)
    normal = factor.T @ factor + np.diag(np.zeros(k) if ridge is None else ridge)
    spread = np.linalg.pinv(normal, hermitian=True) @ factor.T
    squares = np.einsum("ij,jk,ik->i", spread, inner, spread)
    return np.sqrt(np.maximum(squares, 0.0)), n * noise.worth


def matched(records: _Records) -> Noise:
    """Estimate the noise: with this noise, the residuals of the fit have, on average, the measured
    autocovariance. The result is white noise if the measured autocovariance could be due to chance.
    """
    from scipy.special import chdtri

    n, k = records.basis.shape
    square = float(records.residual @ records.residual)
    only = Noise(square / (n - k))
    if max(records.lengths) < FEWEST or square == 0.0:
        return only
    if n > PART and records.residual[:PART].any():
        noise = matched(records.first(PART))
        scale = only.white / (noise.white + noise.drift)
        return Noise(noise.white * scale, noise.drift * scale, noise.kept)
    white, found_sums = records.expected(0.0), records.sums
    misfit = (found_sums - only.white * white)[1:] / only.white
    if float(np.sum(misfit**2 / records.pairs[1:])) < chdtri(len(misfit), CHANCE):
        return only
    # imported here, because the import is slow, and uncorrelated residuals do not need it
    from scipy.optimize import minimize_scalar, nnls

    def fitted(time: float) -> tuple[float, Noise]:
        kept = float(np.exp(-np.exp(-time)))
        parts, off = nnls(np.column_stack([white, records.expected(kept)]), found_sums)
        return float(off), Noise(float(parts[0]), float(parts[1]), kept)

    longest = np.log(max(records.lengths))
    times = np.arange(np.log(0.3), longest - np.log(4.0), COARSE)
    start = min(times, key=lambda time: fitted(time)[0])
    ends = (start - COARSE, min(start + COARSE, longest))
    best = minimize_scalar(
        lambda time: fitted(time)[0], bounds=ends, method="bounded", options={"xatol": FINE}
    )
    return min((fitted(start), fitted(float(best.x))), key=lambda candidate: candidate[0])[1]


@dataclass(frozen=True)
class _Records:
    """Orthonormal basis of the chosen columns, (n, k), and residuals, (n,), of all recordings one
    after the other.
    """

    basis: Array
    residual: Array
    lengths: Sequence[int]

    def first(self, count: int) -> _Records:
        """Return the first `count` samples, with the basis made orthonormal again."""
        ends = np.minimum(np.cumsum(self.lengths), count)
        lengths = [length for length in np.diff(ends, prepend=0).tolist() if length]
        basis = np.linalg.qr(self.basis[:count])[0]
        return _Records(basis, self.residual[:count], lengths)

    @cached_property
    def lags(self) -> list[int]:
        """The lags 0, 1, 2, 4, ... in samples, up to an eighth of the length of the longest
        recording.
        """
        return [0, *(2**i for i in range(1 + int(np.log2(max(max(self.lengths) / 8, 1)))))]

    @cached_property
    def pairs(self) -> Array:
        """For each lag, the number of pairs of samples that are this lag apart."""
        return np.array([sum(max(length - lag, 0) for length in self.lengths) for lag in self.lags])

    @cached_property
    def sums(self) -> Array:
        """For each lag, the sum of the products of two residuals that are this lag apart."""
        e = self.residual[:, None]
        return np.array([float(np.sum(e * _shifted(e, self.lengths, lag))) for lag in self.lags])

    @cached_property
    def shifts(self) -> list[Array]:
        """For each lag, the mean of two copies of the basis, shape (n, k): one shifted forwards by
        this lag, and one shifted backwards.
        """
        return [_shifted(self.basis, self.lengths, lag) for lag in self.lags]

    def expected(self, kept: float) -> Array:
        """Return the expected value of `sums` for noise of variance one. For each lag, it is `tr(L
        M R M)`: R is the correlation matrix of the noise, the matrix M computes the residuals from
        the noise, and L is the mean of a shift forwards and a shift backwards by the lag.
        """
        turned = _together(self.basis, self.lengths, kept) if kept else self.basis
        inner = self.basis.T @ turned
        of_noise = self.pairs * np.power(kept, self.lags)
        lost = [np.sum((self.basis.T @ x) * inner.T) - 2 * np.sum(x * turned) for x in self.shifts]
        return of_noise + np.array(lost)


def _rows(lengths: Sequence[int]) -> Iterator[slice]:
    ends = np.cumsum(lengths)
    yield from (
        slice(int(end - length), int(end)) for end, length in zip(ends, lengths, strict=True)
    )


def _together(columns: Array, lengths: Sequence[int], kept: float) -> Array:
    """Return `R columns`, (n, k), with `R_ij = kept^|i-j|` within a recording.

    R is computed as `A^-1 + A^-T - I`, where A has ones on its diagonal and `-kept` below it.
    SciPy's filters give the same result, but loading `scipy.signal` takes a quarter of the time of
    a small run.
    """
    from scipy.linalg.lapack import dtbtrs

    turned = np.empty_like(columns)
    for rows in _rows(lengths):
        own = columns[rows]
        band = np.repeat([[1.0], [-kept]], len(own), axis=1)
        onward, _ = dtbtrs(band, own, uplo="L")
        back, _ = dtbtrs(band, own, uplo="L", trans="T")
        turned[rows] = onward + back - own
    return turned


def _shifted(columns: Array, lengths: Sequence[int], lag: int) -> Array:
    """Return the mean of two copies of the columns, shape (n, k): one shifted forwards by the lag,
    and one shifted backwards, both within each recording.
    """
    moved = np.zeros_like(columns)
    for rows in _rows(lengths):
        record, size = columns[rows], max(rows.stop - rows.start - lag, 0)
        moved[rows][len(record) - size :] += record[:size] / 2
        moved[rows][:size] += record[len(record) - size :] / 2
    return moved
