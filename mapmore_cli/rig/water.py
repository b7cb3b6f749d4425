"""Water in a pipe: inertance, and the pressure that friction and fittings take."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

WATER_DENSITY = 998.0
"""kg/m3."""

WATER_VISCOSITY = 1.0e-3
"""Dynamic, Pa s."""

BLASIUS_REYNOLDS = (64.0 / 0.316) ** (4.0 / 3.0)
"""Reynolds number (1187) at which laminar `64/Re` and Blasius' `0.316 Re^-0.25` give the same friction factor."""


@dataclass(frozen=True)
class Pipe:
    """A full, rigid, round pipe."""

    length: float  # m
    diameter: float  # m
    loss: float  # K of its entry, bends and fittings together

    @property
    def area(self) -> float:
        """Cross-section A, m2."""
        return 0.25 * pi * self.diameter**2

    @property
    def inertance(self) -> float:
        """`I = rho L/A`, Pa s2/m3."""
        return WATER_DENSITY * self.length / self.area

    def drop(self, flow: float) -> float:
        """Pressure lost to a steady `flow` (m3/s), Pa, of its sign: `R Q (1 + (Re/1187)^3)^(1/4) + K rho u |u|/2`.

        `R = 128 mu L/(pi d^4)` is the laminar resistance; the bracket blends into Blasius' law, `Re^(3/4)` as large.
        """
        speed = flow / self.area
        reynolds = WATER_DENSITY * abs(speed) * self.diameter / WATER_VISCOSITY
        laminar = 128.0 * WATER_VISCOSITY * self.length / (pi * self.diameter**4) * flow
        friction = laminar * sqrt(sqrt(1.0 + (reynolds / BLASIUS_REYNOLDS) ** 3))
        return friction + 0.5 * self.loss * WATER_DENSITY * speed * abs(speed)
