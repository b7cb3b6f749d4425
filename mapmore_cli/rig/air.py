"""Air: valves by ISO 6358, the reservoir whose air pushes the water, a trapped bubble."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

ATMOSPHERE = 101_325.0
"""p0, Pa."""

LAMINAR_RATIO = 0.995
"""Pressure ratio above which a valve's flow is taken as linear: ISO 6358's slope is infinite at equal pressures."""


def valve_flow(conductance: float, critical_ratio: float, upstream: float, downstream: float) -> float:
    """Volume flow at p0 through a valve, m3/s, between absolute pressures (Pa); negative where `downstream` is the higher.

    `q = C p1 psi`, `psi = 1` for `p2/p1 <= b` (choked), else `sqrt(1 - ((p2/p1 - b)/(1 - b))^2)`; ISO 6358 at reference temperature.
    """
    high, low = max(upstream, downstream), min(upstream, downstream)
    ratio = low / high
    psi = sqrt(1.0 - (max(min(ratio, LAMINAR_RATIO) - critical_ratio, 0.0) / (1.0 - critical_ratio)) ** 2)
    fade = min(1.0, (1.0 - ratio) / (1.0 - LAMINAR_RATIO))
    flow = conductance * high * psi * fade
    return flow if upstream >= downstream else -flow


@dataclass(frozen=True)
class Reservoir:
    """Bottle of water under air, filled through a supply valve and emptied through an exhaust valve."""

    air_volume: float  # V_a, m3; taken as constant
    polytropic: float  # n of its air
    supply_conductance: float  # C, m3/(s Pa)
    exhaust_conductance: float
    critical_ratio: float  # b of both valves

    def rate(self, pressure: float, outflow: float, inflow: float) -> float:
        """`dP_a/dt = n/V_a (q p0 - (P_a + p0) Q)`, Pa/s: gauge `pressure`, water `outflow` Q, air `inflow` q at p0 (m3/s)."""
        return self.polytropic / self.air_volume * (inflow * ATMOSPHERE - (pressure + ATMOSPHERE) * outflow)

    def supplied(self, pressure: float, supply: float) -> float:
        """Air flow q, m3/s, from a supply at gauge pressure `supply`."""
        return valve_flow(self.supply_conductance, self.critical_ratio, supply + ATMOSPHERE, pressure + ATMOSPHERE)

    def exhausted(self, pressure: float) -> float:
        """Air flow q, m3/s, into the reservoir from the room: negative while it empties."""
        return valve_flow(self.exhaust_conductance, self.critical_ratio, ATMOSPHERE, pressure + ATMOSPHERE)


def bubble_compliance(volume: float, pressure: float) -> float:
    """`-dV/dP = V0 p0/(P + p0)^2`, m3/Pa, of air trapped in water: `volume` V0 at no gauge `pressure`, isothermal."""
    return volume * ATMOSPHERE / (pressure + ATMOSPHERE) ** 2
