"""What a muscle is to the water that fills it: a chamber whose pull and volume depend on its pressure and strain."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import NamedTuple, Protocol

import numpy as np

from mapmore_cli.rig.mckibben import McKibben, volume_slope
from mapmore_cli.rig.muscle import effective_pressure, effective_pressure_slope
from mapmore_cli.rig.peano import Peano, geometric_slope_ratio, geometric_strain, opening_angle


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
        """Static force, no filling, `V'(e)`."""
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
