"""Run a synthetic rig and write what its logger would have written.

A simulation says which muscle, on which rig, seen through which sensors. Numbers in its file are in
the units of the recordings: kPa, N, kg, m, s, strain as a fraction; angles in degrees. The same
spec gives the same bytes on one machine; on another, a value may round to the neighbouring
quantisation step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from datasets.rig.air import ClosedMuscle
from datasets.rig.antagonists import Antagonists, Joint, driven, swung
from datasets.rig.load_cycle import (
    ContractionTable,
    LoadCycles,
    Perturbations,
    contraction_table,
    load_cycle,
    perturbation,
)
from datasets.rig.muscle import Hysteresis
from datasets.rig.random_velocity import RandomVelocity, random_velocity
from datasets.rig.sensors import (
    Sensor,
    measure,
    pressure_label,
    quantity,
    recording_generator,
)
from datasets.rig.static_muscles import McKibben, Peano
from datasets.rig.step_response import (
    PressureStep,
    StepResponses,
    step_response,
)
from datasets.rig.water import WetMuscle
from datasets.rig.waveform import Waveform, Waveforms, waveform_response
from mapmore_cli.domain.arrays import Columns
from mapmore_cli.domain.declared import Name
from mapmore_cli.domain.errors import WriteError
from mapmore_cli.fitting.stage import Progress
from mapmore_cli.storage.atomic import refusals_told
from mapmore_cli.storage.outputs import write_text
from mapmore_cli.study.fields import Row, Section

KPA = 1e3  # Pa

COLUMNS = {
    "time": ("t", 1.0),
    "input": ("U", 1.0),
    "pressure": ("P", KPA),
    "strain": ("eps", 1.0),
    "force": ("F", 1.0),
    "flow": ("Q", 1e-3 / 60.0),
    "muscle_pressure": ("Pm", KPA),
    "displacement": ("x", 1e-3),
    "load": ("W", 1.0),
    "length": ("l", 1e-3),
    "velocity": ("v", 1e-3),
}
"""Title of each quantity in the file, and its unit there in units of the rig: s, V, kPa, 1, N,
L/min, kPa, mm, N, mm, mm/s. Of two muscles, `P_1` is the first one's.
"""

SET_STEPS = {
    **{kind: {"input": 0.001} for kind in ("waveforms", "random_velocity", "antagonists")},
    "contraction_table": {"force": 0.001},
}
"""Steps in the files of what is set and not measured: V, N."""

# What a file may say
# --------------------------------------------------------------------------------------------------


WET = ("pressure", "strain", "force", "flow", "muscle_pressure")
MOVED = ("pressure", "length", "velocity", "force")
SENSED: Mapping[str, Sequence[str]] = {
    "load_cycles": ("pressure", "strain", "force"),
    "step_responses": WET,
    "perturbation": WET,
    "waveforms": ("pressure", "displacement", "load"),
    "contraction_table": ("pressure", "strain"),
    "random_velocity": MOVED,
    "antagonists": MOVED,
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
    """One synthetic campaign: `python -m datasets.rig SPEC` writes `<output>_<pressure>.csv` for
    each pressure (or waveform) beside the spec.
    """

    schema_version: Literal[1] = 1
    name: Name
    muscle: Annotated[McKibben | Peano, Field(discriminator="kind")]
    hysteresis: Hysteresis
    experiment: Annotated[Experiment, Field(discriminator="type")]
    sensors: dict[str, Sensor]
    seed: Annotated[int, Field(ge=0)]
    output: Name

    def _contradictions(self) -> Sequence[Row]:
        kind, moved = self.experiment.type, Waveforms | RandomVelocity | Antagonists
        measured = ", ".join(SENSED[kind])
        return [
            (
                {*self.sensors} != {*SENSED[kind]},
                f"`type: {kind}` needs `sensors` of these, and no others: {measured}",
                "add those that are missing, and remove others",
                "sensors",
            ),
            (
                isinstance(self.experiment, moved) and not isinstance(self.muscle, McKibben),
                f"`type: {kind}` moves a muscle of `kind: mckibben`",
                "simulate a McKibben muscle, or another experiment",
                "muscle",
            ),
        ]


# Recordings
# --------------------------------------------------------------------------------------------------

Cause = float | PressureStep | Waveform | str
"""What tells one recording of a simulation from another: its pressure (Pa), its step or waveform,
or a name.
"""


def simulate(
    spec: SimulationSpec, folder: Path, progress: Progress, force: bool = False
) -> list[Path]:
    """Write one recording for each pressure or waveform into `folder` (made where missing); return
    their paths, in the order of the spec.

    Raises `WriteError` where a file cannot be written, or exists and is not to be replaced by
    `force`; files are replaced whole.
    """
    causes = causes_of(spec)
    paths = [folder / f"{spec.output}_{label(cause)}.csv" for cause in causes]
    standing = [path for path in paths if path.is_file()]
    if standing and not force:
        raise WriteError(
            f"{standing[0]}: exists already", "write elsewhere with -o, or replace it with --force"
        )
    with refusals_told(folder):
        folder.mkdir(parents=True, exist_ok=True)
    for done, (cause, path) in enumerate(zip(causes, paths, strict=True), start=1):
        write_text(path, csv_text(recording(spec, cause), decimals(spec)))
        progress("simulate", done, len(causes))
    return paths


def causes_of(spec: SimulationSpec) -> list[Cause]:
    """Return one cause for each recording."""
    match spec.experiment:
        case (
            Waveforms(waveforms=causes)
            | StepResponses(steps=causes)
            | Antagonists(recordings=causes)
        ):
            return [*causes]
        case experiment:
            return [*experiment.pressures]


def label(cause: Cause) -> str:
    """Name of a recording within its file's name."""
    match cause:
        case Waveform(name=name) | str(name):
            return name
        case PressureStep(pressure=pressure) | pressure:
            return pressure_label(pressure)


def recording(spec: SimulationSpec, cause: Cause) -> Columns:
    """Return readings, each `(n,)`, by the names and in the units of `COLUMNS`: those that the
    experiment measures.
    """
    pressure = cause.pressure if isinstance(cause, PressureStep) else cause
    name = (
        f"pressure={pressure / KPA:g}"
        if isinstance(pressure, float)
        else f"waveform={label(cause)}"
    )
    rng, read = recording_generator(spec.seed, name), list[Columns]()
    for _ in range(spec.experiment.repeats if isinstance(spec.experiment, ContractionTable) else 1):
        happened = truth(spec, cause, rng).items()
        in_units = {one: values / COLUMNS[quantity(one)][1] for one, values in happened}
        read.append(measure(in_units, spec.sensors, rng))
    return {one: np.mean([each[one] for each in read], axis=0) for one in read[0]}


def truth(spec: SimulationSpec, cause: Cause, rng: np.random.Generator) -> Columns:
    """Return what happens in the spec's experiment, in SI units."""
    muscle, friction = spec.muscle, spec.hysteresis
    match spec.experiment, muscle, cause:
        case LoadCycles() as cycle, _, float(pressure):
            return load_cycle(muscle, friction, cycle, pressure, rng)
        case ContractionTable() as table, _, float(pressure):
            return contraction_table(muscle, friction, table, pressure, rng)
        case StepResponses(rig=rig) as setup, _, PressureStep() as step:
            return step_response(setup, WetMuscle(muscle, friction, rig.rubber, rig), step)
        case Perturbations(rig=rig) as strokes, _, float(pressure):
            return perturbation(WetMuscle(muscle, friction, rig.rubber, rig), strokes, pressure)
        case Waveforms() as setup, McKibben() as braid, Waveform() as waveform:
            return waveform_response(setup, setup.hung(braid, friction), waveform)
        case RandomVelocity(rubber=rubber, air=air) as motion, McKibben() as braid, float(pressure):
            return random_velocity(
                ClosedMuscle(braid, friction, rubber, air), motion, pressure, rng
            )
        case Antagonists() as setup, McKibben() as flexor, str(name):
            joint = Joint(flexor, friction, setup)
            return swung(joint) if name == "closed" else driven(joint, setup.asked(name, rng))
    raise ValueError(f"{spec.experiment.type} has no recording of {cause}")


def decimals(spec: SimulationSpec) -> dict[str, int]:
    """Digits after the point that each column needs: those of its quantisation step, none more."""
    clock = (
        {}
        if isinstance(spec.experiment, ContractionTable)
        else {"time": spec.experiment.sample_time}
    )
    steps = {
        **clock,
        **SET_STEPS.get(spec.experiment.type, {}),
        **{name: sensor.resolution for name, sensor in spec.sensors.items()},
    }
    exponents = {
        name: Decimal(repr(step)).normalize().as_tuple().exponent for name, step in steps.items()
    }
    return {name: max(0, -int(exponent)) for name, exponent in exponents.items()}


def csv_text(columns: Columns, digits: Mapping[str, int]) -> str:
    """Return the file: a header, and a line for each sample."""
    names = [f"{of}{number}" for number in ("", "_1", "_2") for of in COLUMNS]
    names = [name for name in names if name in columns]
    formatted = [
        [f"{value:.{digits[quantity(name)]}f}" for value in columns[name]] for name in names
    ]
    header = [name.replace(quantity(name), COLUMNS[quantity(name)][0], 1) for name in names]
    lines = map(",".join, [header, *zip(*formatted, strict=True)])
    return "\n".join([*lines, ""])
