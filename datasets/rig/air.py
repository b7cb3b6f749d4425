"""Air: valves by ISO 6358, a reservoir over water, a pressure regulator, and a muscle that air
fills.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Annotated

import numpy as np
from annotated_types import Interval
from scipy.signal import lfilter

from datasets.rig.marks import NonNegative, Positive
from datasets.rig.muscle import (
    IN_KPA,
    SLACK_WIDTH,
    MovingMuscle,
    PositiveKpa,
    softplus,
    zero_force_strain,
)
from datasets.rig.sensors import low_pass
from datasets.rig.static_muscles import McKibben, volume, volume_slope
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.declared import Settings

ATMOSPHERE = 101_325.0
"""p0, Pa."""

TOLERANCE = 1e-5
"""Of each step of an integration of air, relative to a state and to its scale: it moves what is
seen by less than a sensor's step.
"""

LAMINAR_RATIO = 0.995
"""Pressure ratio above which a valve's flow is taken as linear: ISO 6358's slope is infinite at
equal pressures.
"""


def valve_flow(
    conductance: float, critical_ratio: float, upstream: float, downstream: float
) -> float:
    """Volume flow at p0 through a valve, m3/s, between absolute pressures (Pa); negative where
    `downstream` is the higher.

    `q = C p1 psi`, `psi = 1` for `p2/p1 <= b` (choked), else `sqrt(1 - ((p2/p1 - b)/(1 - b))^2)`;
    ISO 6358 at reference temperature.
    """
    high, low = max(upstream, downstream), min(upstream, downstream)
    ratio = low / high
    psi = sqrt(
        1.0 - (max(min(ratio, LAMINAR_RATIO) - critical_ratio, 0.0) / (1.0 - critical_ratio)) ** 2
    )
    fade = min(1.0, (1.0 - ratio) / (1.0 - LAMINAR_RATIO))
    flow = conductance * high * psi * fade
    return flow if upstream >= downstream else -flow


@dataclass(frozen=True, kw_only=True)
class ValvePair(Settings):
    """A supply valve and an exhaust valve; flows are m3/s at p0 between gauge pressures, Pa."""

    supply_conductance: Positive  # C, m3/(s Pa)
    exhaust_conductance: Positive
    critical_ratio: Annotated[float, Interval(ge=0, lt=0.99)]  # b of both valves

    def supplied(self, pressure: float, supply: float) -> float:
        """Air flow in from a `supply`; negative where `pressure` is higher."""
        ends = supply + ATMOSPHERE, pressure + ATMOSPHERE
        return valve_flow(self.supply_conductance, self.critical_ratio, *ends)

    def exhausted(self, pressure: float) -> float:
        """Air flow in from the room: negative while it empties."""
        ends = ATMOSPHERE, pressure + ATMOSPHERE
        return valve_flow(self.exhaust_conductance, self.critical_ratio, *ends)


@dataclass(frozen=True, kw_only=True)
class Reservoir(ValvePair):
    """Bottle of water under air, filled through a supply valve and emptied through an exhaust
    valve.
    """

    air_volume: Positive  # V_a, m3; taken as constant
    polytropic: Annotated[float, Interval(ge=1, le=1.4)]  # n of its air

    def rate(self, pressure: float, outflow: float, inflow: float) -> float:
        """`dP_a/dt = n/V_a (q p0 - (P_a + p0) Q)`, Pa/s: gauge `pressure`, water `outflow` Q, air
        `inflow` q at p0 (m3/s).
        """
        return (
            self.polytropic
            / self.air_volume
            * (inflow * ATMOSPHERE - (pressure + ATMOSPHERE) * outflow)
        )


@dataclass(frozen=True, kw_only=True)
class Regulator(ValvePair):
    """Proportional pressure regulator: its wanted pressure lags the input, its ISO 6358 valve opens
    in proportion to what is missing.
    """

    slope: PositiveKpa  # of the wanted pressure, Pa/V
    offset: Annotated[float, IN_KPA]  # at no input, Pa
    lag: Positive  # of the wanted pressure, s
    band: PositiveKpa  # missing pressure at which the valve is fully open, Pa
    supply: PositiveKpa  # gauge, Pa

    def wanted(self, command: Array | float) -> Array:
        """Pressure that an input (V) asks for once it has settled, Pa: `max(slope u + offset,
        0)`.
        """
        return np.maximum(self.slope * np.asarray(command) + self.offset, 0.0)

    def command(self, wanted: Array) -> Array:
        """Input (V) that asks for a pressure (Pa)."""
        return (wanted - self.offset) / self.slope

    def inflow(self, wanted: float, pressure: float) -> float:
        """Air flow into the muscle at p0, m3/s."""
        opening = min(max((wanted - pressure) / self.band, -1.0), 1.0)
        if opening > 0.0:
            return opening * self.supplied(pressure, self.supply)
        return -opening * self.exhausted(pressure)


@dataclass(frozen=True)
class Air(Settings):
    """The air in a muscle and its hose."""

    heat_ratio: Annotated[float, Interval(ge=1, le=1.67)]  # gamma
    cooling_time: Positive  # in which the air takes on the wall's temperature, s
    dead_volume: NonNegative  # of hose and fittings, m3


@dataclass(frozen=True)
class ClosedMuscle(MovingMuscle):
    """A McKibben muscle full of air (H section II.A): its valves are closed, or a regulator drives
    its pressure.

    Behind closed valves the pressure follows the volume: air is compressed while the muscle is
    drawn out, warms up, and gives the warmth to the wall. States, `(k,)`: wanted pressure and
    pressure (Pa), then the losses.
    """

    muscle: McKibben
    air: Air

    def taut_strain(self, pressure: float, force: float) -> float:
        """Strain at which the muscle at `pressure` (Pa) pulls with `force` (N), friction and rubber
        relaxed.
        """
        return zero_force_strain(lambda strain: float(self.muscle.force(pressure, strain)) - force)

    def move(self, strain: Array, pressure: float, sample_time: float, cut_off: float) -> Columns:
        """Return True `pressure` (Pa) and `force` (N) along a path of strains `(n,)` from where the
        valves were closed at `pressure`.

        `F = softplus(F_static(P, e) - h(P, e) - s)`, with a Maxwell element s of rubber, behind the
        load cell's filter of `cut_off` (Hz).
        """
        gas = self.closed_pressure(strain, pressure, sample_time)
        driving = np.maximum(gas, 0.0)
        pull = (
            self.muscle.force(driving, strain)
            - self.hysteresis.force(driving, strain)
            - self._rubber(strain, sample_time)
        )
        return {
            "pressure": gas,
            "force": low_pass(softplus(pull, SLACK_WIDTH), cut_off, sample_time),
        }

    def closed_pressure(self, strain: Array, pressure: float, sample_time: float) -> Array:
        """Gauge pressure `(n,)`, Pa, of a fixed mass of air.

        Energy, `V p' + gamma p V' = (gamma - 1) k (T_w - T)`, is linear in `u = p V^gamma` (p
        absolute), with `tau = m c_v/k`: `u' = (p_0 V_0 V^(gamma-1) - u)/tau`. So u follows by a
        first-order filter: adiabatic while fast, isothermal while slow.
        """
        chamber = volume(self.muscle, strain) + self.air.dead_volume
        gamma, absolute = self.air.heat_ratio, pressure + ATMOSPHERE
        settled = absolute * chamber[0] * chamber ** (gamma - 1.0)
        memory = np.exp(-sample_time / self.air.cooling_time)
        mean = np.concatenate([settled[:1], 0.5 * (settled[1:] + settled[:-1])])
        u = settled[0] + lfilter([1.0 - memory], [1.0, -memory], mean - settled[0])
        return np.asarray(u / chamber**gamma - ATMOSPHERE)

    def at_rest(self, pressure: float) -> Array:
        """States at a pressure (Pa) that has lasted, friction and rubber relaxed."""
        return np.array([pressure, pressure, *self.relaxed])

    @property
    def scales(self) -> Array:
        """Size of each state."""
        return np.array([1e5, 1e5, *self.scales_of_losses])

    def tension(self, states: Array, strain: float) -> float:
        """Return the static force at a strain, less friction and rubber, N."""
        pressure = max(float(states[1]), 0.0)
        return self.left_of(float(self.muscle.force(pressure, strain)), states[2:], pressure)

    def pull(self, states: Array, strain: float) -> float:
        """Return the same of a muscle that cannot push."""
        return float(softplus(self.tension(states, strain), SLACK_WIDTH))

    def rates(
        self,
        states: Array,
        strain: float,
        strain_rate: float,
        regulator: Regulator | None,
        asked: float,
    ) -> Array:
        """Rates of the states while a regulator is `asked` for a pressure (Pa); without one,
        `asked` is the air shut in, `p V` at the wall.

        `p_w' = (asked - p_w)/lag`; `p' = gamma/V (q p0 - p V' e')` (p absolute), and shut in `p' =
        -gamma/V p V' e' + (asked/V - p)/tau`.
        """
        wanted, pressure = states[:2].tolist()
        absolute = pressure + ATMOSPHERE
        chamber = float(volume(self.muscle, np.asarray(strain))) + self.air.dead_volume
        work = absolute * float(volume_slope(self.muscle, np.asarray(strain))) * strain_rate
        if regulator is None:
            filled = [
                0.0,
                -self.air.heat_ratio / chamber * work
                + (asked / chamber - absolute) / self.air.cooling_time,
            ]
        else:
            inflow = regulator.inflow(wanted, pressure) * ATMOSPHERE
            filled = [
                (asked - wanted) / regulator.lag,
                self.air.heat_ratio / chamber * (inflow - work),
            ]
        return np.array([*filled, *self.rates_of_losses(states[2:], strain_rate)])

    def _rubber(self, strain: Array, sample_time: float) -> Array:
        """`s' = K e' - s/tau`, N, `(n,)`: positive in contraction, where it takes from the pull."""
        memory = np.exp(-sample_time / self.rubber.relaxation_time)
        gain = self.rubber.stiffness * self.rubber.relaxation_time * (1.0 - memory) / sample_time
        return np.asarray(lfilter([gain], [1.0, -memory], np.diff(strain, prepend=strain[:1])))
