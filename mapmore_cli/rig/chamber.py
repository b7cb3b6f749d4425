"""What a muscle is to the fluid that fills it, a Peano muscle, and air: valves by ISO 6358, the reservoir, a trapped bubble."""

from __future__ import annotations

import math
from dataclasses import dataclass
from math import cos, sin, sqrt
from typing import Annotated, NamedTuple, Protocol

import numpy as np
from annotated_types import Interval
from scipy.optimize import brentq

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.declared import Positive, Settings
from mapmore_cli.rig.mckibben import McKibben, volume_slope
from mapmore_cli.rig.muscle import effective_pressure, effective_pressure_slope

_HALVINGS = 60  # of (0, pi/2): down to the last bit of alpha
_FLAT = 1e-9  # rad, of a tube without any water
_SMALL = 1e-2  # rad, below which the series is exact to the last digits


@dataclass(frozen=True)
class Peano:
    """Strain and force of one tube, by half the opening angle of its arcs, `0 <= alpha <= pi/2`.

    `e = 1 - sin(alpha)/alpha - F/K` and `F = P_e w (D - 2 beta w sin(alpha)) cos(alpha)/alpha - k_b alpha`; where the tube is flat
    (alpha = 0, no pressure), `F = K (e_g - e)` with the geometric strain e_g = 0: the fabric alone. Tubes in series carry the same
    force at the same strain, so their number does not enter.
    """

    tube_width: float  # w of the flat tube, along the pull, m
    tube_length: float  # D, across the pull, m
    end_loss: float  # beta: share of the bulge that the closed tube ends take away
    stiffness: float  # K of the fabric, N per strain
    bending: float  # k_b of the tube's edges, N per rad
    threshold: float  # P_th, Pa
    threshold_width: float  # Pa

    def force(self, pressure: Array | float, strain: Array | float) -> Array:
        """Return static pull, N, for pressures >= 0 (Pa) and strains < 0.36, broadcast against each other."""
        driving = effective_pressure(pressure, self.threshold, self.threshold_width)
        driving, strain = np.broadcast_arrays(driving, np.asarray(strain, dtype=np.float64))
        # By the fabric's law and not by the arc's: exact at alpha = 0, where the latter divides by zero.
        return np.asarray(self.stiffness * (geometric_strain(opening(self, driving, strain)) - strain))


def geometric_strain(alpha: Array) -> Array:
    """`e_g = 1 - sin(alpha)/alpha`: contraction of a tube of inextensible fabric; zero at alpha = 0."""
    return np.asarray(1.0 - np.sinc(alpha / np.pi))


def geometric_slope_ratio(alpha: float) -> float:
    """`e_g'(alpha)/alpha = (sin(alpha) - alpha cos(alpha))/alpha^3`; by its series where the difference would lose its digits."""
    if alpha < _SMALL:
        return 1.0 / 3.0 - alpha**2 / 30.0
    return (math.sin(alpha) - alpha * math.cos(alpha)) / alpha**3


def opening(muscle: Peano, driving: Array, strain: Array) -> Array:
    """Angle alpha, rad, at which arc and fabric carry the same force at `strain`; `driving` is P_e >= 0 in Pa.

    `e_g(alpha) - F(alpha)/K - e` rises with alpha, so that bisection always finds its one root. It is multiplied by alpha, which
    keeps its sign and removes the pole at 0; where even the flat tube is too long (no pressure, stretched), alpha tends to 0.
    """
    low = np.zeros(np.shape(strain))
    high = np.full(np.shape(strain), np.pi / 2.0)
    for _ in range(_HALVINGS):
        alpha = 0.5 * (low + high)
        too_short = _excess(muscle, driving, strain, alpha) > 0.0
        high = np.where(too_short, alpha, high)
        low = np.where(too_short, low, alpha)
    return np.asarray(0.5 * (low + high))


def opening_angle(muscle: Peano, driving: float, strain: float) -> float:
    """Return `opening` of a single pressure and strain, faster; at least 1e-9 rad."""

    def excess(alpha: float) -> float:
        return float(_excess(muscle, driving, strain, alpha))

    return float(brentq(excess, _FLAT, np.pi / 2.0, xtol=1e-12)) if excess(_FLAT) < 0.0 else _FLAT


def _excess(muscle: Peano, driving: Array | float, strain: Array | float, alpha: Array | float) -> Array:
    """`alpha (1 - e) - sin(alpha) - alpha F(alpha)/K`."""
    width = muscle.tube_width
    bulge = driving * width * (muscle.tube_length - 2.0 * muscle.end_loss * width * np.sin(alpha)) * np.cos(alpha)
    return np.asarray(alpha * (1.0 - strain) - np.sin(alpha) - (bulge - muscle.bending * alpha**2) / muscle.stiffness)


GRAVITY = 9.81
"""m/s2."""

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
class Reservoir(Settings):
    """Bottle of water under air, filled through a supply valve and emptied through an exhaust valve."""

    air_volume: Positive  # V_a, m3; taken as constant
    polytropic: Annotated[float, Interval(ge=1, le=1.4)]  # n of its air
    supply_conductance: Positive  # C, m3/(s Pa)
    exhaust_conductance: Positive
    critical_ratio: Annotated[float, Interval(ge=0, lt=0.99)]  # b of both valves

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


class Response(NamedTuple):
    """Of a chamber at one pressure and strain."""

    tension: float  # static pull, N
    filling: float  # dV/dP at constant strain, m3/Pa
    displacement: float  # dV/de at constant pressure, m3


class Chamber(Protocol):
    """A muscle full of water."""

    @property
    def length(self) -> float:
        """L0, m, of which strain is the fraction."""
        ...

    def respond(self, pressure: float, strain: float) -> Response:
        """Pull and volume slopes at `pressure` (Pa; slightly negative while water is sucked out) and `strain`."""
        ...


@dataclass(frozen=True)
class Braid:
    """A McKibben muscle: its fibres do not stretch, so that strain alone gives the volume."""

    muscle: McKibben

    @property
    def length(self) -> float:
        """L0, m."""
        return self.muscle.length

    def respond(self, pressure: float, strain: float) -> Response:
        """Return static force, no filling, `V'(e)`."""
        return Response(float(self.muscle.force(pressure, strain)), 0.0, float(volume_slope(self.muscle, np.asarray(strain))))


@dataclass(frozen=True)
class Tubes:
    """A Peano muscle: flat tubes, which have to fill before they pull.

    Half the opening angle of their arcs, alpha, gives the volume: `V'(alpha) = n w B(alpha) e_g'(alpha)/alpha`, by virtual work with
    `B = w (D - 2 beta w sin(alpha)) cos(alpha)` and `e_g = 1 - sin(alpha)/alpha`. Pressure and strain give alpha, by
    `G = P_e B - k_b alpha^2 - alpha T = 0` with the fabric's tension `T = K (e_g - e)`.
    """

    muscle: Peano
    count: int  # n tubes in series

    @property
    def length(self) -> float:
        """L0, m: the flat tubes side by side."""
        return self.count * self.muscle.tube_width

    def respond(self, pressure: float, strain: float) -> Response:
        """Fabric tension, `V'(alpha) dalpha/dP`, `V'(alpha) dalpha/de`."""
        tube = self.muscle
        # Suction holds a flat tube shut; it cannot turn its arcs inside out.
        driving = max(float(effective_pressure(pressure, tube.threshold, tube.threshold_width)), 0.0)
        alpha = opening_angle(tube, driving, strain)
        width, sine, cosine = tube.tube_width, sin(alpha), cos(alpha)
        across, ratio = tube.tube_length - 2.0 * tube.end_loss * width * sine, geometric_slope_ratio(alpha)
        tension = tube.stiffness * (float(geometric_strain(np.asarray(alpha))) - strain)
        by_driving = width * across * cosine  # dG/dP_e, which is B
        by_alpha = (
            -driving * width * (across * sine + 2.0 * tube.end_loss * width * cosine**2)
            - 2.0 * tube.bending * alpha
            - tension
            - tube.stiffness * alpha**2 * ratio
        )
        volume = self.count * width * by_driving * ratio
        opened = effective_pressure_slope(pressure, tube.threshold, tube.threshold_width) if driving > 0.0 else 0.0
        return Response(tension, -volume * by_driving * opened / by_alpha, -volume * tube.stiffness * alpha / by_alpha)
