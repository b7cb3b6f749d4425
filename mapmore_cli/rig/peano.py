"""Static force of a Peano muscle: flat tubes that bulge into circular arcs, with fabric that stretches and bends."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from mapmore_cli.domain.arrays import Array
from mapmore_cli.rig.muscle import effective_pressure

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
