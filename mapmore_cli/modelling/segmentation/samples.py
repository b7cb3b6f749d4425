"""Samples of a curve."""

from __future__ import annotations

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.recording import Curve


def samples_of(curve: Curve, rows: IntArray) -> dict[str, Array]:
    """Columns of a curve at the given rows."""
    return {name: column[rows] for name, column in curve.columns.items()}
