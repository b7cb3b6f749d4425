"""The spec of a simulation: which synthetic muscle, on which rig, seen through which sensors.

Numbers are in the units of the recordings: kPa, N, m, s, strain as a fraction; angles in degrees. The defaults of the muscles give the
force levels and free strains of the McKibben and Peano muscles of M2.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from mapmore_cli.spec.fields import Name, Positive, Section
from mapmore_cli.spec.simulated_experiments import LoadCycles, NonNegative, Perturbations, StepResponses
from mapmore_cli.spec.waveform_rig import Waveforms


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


class Stop(Section):
    """One elasto-slide element: it yields after `yield_strain` and carries `share` of the friction."""

    yield_strain: Positive
    share: Positive


class HysteresisSpec(Section):
    """Friction: half-width of the loop in N, `base + per_pressure P[kPa]`, shared out among `stops`."""

    base: NonNegative  # N
    per_pressure: NonNegative  # N/kPa
    stops: Annotated[list[Stop], Field(min_length=1)]

    @model_validator(mode="after")
    def _whole(self) -> HysteresisSpec:
        total = sum(stop.share for stop in self.stops)
        if abs(total - 1.0) > 1e-9:
            raise ValueError(f"the shares of the stops must add up to 1, not {total:g}")
        return self


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


_WET = {"pressure", "strain", "force", "flow", "muscle_pressure"}
SENSED: dict[str, set[str]] = {
    "load_cycles": {"pressure", "strain", "force"},
    "step_responses": _WET,
    "perturbation": _WET,
    "waveforms": {"pressure", "displacement", "load"},
}
"""What each experiment measures."""


class SimulationSpec(Section):
    """One synthetic campaign; `mapmore simulate` writes `<output>_<pressure>.csv` for each pressure (or waveform) beside the spec."""

    schema_version: Literal[1] = 1
    name: Name
    muscle: Annotated[McKibbenMuscle | PeanoMuscle, Field(discriminator="kind")]
    hysteresis: HysteresisSpec
    experiment: Annotated[LoadCycles | StepResponses | Perturbations | Waveforms, Field(discriminator="type")]
    sensors: Sensors
    seed: Annotated[int, Field(ge=0)]
    output: Name

    @model_validator(mode="after")
    def _sensed(self) -> SimulationSpec:
        sensed = SENSED[self.experiment.type]
        for name, sensor in self.sensors:
            if sensor is None and name in sensed:
                raise ValueError(f"`sensors.{name}` is missing: `type: {self.experiment.type}` measures it")
            if sensor is not None and name not in sensed:
                having = " and ".join(kind for kind, names in SENSED.items() if name in names)
                raise ValueError(f"`sensors.{name}` goes with {having}, and with these only")
        return self

    @model_validator(mode="after")
    def _braided(self) -> SimulationSpec:
        if isinstance(self.experiment, Waveforms) and not isinstance(self.muscle, McKibbenMuscle):
            raise ValueError("`type: waveforms` moves a muscle of `kind: mckibben`")
        return self
