"""The synthetic muscles, and W's and H's experiments, as a simulation's spec names them; kPa, N, kg, m, s, angles in degrees."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from mapmore_cli.domain.declared import NonNegative, Positive
from mapmore_cli.rig.air import Air
from mapmore_cli.rig.muscle import Rubber
from mapmore_cli.rig.random_velocity import Tendon
from mapmore_cli.spec.fields import Section
from mapmore_cli.spec.simulated_experiments import Pressure, RegulatorSpec, once


class McKibbenMuscle(Section):
    """A braided cylinder around a rubber tube (see `mapmore_cli.rig.static_muscles`); defaults: DMSP-20-88N."""

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
    """Flat tubes side by side (see `mapmore_cli.rig.static_muscles`); defaults: the four-tube muscle of M2."""

    kind: Literal["peano"]
    tube_width: Positive = 0.01725  # along the pull, m
    tube_length: Positive = 0.046  # across the pull, m
    end_loss: Annotated[float, Field(ge=0, lt=1)] = 0.33  # beta: share of the bulge that the closed ends take away
    stiffness: Positive = 26000.0  # of the fabric, N
    bending: NonNegative = 26.0  # N per rad
    tubes: Annotated[int, Field(ge=1)] = 4  # side by side; the wet rig has to fill them all
    threshold: NonNegative = 6.0  # kPa
    threshold_width: Positive = 3.0  # kPa


class ContractionTable(Section):
    """Contraction at each pressure under each load, repeated and averaged (W section II): a table for each pressure."""

    type: Literal["contraction_table"]
    pressures: Annotated[list[Pressure], Field(min_length=1), AfterValidator(once)]  # kPa
    masses: Annotated[list[NonNegative], Field(min_length=1)]  # kg, in the order in which they are hung on
    repeats: Annotated[int, Field(ge=1)]
    regulator_error: NonNegative  # standard deviation of the pressure between repeats, kPa


class RestLength(Section):
    """The muscle's state at the length that its elongation is measured from."""

    pressure: Positive  # kPa
    force: Positive  # N


class Course(Section):
    """Smooth moves of a wanted pressure to random places, in random times."""

    between: Annotated[tuple[Pressure, Pressure], Field(strict=False)]  # kPa
    pace: Annotated[tuple[Positive, Positive], Field(strict=False)]  # shortest and longest move, s


class Valves(Section):
    """A regulator drives the pressure along random moves, which begin at the initial pressure."""

    regulator: RegulatorSpec
    course: Course


class RandomVelocity(Section):
    """A motor moves the muscle at random velocities for a while, valves closed at an initial pressure (H section II.A), or controlled."""

    type: Literal["random_velocity"]
    pressures: Annotated[list[Pressure], Field(min_length=1), AfterValidator(once)]  # initial, kPa
    duration: Positive  # s
    sample_time: Positive  # of the simulation, s
    every: Annotated[int, Field(ge=1)]  # samples that the file has one of
    speeds: Annotated[tuple[Positive, Positive], Field(strict=False)]  # slowest and fastest peak of a move, m/s
    rest: RestLength
    taut: Positive  # force with which the rope is drawn taut before the valves close, N
    drawn_out: Annotated[float, Field(ge=-0.01, le=0.3)]  # strain at the far end of the stroke
    air: Air
    rubber: Rubber
    load_cell: Positive  # cut-off of its amplifier, Hz
    tendon: Tendon | None = None  # in series; lengths are then those of both
    valves: Valves | None = None  # controlled; else closed

    @model_validator(mode="after")
    def _possible(self) -> RandomVelocity:
        if self.speeds[0] > self.speeds[1]:
            raise ValueError("`speeds` needs the slower one first: [0.02, 0.2]")
        if 100 * self.sample_time * self.every > self.duration:
            raise ValueError("fewer than 100 samples: shorten `sample_time`, keep more of them, or lengthen `duration`")
        return self


class Antagonists(Section):
    """Two muscles on a joint (H section II.D): `closed` swings it by a motor at closed valves, `driven` drives the pressures in antiphase.

    `random` drives each pressure along a `course` of its own. The spec's `muscle` is the flexor.
    """

    type: Literal["antagonists"]
    extensor: McKibbenMuscle
    recordings: Annotated[list[Literal["closed", "driven", "random"]], Field(min_length=1)]
    duration: Positive  # s
    sample_time: Positive  # s
    frequency: Positive  # Hz
    amplitude: Positive  # of the closed swing, rad
    pressure: Positive  # at which the valves are closed, and at which both muscles are at angle zero, kPa
    pressures: Annotated[tuple[Pressure, Pressure], Field(strict=False)]  # between which they are driven, kPa
    taut: Positive  # force of both muscles at angle zero, N
    rest: RestLength
    radius: Positive  # of the pulleys, m
    inertia: Positive  # kg m2
    damping: NonNegative  # N m s
    air: Air
    rubber: Rubber
    regulator: RegulatorSpec
    course: Course | None = None  # of `random`
    load_cell: Positive  # Hz

    @model_validator(mode="after")
    def _possible(self) -> Antagonists:
        if "random" in self.recordings and self.course is None:
            raise ValueError("`random` needs a `course`, as {between: [200, 500], pace: [0.2, 1]}")
        return self
