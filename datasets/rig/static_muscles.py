"""Static force and volume of a McKibben muscle, a braided cylinder with tapered ends, and of a
Peano muscle, flat tubes in series.

Nothing here is a form that a fitted model has: forces follow from geometry and the energy of the
rubber, by virtual work.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Interval
from scipy.optimize import brentq

from datasets.rig.marks import After, NonNegative, Positive
from datasets.rig.muscle import (
    NonNegativeKpa,
    PositiveKpa,
    Response,
    effective_pressure,
    effective_pressure_slope,
    softplus,
)
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.declared import Settings


@dataclass(frozen=True)
class McKibben(Settings):
    """`F = P_e V'(e)/L0 - U'(e)/L0 + crimp + stretch`, valid while `1 - 1/cos(theta0) < e < 0.4`.

    - P_e: pressure beyond the soft threshold (`effective_pressure`).
    - V, U: volume within the braid, and Mooney-Rivlin energy of the rubber wall.
    - crimp: fibres straightening in the ends, `crimp_force tanh(P_e/crimp_pressure)/(1 +
      e/crimp_strain)^crimp_exponent`.
    - stretch: taut braid below zero strain, `stretch_stiffness softplus(-e; stretch_strain)`.

    The defaults are those of the DMSP-20-88N.
    """

    kind: Literal["mckibben"]
    length: Positive = 0.088  # L0, m
    diameter: Positive = 0.020  # m
    braid_angle: Annotated[float, Interval(ge=12, lt=54), After(math.radians)] = math.radians(25.0)
    """theta0 between fibre and axis at rest, rad; in specs degrees. Below 12, taut before 2 % of
    stretch.
    """
    taper: Annotated[float, Interval(ge=0, le=2)] = (
        0.85  # length of each tapered end over the change of radius
    )
    wall: Positive = 0.002  # rubber thickness t, m
    c10: NonNegativeKpa = 280e3  # Mooney-Rivlin constants, Pa
    c01: NonNegativeKpa = 60e3
    threshold: NonNegativeKpa = 22e3  # P_th that unfolds the wall, Pa
    threshold_width: PositiveKpa = 8e3  # Pa
    crimp_force: NonNegative = 150.0  # N
    crimp_pressure: PositiveKpa = 150e3  # Pa
    crimp_strain: Positive = 0.012
    crimp_exponent: Positive = 1.5
    stretch_stiffness: NonNegative = 9000.0  # N
    stretch_strain: Positive = 0.002

    @property
    def radius(self) -> float:
        """r0, m."""
        return 0.5 * self.diameter

    def force(self, pressure: Array | float, strain: Array | float) -> Array:
        """Return static pull, N, for pressures >= 0 (Pa) and strains, broadcast against each
        other.
        """
        driving = effective_pressure(pressure, self.threshold, self.threshold_width)
        strain = np.asarray(strain, dtype=np.float64)
        straightening = (1.0 + np.maximum(strain, 0.0) / self.crimp_strain) ** self.crimp_exponent
        crimp = self.crimp_force * np.tanh(driving / self.crimp_pressure) / straightening
        stretch = self.stretch_stiffness * softplus(-strain, self.stretch_strain)
        return (
            (driving * volume_slope(self, strain) - energy_slope(self, strain)) / self.length
            + crimp
            + stretch
        )

    def respond(self, pressure: float, strain: float) -> Response:
        """Return static force, no filling, `V'(e)`: the fibres do not stretch, so that strain alone
        gives the volume.
        """
        return Response(
            float(self.force(pressure, strain)), 0.0, float(volume_slope(self, np.asarray(strain)))
        )


def _braid(muscle: McKibben, strain: Array) -> tuple[Array, Array, Array]:
    """Length L, outer radius R (m) and dR/de of a braid of inextensible fibres.

    `L = L0 (1 - e)`, `b = L0/cos(theta0)`, `2 pi n = b sin(theta0)/r0`, `R = sqrt(b^2 - L^2)/(2 pi
    n)`.
    """
    fibre = muscle.length / np.cos(muscle.braid_angle)
    turning = fibre * np.sin(muscle.braid_angle) / muscle.radius
    length = muscle.length * (1.0 - strain)
    radius = np.sqrt(fibre**2 - length**2) / turning
    return length, radius, muscle.length * length / (turning**2 * radius)


def volume(muscle: McKibben, strain: Array) -> Array:
    """Volume within the braid, m3: a cylinder between ends that taper parabolically to `r0` over `l
    = taper |d|`, `d = R - r0`.

    `V = pi R^2 (L - 2l) + 2 pi l (r0^2 + 4/3 r0 d + 8/15 d^2)`.
    """
    length, radius, _ = _braid(muscle, strain)
    growth = radius - muscle.radius
    end = muscle.taper * np.abs(growth)
    return np.pi * radius**2 * (length - 2.0 * end) + 2.0 * np.pi * end * _end_section(
        muscle, growth
    )


def volume_slope(muscle: McKibben, strain: Array) -> Array:
    """`V'(e)` in m3; positive where a growing volume shortens the muscle."""
    length, radius, radius_slope = _braid(muscle, strain)
    growth = radius - muscle.radius
    end = muscle.taper * np.abs(growth)
    end_slope = muscle.taper * np.sign(growth) * radius_slope
    cylinder = 2.0 * radius * radius_slope * (length - 2.0 * end) - radius**2 * (
        muscle.length + 2.0 * end_slope
    )
    ends = (
        end_slope * _end_section(muscle, growth)
        + end * (4.0 / 3.0 * muscle.radius + 16.0 / 15.0 * growth) * radius_slope
    )
    return np.pi * cylinder + 2.0 * np.pi * ends


def _end_section(muscle: McKibben, growth: Array) -> Array:
    """Mean squared radius of a tapered end, m2."""
    return muscle.radius**2 + 4.0 / 3.0 * muscle.radius * growth + 8.0 / 15.0 * growth**2


def energy_slope(muscle: McKibben, strain: Array) -> Array:
    """`U'(e)`, J, of the wall's Mooney-Rivlin energy `U = 2 pi r0 t L0 (C10 (I1 - 3) + C01 (I2 -
    3))`.

    The stretches are `1 - e` along, `R/r0` around, and their inverse product through the wall.
    """
    _, radius, radius_slope = _braid(muscle, strain)
    along, around = 1.0 - strain, radius / muscle.radius
    around_slope, through = radius_slope / muscle.radius, 1.0 / (along * around)
    slopes = (
        (along, -1.0),
        (around, around_slope),
        (through, -through * (around_slope / around - 1.0 / along)),
    )
    first = sum(2.0 * stretch * slope for stretch, slope in slopes)
    second = sum(-2.0 * stretch**-3 * slope for stretch, slope in slopes)
    rubber = 2.0 * np.pi * muscle.radius * muscle.wall * muscle.length
    return np.asarray(rubber * (muscle.c10 * first + muscle.c01 * second))


_HALVINGS = 60  # of (0, pi/2): down to the last bit of alpha
_FLAT = 1e-9  # rad, of a tube without any water
_SMALL = 1e-2  # rad, below which the series is exact to the last digits


@dataclass(frozen=True)
class Peano(Settings):
    """Flat tubes in series, by half the opening angle of their arcs, `0 <= alpha <= pi/2`; they
    have to fill before they pull.

    `e = 1 - sin(alpha)/alpha - F/K` and `F = P_e w (D - 2 beta w sin(alpha)) cos(alpha)/alpha - k_b
    alpha`; where a tube is flat (alpha = 0, no pressure), `F = K (e_g - e)` with the geometric
    strain e_g = 0: the fabric alone. All tubes carry the same force at the same strain. The volume
    is `V'(alpha) = n w B(alpha) e_g'(alpha)/alpha`, by virtual work with `B = w (D - 2 beta w
    sin(alpha)) cos(alpha)` and `e_g = 1 - sin(alpha)/alpha`; pressure and strain give alpha, by `G
    = P_e B - k_b alpha^2 - alpha T = 0` with the fabric's tension `T = K (e_g - e)`. The defaults
    are those of the four-tube muscle of M2.
    """

    kind: Literal["peano"]
    tube_width: Positive = 0.01725  # w of the flat tube, along the pull, m
    tube_length: Positive = 0.046  # D, across the pull, m
    end_loss: Annotated[float, Interval(ge=0, lt=1)] = (
        0.33  # beta: share of the bulge that the closed tube ends take away
    )
    stiffness: Positive = 26000.0  # K of the fabric, N per strain
    bending: NonNegative = 26.0  # k_b of the tube's edges, N per rad
    tubes: Annotated[int, Ge(1)] = 4  # n; the wet rig has to fill them all
    threshold: NonNegativeKpa = 6e3  # P_th, Pa
    threshold_width: PositiveKpa = 3e3  # Pa

    @property
    def length(self) -> float:
        """L0, m: the flat tubes side by side."""
        return self.tubes * self.tube_width

    def force(self, pressure: Array | float, strain: Array | float) -> Array:
        """Return static pull, N, for pressures >= 0 (Pa) and strains < 0.36, broadcast against each
        other.
        """
        driving = effective_pressure(pressure, self.threshold, self.threshold_width)
        driving, strain = np.broadcast_arrays(driving, np.asarray(strain, dtype=np.float64))
        # By the fabric's law and not by the arc's: exact at alpha = 0, where the latter divides by
        # zero.
        return self.stiffness * (geometric_strain(opening(self, driving, strain)) - strain)

    def respond(self, pressure: float, strain: float) -> Response:
        """Fabric tension, `V'(alpha) dalpha/dP`, `V'(alpha) dalpha/de`."""
        # Suction holds a flat tube shut; it cannot turn its arcs inside out.
        driving = max(
            float(effective_pressure(pressure, self.threshold, self.threshold_width)), 0.0
        )
        alpha = opening_angle(self, driving, strain)
        width, sine, cosine = self.tube_width, math.sin(alpha), math.cos(alpha)
        across, ratio = (
            self.tube_length - 2.0 * self.end_loss * width * sine,
            geometric_slope_ratio(alpha),
        )
        tension = self.stiffness * (float(geometric_strain(np.asarray(alpha))) - strain)
        by_driving = width * across * cosine  # dG/dP_e, which is B
        by_alpha = (
            -driving * width * (across * sine + 2.0 * self.end_loss * width * cosine**2)
            - 2.0 * self.bending * alpha
            - tension
            - self.stiffness * alpha**2 * ratio
        )
        volume = self.tubes * width * by_driving * ratio
        opened = (
            effective_pressure_slope(pressure, self.threshold, self.threshold_width)
            if driving > 0.0
            else 0.0
        )
        return Response(
            tension,
            -volume * by_driving * opened / by_alpha,
            -volume * self.stiffness * alpha / by_alpha,
        )


def geometric_strain(alpha: Array) -> Array:
    """`e_g = 1 - sin(alpha)/alpha`: contraction of a tube of inextensible fabric; zero at alpha =
    0.
    """
    return 1.0 - np.sinc(alpha / np.pi)


def geometric_slope_ratio(alpha: float) -> float:
    """`e_g'(alpha)/alpha = (sin(alpha) - alpha cos(alpha))/alpha^3`; by its series where the
    difference would lose its digits.
    """
    if alpha < _SMALL:
        return 1.0 / 3.0 - alpha**2 / 30.0
    return (math.sin(alpha) - alpha * math.cos(alpha)) / alpha**3


def opening(muscle: Peano, driving: Array, strain: Array) -> Array:
    """Angle alpha, rad, at which arc and fabric carry the same force at `strain`; `driving` is P_e
    >= 0 in Pa.

    `e_g(alpha) - F(alpha)/K - e` rises with alpha, so that bisection always finds its one root. It
    is multiplied by alpha, which keeps its sign and removes the pole at 0; where even the flat tube
    is too long (no pressure, stretched), alpha tends to 0.
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


def _excess(
    muscle: Peano, driving: Array | float, strain: Array | float, alpha: Array | float
) -> Array:
    """`alpha (1 - e) - sin(alpha) - alpha F(alpha)/K`."""
    width = muscle.tube_width
    bulge = (
        driving
        * width
        * (muscle.tube_length - 2.0 * muscle.end_loss * width * np.sin(alpha))
        * np.cos(alpha)
    )
    return (
        alpha * (1.0 - strain)
        - np.sin(alpha)
        - (bulge - muscle.bending * alpha**2) / muscle.stiffness
    )
