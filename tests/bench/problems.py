"""The regression problems that every contestant gets. NumPy alone: the peers import this in an environment of their own."""

from __future__ import annotations

import numpy as np

SHAPES = ((1_000_000, 35, 8), (200_000, 45, 10), (200_000, 286, 20), (5_000, 2_000, 30))
"""Samples, candidates, terms: polynomials of two to ten inputs over long records, and one wide dictionary."""


def name_of(shape):
    return "x".join(str(number) for number in shape)


def problem(n, M, k):
    """Candidates, and k of them planted under noise of about 5 % of the output.

    In Fortran order, as dictionaries are built here, which also is the order in which the peers are fastest.
    """
    rng = np.random.default_rng(20)
    P = rng.standard_normal((M, n)).T
    planted = rng.choice(M, k, replace=False)
    y = P[:, planted] @ np.linspace(1, 3, k)
    return P, y + 0.05 * np.linalg.norm(y) / np.sqrt(n) * rng.standard_normal(n)
