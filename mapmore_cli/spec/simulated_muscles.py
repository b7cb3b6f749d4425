"""The synthetic muscles as a simulation's spec names them: kPa, N, m, angles in degrees."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from mapmore_cli.spec.fields import Positive, Section
from mapmore_cli.spec.simulated_experiments import NonNegative


class McKibbenMuscle(Section):
    """A braided cylinder around a rubber tube (see `mapmore_cli.rig.mckibben`); defaults: DMSP-20-88N."""

    kind: Literal["mckibben"]
    length: Positive = 0.088  # m
    diameter: Positive = 0.020  # m
    braid_angle: Annotated[float, Field(ge=12, lt=54)] = 25.0  # degrees from the axis; below 12, taut before 2 % of stretch
    taper: Annotated[float, Field(ge=0, le=2)] = 0.85  # length of each tapered end over the change of radius
    wall: Positive = 0.002  # m
    c10: NonNegative = 280.0  # Mooney-Rivlin constants, kPa
    c01: NonNegative = 60.0  # kPa
    threshold: NonNegative = 22.0  # pressure that unfolds the wall, kPa
    threshold_width: Positive = 8.0  # kPa
    crimp_force: NonNegative = 150.0  # N
    crimp_pressure: Positive = 150.0  # kPa
    crimp_strain: Positive = 0.012
    crimp_exponent: Positive = 1.5
    stretch_stiffness: NonNegative = 9000.0  # taut braid below zero strain, N
    stretch_strain: Positive = 0.002


class PeanoMuscle(Section):
    """Flat tubes side by side (see `mapmore_cli.rig.peano`); defaults: the four-tube muscle of M2."""

    kind: Literal["peano"]
    tube_width: Positive = 0.01725  # along the pull, m
    tube_length: Positive = 0.046  # across the pull, m
    end_loss: Annotated[float, Field(ge=0, lt=1)] = 0.33  # beta: share of the bulge that the closed ends take away
    stiffness: Positive = 26000.0  # of the fabric, N
    bending: NonNegative = 26.0  # N per rad
    tubes: Annotated[int, Field(ge=1)] = 4  # side by side; the wet rig has to fill them all
    threshold: NonNegative = 6.0  # kPa
    threshold_width: Positive = 3.0  # kPa
