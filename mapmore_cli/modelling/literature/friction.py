"""What the friction formulas share: a force that decays with the magnitude of the strain rate."""

from __future__ import annotations

from mapmore_cli.modelling.literature.problem import Nonlinear

FASTEST, SLOWEST = 1e-3, 10.0
"""Bounds of a decay over the largest rate: below, it acts on the samples at rest alone; above, it is straight to within a twentieth."""


def decay(name: str) -> Nonlinear:
    """The rate over which the force decays by 1/e, positive."""
    return Nonlinear(name, per=None, intervals=((FASTEST, SLOWEST),), of="strain_rate")
