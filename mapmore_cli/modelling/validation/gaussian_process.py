"""Provide Gaussian processes with a Matérn 5/2 covariance, for small sets of points."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import Bounds, minimize

from mapmore_cli.domain.arrays import Array, root_mean_square

LENGTHS, SIZE, NOISE = (0.1, 5.0), (0.3, 3.0), (1e-3, 0.5)
"""Bounds of the correlation lengths, of the standard deviation of the process, and of that of the
noise. Lengths are for inputs in the unit square; a few points say nothing about shorter ones. The
deviations are fractions of the root mean square of the values.
"""


@dataclass(frozen=True)
class GaussianProcess:
    """A Gaussian process with points x, (n, d), and values y, (n,) at these points. `lengths`,
    (d,), are its correlation lengths. The standard deviations of the process and of the noise are
    in the unit of y.
    """

    x: Array
    y: Array
    lengths: Array
    deviation: float
    noise: float

    @property
    def covariance(self) -> Array:
        """Covariance matrix of the values y, including the noise, (n, n)."""
        return np.asarray(
            self.deviation**2 * matern(self.x, self.x, self.lengths)
            + self.noise**2 * np.eye(len(self.y))
        )

    def predict(self, at: Array) -> tuple[Array, Array]:
        """Return the mean and the standard deviation of the process at new points, (m, d). Both
        have the shape (m,), and the noise is not included.
        """
        factor = np.linalg.cholesky(self.covariance)
        half = solve_triangular(
            factor, self.deviation**2 * matern(self.x, at, self.lengths), lower=True
        )
        mean = half.T @ solve_triangular(factor, self.y, lower=True)
        return mean, np.sqrt(np.maximum(self.deviation**2 - np.sum(half**2, axis=0), 0.0))

    def with_point(self, x: Array, y: float) -> GaussianProcess:
        """Return a Gaussian process with one more point. The correlation lengths and the standard
        deviations are unchanged.
        """
        return replace(self, x=np.vstack([self.x, x]), y=np.append(self.y, y))


def matern(a: Array, b: Array, lengths: Array) -> Array:
    """Return the Matérn 5/2 correlation `(1 + r + r^2/3) exp(-r)` with r = sqrt(5) |(a -
    b)/lengths|, shape (n, m), between points a, (n, d), and b, (m, d).
    """
    difference = (a[:, None, :] - b[None, :, :]) / lengths
    r = math.sqrt(5) * np.sqrt(np.sum(difference**2, axis=2))
    return np.asarray((1 + r + r**2 / 3) * np.exp(-r))


def most_likely(x: Array, y: Array) -> GaussianProcess:
    """Return the process with the largest marginal likelihood. The points, (n, d), lie in the unit
    square, and the values, (n,), have the mean zero.
    """
    scale = root_mean_square(y) or 1.0

    def made(q: Array) -> GaussianProcess:
        return GaussianProcess(
            x, y, np.exp(q[:-2]), scale * math.exp(q[-2]), scale * math.exp(q[-1])
        )

    def cost(q: Array) -> float:
        factor = cho_factor(made(q).covariance, lower=True)
        return float(0.5 * y @ cho_solve(factor, y) + np.sum(np.log(np.diag(factor[0]))))

    d = x.shape[1]
    bounds = Bounds(*np.log([LENGTHS] * d + [SIZE, NOISE]).T)
    return made(minimize(cost, np.log([0.5] * d + [1.0, 0.05]), method="L-BFGS-B", bounds=bounds).x)
