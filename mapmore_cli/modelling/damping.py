"""Damping: what a static model leaves of the force of a moving muscle (M2 section 3)."""

from __future__ import annotations

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.plateau import without_steady_state


def damping_component(rest: Array, curve: Curve) -> Array:
    """`F_d = F_d' - F_d,ssv` (M2 eq 1), (n,): what a static model leaves, less its mean over the plateau of each recording of the curve."""
    if curve.at_rest is None:
        return rest
    component = rest.copy()
    for rows in curve.logs:
        component[rows] = without_steady_state(rest[rows], curve.at_rest[rows])
    return component
