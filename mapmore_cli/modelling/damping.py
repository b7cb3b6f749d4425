"""Damping: what a static model leaves of the force of a moving muscle (M2 section 3)."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.plateau import without_steady_state


def damping_component(rest: Array, curve: Curve) -> Array:
    """`F_d = F_d' - F_d,ssv` (M2 eq 1), (n,): what a static model leaves, less its mean over the plateau of each recording of the curve."""
    if curve.at_rest is None:
        return rest
    origin = np.zeros(curve.size, dtype=np.int64) if curve.origin is None else curve.origin
    component = rest.copy()
    for recording in np.unique(origin):
        own = origin == recording
        component[own] = without_steady_state(rest[own], curve.at_rest[own])
    return component
