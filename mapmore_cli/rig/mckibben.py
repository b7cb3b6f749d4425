"""Static force of a McKibben muscle by virtual work on a braided cylinder with tapered ends.

Nothing here is a form that a fitted model has: the force follows from the braid's geometry and the rubber's energy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.rig.muscle import effective_pressure, softplus


@dataclass(frozen=True)
class McKibben:
    """`F = P_e V'(e)/L0 - U'(e)/L0 + crimp + stretch`, valid while `1 - 1/cos(theta0) < e < 0.4`.

    - P_e: pressure beyond the soft threshold (`effective_pressure`).
    - V, U: volume within the braid, and Mooney-Rivlin energy of the rubber wall.
    - crimp: fibres straightening in the ends, `crimp_force tanh(P_e/crimp_pressure)/(1 + e/crimp_strain)^crimp_exponent`.
    - stretch: taut braid below zero strain, `stretch_stiffness softplus(-e; stretch_strain)`.
    """

    length: float  # L0, m
    radius: float  # r0, m
    braid_angle: float  # theta0 between fibre and axis at rest, rad
    taper: float  # length of each tapered end over the change of radius
    wall: float  # rubber thickness t, m
    c10: float  # Mooney-Rivlin constants, Pa
    c01: float
    threshold: float  # P_th, Pa
    threshold_width: float  # Pa
    crimp_force: float  # N
    crimp_pressure: float  # Pa
    crimp_strain: float
    crimp_exponent: float
    stretch_stiffness: float  # N
    stretch_strain: float

    def force(self, pressure: Array | float, strain: Array | float) -> Array:
        """Return static pull, N, for pressures >= 0 (Pa) and strains, broadcast against each other."""
        driving = effective_pressure(pressure, self.threshold, self.threshold_width)
        strain = np.asarray(strain, dtype=np.float64)
        straightening = (1.0 + np.maximum(strain, 0.0) / self.crimp_strain) ** self.crimp_exponent
        crimp = self.crimp_force * np.tanh(driving / self.crimp_pressure) / straightening
        stretch = self.stretch_stiffness * softplus(-strain, self.stretch_strain)
        return (driving * volume_slope(self, strain) - energy_slope(self, strain)) / self.length + crimp + stretch


def _braid(muscle: McKibben, strain: Array) -> tuple[Array, Array, Array]:
    """Length L, outer radius R (m) and dR/de of a braid of inextensible fibres.

    `L = L0 (1 - e)`, `b = L0/cos(theta0)`, `2 pi n = b sin(theta0)/r0`, `R = sqrt(b^2 - L^2)/(2 pi n)`.
    """
    fibre = muscle.length / np.cos(muscle.braid_angle)
    turning = fibre * np.sin(muscle.braid_angle) / muscle.radius
    length = muscle.length * (1.0 - strain)
    radius = np.sqrt(fibre**2 - length**2) / turning
    return length, radius, muscle.length * length / (turning**2 * radius)


def volume(muscle: McKibben, strain: Array) -> Array:
    """Volume within the braid, m3: a cylinder between ends that taper parabolically to `r0` over `l = taper |d|`, `d = R - r0`.

    `V = pi R^2 (L - 2l) + 2 pi l (r0^2 + 4/3 r0 d + 8/15 d^2)`.
    """
    length, radius, _ = _braid(muscle, strain)
    growth = radius - muscle.radius
    end = muscle.taper * np.abs(growth)
    return np.asarray(np.pi * radius**2 * (length - 2.0 * end) + 2.0 * np.pi * end * _end_section(muscle, growth))


def volume_slope(muscle: McKibben, strain: Array) -> Array:
    """`V'(e)` in m3; positive where a growing volume shortens the muscle."""
    length, radius, radius_slope = _braid(muscle, strain)
    growth = radius - muscle.radius
    end = muscle.taper * np.abs(growth)
    end_slope = muscle.taper * np.sign(growth) * radius_slope
    cylinder = 2.0 * radius * radius_slope * (length - 2.0 * end) - radius**2 * (muscle.length + 2.0 * end_slope)
    ends = end_slope * _end_section(muscle, growth) + end * (4.0 / 3.0 * muscle.radius + 16.0 / 15.0 * growth) * radius_slope
    return np.asarray(np.pi * cylinder + 2.0 * np.pi * ends)


def _end_section(muscle: McKibben, growth: Array) -> Array:
    """Mean squared radius of a tapered end, m2."""
    return np.asarray(muscle.radius**2 + 4.0 / 3.0 * muscle.radius * growth + 8.0 / 15.0 * growth**2)


def energy(muscle: McKibben, strain: Array) -> Array:
    """Mooney-Rivlin energy of the wall, J: `U = 2 pi r0 t L0 (C10 (I1 - 3) + C01 (I2 - 3))`.

    The stretches are `1 - e` along, `R/r0` around, and their inverse product through the wall.
    """
    stretches = _stretches(muscle, strain)
    first = sum(stretch**2 for stretch in stretches)
    second = sum(stretch**-2 for stretch in stretches)
    return np.asarray(_rubber(muscle) * (muscle.c10 * (first - 3.0) + muscle.c01 * (second - 3.0)))


def energy_slope(muscle: McKibben, strain: Array) -> Array:
    """`U'(e)` in J."""
    along, around, through = _stretches(muscle, strain)
    around_slope = _braid(muscle, strain)[2] / muscle.radius
    through_slope = -through * (around_slope / around - 1.0 / along)
    slopes = ((along, -1.0), (around, around_slope), (through, through_slope))
    first = sum(2.0 * stretch * slope for stretch, slope in slopes)
    second = sum(-2.0 * stretch**-3 * slope for stretch, slope in slopes)
    return np.asarray(_rubber(muscle) * (muscle.c10 * first + muscle.c01 * second))


def _stretches(muscle: McKibben, strain: Array) -> tuple[Array, Array, Array]:
    along = 1.0 - strain
    around = _braid(muscle, strain)[1] / muscle.radius
    return along, around, 1.0 / (along * around)


def _rubber(muscle: McKibben) -> float:
    """Volume of rubber, m3."""
    return 2.0 * np.pi * muscle.radius * muscle.wall * muscle.length
