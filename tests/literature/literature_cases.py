"""Data that the tests of the formulas share."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns

WRIST = {"a1": -5.699, "a2": 158.773, "a3": -42.647, "a4": -299.482, "a5": 86.216, "a6": -196.865}
"""W's published coefficients a..f: pressure in bar, strain as a fraction, force in N."""


def grid(pressures: Array, strains: Array) -> dict[str, Array]:
    """Every pressure at every strain."""
    pressure, strain = np.meshgrid(pressures, strains)
    return {"pressure": pressure.ravel(), "strain": strain.ravel()}


def wrist_force(columns: Columns) -> Array:
    """W eq 12, written out."""
    a, b, c, d, e, f = WRIST.values()
    p, x = columns["pressure"], columns["strain"]
    return (a * p + b) * np.exp(c * x) + d * p * x + e * p + f


def noisy_wrist(seed: int, noise: float = 5.0, rows: int = 300) -> tuple[dict[str, Array], Array]:
    """Scattered points of W's muscle with sensor noise."""
    rng = np.random.default_rng(seed)
    columns = {"pressure": rng.uniform(1, 7, rows), "strain": rng.uniform(0, 0.2, rows)}
    return columns, wrist_force(columns) + noise * rng.standard_normal(rows)
