"""The spec of a simulation: which synthetic muscle, on which rig, seen through which sensors.

Numbers are in the units of the recordings: kPa, N, m, s, strain as a fraction; angles in degrees. The defaults of the muscles give the
force levels and free strains of the McKibben and Peano muscles of M2.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from mapmore_cli.domain.declared import NonNegative, Positive
from mapmore_cli.spec.fields import Name, Section
from mapmore_cli.spec.muscle_rigs import Antagonists, ContractionTable, McKibbenMuscle, PeanoMuscle, RandomVelocity
from mapmore_cli.spec.simulated_experiments import LoadCycles, Perturbations, StepResponses, Waveforms


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
    length: SensorSpec | None = None  # mm of elongation; of random velocity and antagonists
    velocity: SensorSpec | None = None  # mm/s; of random velocity and antagonists


_WET = {"pressure", "strain", "force", "flow", "muscle_pressure"}
SENSED: dict[str, set[str]] = {
    "load_cycles": {"pressure", "strain", "force"},
    "step_responses": _WET,
    "perturbation": _WET,
    "waveforms": {"pressure", "displacement", "load"},
    "contraction_table": {"pressure", "strain"},
    "random_velocity": {"pressure", "length", "velocity", "force"},
    "antagonists": {"pressure", "length", "velocity", "force"},
}
"""What each experiment measures."""


Experiment = LoadCycles | StepResponses | Perturbations | Waveforms | ContractionTable | RandomVelocity | Antagonists


class SimulationSpec(Section):
    """One synthetic campaign; `mapmore simulate` writes `<output>_<pressure>.csv` for each pressure (or waveform) beside the spec."""

    schema_version: Literal[1] = 1
    name: Name
    muscle: Annotated[McKibbenMuscle | PeanoMuscle, Field(discriminator="kind")]
    hysteresis: HysteresisSpec
    experiment: Annotated[
        LoadCycles | StepResponses | Perturbations | Waveforms | ContractionTable | RandomVelocity | Antagonists,
        Field(discriminator="type"),
    ]
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
        if isinstance(self.experiment, Waveforms | RandomVelocity | Antagonists) and not isinstance(self.muscle, McKibbenMuscle):
            raise ValueError(f"`type: {self.experiment.type}` moves a muscle of `kind: mckibben`")
        return self
