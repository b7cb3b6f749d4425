"""Contraction under a load that is set, at a pressure that is set: the table that W fits its models to (W section II).

The muscle hangs unloaded and is pressurised, then loaded weight by weight; each time its contraction is read once it has come to rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.rig.muscle import Hysteresis, StaticMuscle, zero_force_strain
from mapmore_cli.rig.step_response import GRAVITY


@dataclass(frozen=True)
class Loading:
    """What hangs on the muscle, and how well its pressure is set."""

    masses: Sequence[float]  # kg, one after the other
    regulator_error: float  # standard deviation of the pressure from one repeat to the next, Pa


def contraction_table(muscle: StaticMuscle, hysteresis: Hysteresis, loading: Loading, pressure: float, rng: np.random.Generator) -> Columns:
    """True `pressure` (Pa), `strain` and `force` (N) of one repeat, each `(n,)` for n masses.

    The regulator keeps what it happens to settle on; the force is the weight alone. Friction holds a muscle that has contracted a little
    short of its free strain, and one that is drawn out a little less far than without it.
    """
    actual = max(pressure + loading.regulator_error * float(rng.standard_normal()), 0.0)
    weights = GRAVITY * np.asarray(loading.masses, dtype=np.float64)
    return {"pressure": np.full(len(weights), actual), "strain": resting_strains(muscle, hysteresis, actual, weights), "force": weights}


def resting_strains(muscle: StaticMuscle, hysteresis: Hysteresis, pressure: float, weights: Array) -> Array:
    """Strains `(n,)` at which the pull balances each weight in turn, along the path that begins relaxed at zero strain.

    `F(P, e) - h = w`, with the stop operators carried along: from the strain before, each moves straight to the next.
    """
    strains, at, stops = [], 0.0, np.zeros(len(hysteresis.yield_strains))
    half_width = float(hysteresis.half_width(pressure))
    for weight in weights:

        def carried(strain: float, at: float = at, stops: Array = stops) -> Array:
            return np.clip(stops + (strain - at) / hysteresis.yield_strains, -1.0, 1.0)

        def unbalanced(strain: float, weight: float = float(weight)) -> float:
            return float(muscle.force(pressure, strain)) - half_width * float(carried(strain) @ hysteresis.shares) - weight

        strain = zero_force_strain(unbalanced, STRETCHED)
        stops, at = carried(strain), strain
        strains.append(strain)
    return np.array(strains)


STRETCHED = -0.08
"""Strain from which on an equilibrium is looked for: a weight may draw the muscle out beyond its length at rest."""
