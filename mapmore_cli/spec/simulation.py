"""The spec of a simulation: which synthetic muscle, on which rig, seen through which sensors.

Numbers are in the units of the recordings: kPa, N, kg, m, s, strain as a fraction; angles in degrees. The defaults of the muscles give the
force levels and free strains of the McKibben and Peano muscles of M2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from mapmore_cli.domain.declared import NonNegative, Positive
from mapmore_cli.rig.air import Air, Reservoir
from mapmore_cli.rig.load_cycle import Regulation
from mapmore_cli.rig.muscle import Rubber
from mapmore_cli.rig.random_velocity import Tendon
from mapmore_cli.rig.step_response import Bumper
from mapmore_cli.rig.water import Pipe, Wall
from mapmore_cli.spec.fields import Name, Section

Pressure = Annotated[float, Field(ge=0, le=2000)]  # kPa, gauge; above, the geometry of the muscles means nothing
DrivingPressure = Annotated[float, Field(gt=0, le=1000)]  # kPa, gauge; that fills a muscle with water
Command = Annotated[float, Field(ge=0, le=10)]  # V
Fraction = Annotated[float, Field(ge=0, le=1)]


def pressure_label(pressure: float) -> str:
    """Name of a pressure in file names: `080`, `350`, `82.5`."""
    return f"{pressure:03g}"


def _once(label: Callable[[Any], str], mistake: str = "each pressure makes one recording: name it once") -> AfterValidator:
    """Refuse a list in which two items would give files of one name."""

    def refuse_twins(items: list[Any]) -> list[Any]:
        if len(set(map(label, items))) != len(items):
            raise ValueError(mistake)
        return items

    return AfterValidator(refuse_twins)


Pressures = Annotated[list[Pressure], Field(min_length=1), _once(pressure_label)]
"""A recording each, kPa."""


# Muscles -----------------------------------------------------------------------------------------------------------------------------


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


class Stop(Section):
    """One elasto-slide element: it yields after `yield_strain` and carries `share` of the friction."""

    yield_strain: Positive
    share: Positive


class HysteresisSpec(Section):
    """Friction: half-width of the loop in N, `base + per_pressure P[kPa]`, shared out among `stops`."""

    base: NonNegative  # N
    per_pressure: NonNegative  # N/kPa
    stops: Annotated[list[Stop], Field(min_length=1)]

    def _contradictions(self) -> Iterator[ValueError]:
        total = sum(stop.share for stop in self.stops)
        if abs(total - 1.0) > 1e-9:
            yield ValueError(f"the shares of the stops must add up to 1, not {total:g}")


# Experiments of M1, M2 and P ---------------------------------------------------------------------------------------------------------


class LoadCycles(Section):
    """One slow contraction and extension at each pressure (M1 section IV.A); with more `turns`, reversals inside of that loop."""

    type: Literal["load_cycles"]
    pressures: Pressures
    duration: Positive  # of each recording, s
    sample_time: Positive  # s
    dwell: NonNegative  # rest before, between and after the moves, s
    turns: Annotated[list[Fraction], Field(min_length=1)] = [1.0]  # noqa: RUF012 (pydantic copies it); of the stroke, from zero to zero
    least_stroke: Annotated[float, Field(gt=0, le=0.2)]  # strain reached even where the muscle has no force
    regulation: Regulation

    def _contradictions(self) -> Iterator[ValueError]:
        rests = len(self.turns) + 2
        if rests * self.dwell >= self.duration:
            yield ValueError(f"{rests} rests of `dwell` leave no time to move: lengthen `duration`")
        if any(after == before for before, after in pairwise([0.0, *self.turns, 0.0])):
            yield ValueError("the actuator must move from each of `turns` to the next, beginning and ending at zero")
        if 100 * self.sample_time > self.duration:
            yield ValueError("fewer than 100 samples: shorten `sample_time` or lengthen `duration`")


class WaterRig(Section):
    """From the reservoir to the load cell (see `mapmore_cli.rig.water`)."""

    line: Pipe  # reservoir to pressure sensor
    hose: Wall  # of the line, where the sensor sits
    tube: Pipe  # sensor to muscle
    trapped_air: Positive  # in the muscle, m3 at no gauge pressure
    wall: Wall  # of the muscle
    rubber: Rubber
    load_cell: Positive  # cut-off of its amplifier, Hz


class StepSpec(Section):
    """One recording."""

    pressure: DrivingPressure  # of the supply, kPa
    weight: Positive  # that hangs on the muscle, N


class StepResponses(Section):
    """A weight is suddenly lifted and dropped again, once for each step (M2 section 4.1, table 3)."""

    type: Literal["step_responses"]
    steps: Annotated[list[StepSpec], Field(min_length=1), _once(lambda step: pressure_label(step.pressure))]
    rest: Positive  # before the supply opens, s
    hold: Positive  # until the exhaust opens, s
    fall: Positive  # until the recording ends, s
    sample_time: Positive  # s
    reservoir: Reservoir
    bumper: Bumper
    rig: WaterRig

    @property
    def pressures(self) -> list[float]:
        """One for each recording, kPa."""
        return [step.pressure for step in self.steps]

    def _contradictions(self) -> Iterator[ValueError]:
        if any(step.weight <= self.bumper.pretension for step in self.steps):
            yield ValueError("each weight must exceed the `pretension`, or it would hang free of its stop from the start")
        if 10 * self.sample_time > min(self.rest, self.hold, self.fall):
            yield ValueError("`rest`, `hold` and `fall` need ten samples each: shorten `sample_time` or lengthen them")


class Perturbations(Section):
    """The muscle is stretched and released at constant pressure, at several speeds (M2 section 6.2)."""

    type: Literal["perturbation"]
    pressures: Annotated[list[DrivingPressure], Field(min_length=1), _once(pressure_label)]  # kPa
    between: Annotated[tuple[float, float], Field(strict=False)]  # stretched and contracted end, as fractions of the free strain
    moves: Annotated[list[Positive], Field(min_length=1)]  # duration of each stretch, and of the release after it, s
    dwell: Positive  # before, between and after the moves, s
    sample_time: Positive  # s
    rig: WaterRig

    def _contradictions(self) -> Iterator[ValueError]:
        if not 0.0 <= self.between[0] < self.between[1] <= 1.0:
            yield ValueError("`between` needs two fractions of the free strain, the stretched end first: [0.2, 0.8]")
        if 10 * self.sample_time > min(self.dwell, *self.moves):
            yield ValueError("each move and `dwell` need ten samples: shorten `sample_time` or lengthen them")


class RegulatorSpec(Section):
    """Proportional pressure regulator behind an ISO 6358 valve (see `mapmore_cli.rig.air`)."""

    slope: Positive  # of the wanted pressure, kPa/V
    offset: float  # at no input, kPa
    lag: Positive  # of the wanted pressure, s
    band: Positive  # missing pressure at which its valve is fully open, kPa
    supply: Positive  # kPa, gauge
    supply_conductance: Positive  # m3/(s Pa)
    exhaust_conductance: Positive
    critical_ratio: Annotated[float, Field(ge=0, lt=0.99)]


class WaveformSpec(Section):
    """One recording: rest, then so many wavelengths, which begin at `low` (a square wave at `high`)."""

    name: Name
    shape: Literal["sine", "triangle", "square"]
    low: Command
    high: Command
    frequency: Positive  # Hz
    wavelengths: Annotated[int, Field(ge=1)]
    rest_at: Command = 0.0  # input before the first wavelength, under which the muscle has come to rest
    load: NonNegative = 0.0  # that hangs on the muscle beside its own end, kg

    def _contradictions(self) -> Iterator[ValueError]:
        if self.low >= self.high:
            yield ValueError("`low` must lie below `high`")


_NAMED = _once(lambda waveform: waveform.name, "each waveform makes one recording: give it a name of its own")


class Waveforms(Section):
    """The input of a regulator follows waveforms, one recording each; a hanging McKibben muscle moves (P section 2.4, table 2)."""

    type: Literal["waveforms"]
    waveforms: Annotated[list[WaveformSpec], Field(min_length=1), _NAMED]
    rest: Positive  # before the first wavelength, s
    sample_time: Positive  # s
    regulator: RegulatorSpec
    polytropic: Annotated[float, Field(ge=1, le=1.4)]  # of the air in the muscle
    dead_volume: NonNegative  # of hose and fittings, m3
    end_mass: Positive  # of the muscle's lower end and the encoder's slide, kg
    rubber: Rubber

    def _contradictions(self) -> Iterator[ValueError]:
        if 10 * self.sample_time > min(1.0 / waveform.frequency for waveform in self.waveforms):
            yield ValueError("each wavelength needs ten samples: shorten `sample_time` or lower `frequency`")


# Experiments of W and H --------------------------------------------------------------------------------------------------------------


class ContractionTable(Section):
    """Contraction at each pressure under each load, repeated and averaged (W section II): a table for each pressure."""

    type: Literal["contraction_table"]
    pressures: Pressures
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
    pressures: Pressures  # initial ones
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

    def _contradictions(self) -> Iterator[ValueError]:
        if self.speeds[0] > self.speeds[1]:
            yield ValueError("`speeds` needs the slower one first: [0.02, 0.2]")
        if 100 * self.sample_time * self.every > self.duration:
            yield ValueError("fewer than 100 samples: shorten `sample_time`, keep more of them, or lengthen `duration`")


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

    def _contradictions(self) -> Iterator[ValueError]:
        if "random" in self.recordings and self.course is None:
            yield ValueError("`random` needs a `course`, as {between: [200, 500], pace: [0.2, 1]}")


# Sensors and the whole ---------------------------------------------------------------------------------------------------------------


class SensorSpec(Section):
    """White noise (standard deviation) and quantisation step, in the unit of the column."""

    noise: NonNegative
    resolution: Positive


class Sensors(Section):
    """What the logger sees."""

    pressure: SensorSpec  # kPa
    strain: SensorSpec | None = None
    force: SensorSpec | None = None  # N
    flow: SensorSpec | None = None  # L/min; of the wet experiments
    muscle_pressure: SensorSpec | None = None  # kPa; of the wet experiments
    displacement: SensorSpec | None = None  # mm; of waveforms
    load: SensorSpec | None = None  # N; of waveforms
    length: SensorSpec | None = None  # mm of elongation; of random velocity and antagonists
    velocity: SensorSpec | None = None  # mm/s; of random velocity and antagonists


SENSED: dict[str, set[str]] = {
    "load_cycles": {"pressure", "strain", "force"},
    **{kind: {"pressure", "strain", "force", "flow", "muscle_pressure"} for kind in ("step_responses", "perturbation")},
    "waveforms": {"pressure", "displacement", "load"},
    "contraction_table": {"pressure", "strain"},
    **{kind: {"pressure", "length", "velocity", "force"} for kind in ("random_velocity", "antagonists")},
}
"""What each experiment measures."""


Experiment = LoadCycles | StepResponses | Perturbations | Waveforms | ContractionTable | RandomVelocity | Antagonists


class SimulationSpec(Section):
    """One synthetic campaign; `mapmore simulate` writes `<output>_<pressure>.csv` for each pressure (or waveform) beside the spec."""

    schema_version: Literal[1] = 1
    name: Name
    muscle: Annotated[McKibbenMuscle | PeanoMuscle, Field(discriminator="kind")]
    hysteresis: HysteresisSpec
    experiment: Annotated[Experiment, Field(discriminator="type")]
    sensors: Sensors
    seed: Annotated[int, Field(ge=0)]
    output: Name

    def _contradictions(self) -> Iterator[ValueError]:
        kind = self.experiment.type
        for name, sensor in self.sensors:
            if sensor is None and name in SENSED[kind]:
                yield ValueError(f"`sensors.{name}` is missing: `type: {kind}` measures it")
            if sensor is not None and name not in SENSED[kind]:
                having = " and ".join(other for other, names in SENSED.items() if name in names)
                yield ValueError(f"`sensors.{name}` goes with {having}, and with these only")
        if isinstance(self.experiment, Waveforms | RandomVelocity | Antagonists) and not isinstance(self.muscle, McKibbenMuscle):
            yield ValueError(f"`type: {kind}` moves a muscle of `kind: mckibben`")
