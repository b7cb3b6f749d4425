"""The spec of a simulation: which synthetic muscle, on which rig, seen through which sensors.

Muscles and experiments are those of `mapmore_cli.annexes.rig`, validated. Numbers are in the units
of the recordings: kPa, N, kg, m, s, strain as a fraction; angles in degrees. The defaults of the
muscles give the force levels and free strains of the McKibben and Peano muscles of M2.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from mapmore_cli.annexes.rig.antagonists import Antagonists
from mapmore_cli.annexes.rig.load_cycle import ContractionTable, LoadCycles, Perturbations
from mapmore_cli.annexes.rig.muscle import Hysteresis
from mapmore_cli.annexes.rig.random_velocity import RandomVelocity
from mapmore_cli.annexes.rig.sensors import Sensor
from mapmore_cli.annexes.rig.static_muscles import McKibben, Peano
from mapmore_cli.annexes.rig.step_response import StepResponses
from mapmore_cli.annexes.rig.waveform import Waveforms
from mapmore_cli.domain.declared import Name
from mapmore_cli.spec.fields import Section


class Sensors(Section):
    """What the logger sees."""

    pressure: Sensor  # kPa
    strain: Sensor | None = None
    force: Sensor | None = None  # N
    flow: Sensor | None = None  # L/min; of the wet experiments
    muscle_pressure: Sensor | None = None  # kPa; of the wet experiments
    displacement: Sensor | None = None  # mm; of waveforms
    load: Sensor | None = None  # N; of waveforms
    length: Sensor | None = None  # mm of elongation; of random velocity and antagonists
    velocity: Sensor | None = None  # mm/s; of random velocity and antagonists


SENSED: dict[str, set[str]] = {
    "load_cycles": {"pressure", "strain", "force"},
    **{
        kind: {"pressure", "strain", "force", "flow", "muscle_pressure"}
        for kind in ("step_responses", "perturbation")
    },
    "waveforms": {"pressure", "displacement", "load"},
    "contraction_table": {"pressure", "strain"},
    **{
        kind: {"pressure", "length", "velocity", "force"}
        for kind in ("random_velocity", "antagonists")
    },
}
"""What each experiment measures."""


Experiment = (
    LoadCycles
    | StepResponses
    | Perturbations
    | Waveforms
    | ContractionTable
    | RandomVelocity
    | Antagonists
)


class SimulationSpec(Section):
    """One synthetic campaign; `mapmore simulate` writes `<output>_<pressure>.csv` for each pressure
    (or waveform) beside the spec.
    """

    schema_version: Literal[1] = 1
    name: Name
    muscle: Annotated[McKibben | Peano, Field(discriminator="kind")]
    hysteresis: Hysteresis
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
        if isinstance(self.experiment, Waveforms | RandomVelocity | Antagonists) and not isinstance(
            self.muscle, McKibben
        ):
            yield ValueError(f"`type: {kind}` moves a muscle of `kind: mckibben`")
