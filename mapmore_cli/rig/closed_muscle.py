"""A muscle whose valves are closed while something else moves it: the pressure follows the volume (H sections II.A and II.D).

Air is compressed while the muscle is drawn out, warms up, and gives the warmth to the wall.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval
from scipy.signal import lfilter

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.declared import NonNegative, Positive, Settings
from mapmore_cli.rig.chamber import ATMOSPHERE
from mapmore_cli.rig.mckibben import McKibben, volume
from mapmore_cli.rig.muscle import SLACK_WIDTH, Hysteresis, softplus, zero_force_strain
from mapmore_cli.rig.sensors import low_pass
from mapmore_cli.rig.wet_muscle import Rubber


@dataclass(frozen=True)
class Air(Settings):
    """The air in a muscle and its hose."""

    heat_ratio: Annotated[float, Interval(ge=1, le=1.67)]  # gamma
    cooling_time: Positive  # in which the air takes on the wall's temperature, s
    dead_volume: NonNegative  # of hose and fittings, m3


@dataclass(frozen=True)
class ClosedMuscle:
    """A McKibben muscle with its air, its friction and its rubber."""

    muscle: McKibben
    hysteresis: Hysteresis
    rubber: Rubber
    air: Air

    def taut_strain(self, pressure: float, force: float) -> float:
        """Strain at which the muscle at `pressure` (Pa) pulls with `force` (N), friction and rubber relaxed."""
        return zero_force_strain(lambda strain: float(self.muscle.force(pressure, strain)) - force)

    def move(self, strain: Array, pressure: float, sample_time: float, cut_off: float) -> Columns:
        """True `pressure` (Pa) and `force` (N) along a path of strains `(n,)` from where the valves were closed at `pressure`.

        `F = softplus(F_static(P, e) - h(P, e) - s)`, with a Maxwell element s of rubber, behind the load cell's filter of `cut_off` (Hz).
        """
        gas = self.closed_pressure(strain, pressure, sample_time)
        driving = np.maximum(gas, 0.0)
        pull = self.muscle.force(driving, strain) - self.hysteresis.force(driving, strain) - self._rubber(strain, sample_time)
        return {"pressure": gas, "force": low_pass(softplus(pull, SLACK_WIDTH), cut_off, sample_time)}

    def closed_pressure(self, strain: Array, pressure: float, sample_time: float) -> Array:
        """Gauge pressure `(n,)`, Pa, of a fixed mass of air.

        Energy, `V p' + gamma p V' = (gamma - 1) k (T_w - T)`, is linear in `u = p V^gamma` (p absolute), with `tau = m c_v/k`:
        `u' = (p_0 V_0 V^(gamma-1) - u)/tau`. So u follows by a first-order filter: adiabatic while fast, isothermal while slow.
        """
        chamber = volume(self.muscle, strain) + self.air.dead_volume
        gamma, absolute = self.air.heat_ratio, pressure + ATMOSPHERE
        settled = absolute * chamber[0] * chamber ** (gamma - 1.0)
        memory = np.exp(-sample_time / self.air.cooling_time)
        mean = np.concatenate([settled[:1], 0.5 * (settled[1:] + settled[:-1])])
        u = settled[0] + lfilter([1.0 - memory], [1.0, -memory], mean - settled[0])
        return np.asarray(u / chamber**gamma - ATMOSPHERE)

    def _rubber(self, strain: Array, sample_time: float) -> Array:
        """`s' = K e' - s/tau`, N, `(n,)`: positive in contraction, where it takes from the pull."""
        memory = np.exp(-sample_time / self.rubber.relaxation_time)
        gain = self.rubber.stiffness * self.rubber.relaxation_time * (1.0 - memory) / sample_time
        return np.asarray(lfilter([gain], [1.0, -memory], np.diff(strain, prepend=strain[:1])))
