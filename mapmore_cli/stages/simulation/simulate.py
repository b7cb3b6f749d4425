"""`mapmore simulate`: runs a synthetic rig and writes what its logger would have written.

The same spec gives the same bytes on one machine; on another, a value may round to the neighbouring quantisation step.
"""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from pathlib import Path

import numpy as np

from mapmore_cli.domain.arrays import Columns
from mapmore_cli.rig.load_cycle import load_cycle
from mapmore_cli.rig.perturbation import perturbation
from mapmore_cli.rig.sensors import Sensor, measure, recording_generator
from mapmore_cli.rig.step_response import step_response
from mapmore_cli.rig.waveform import waveform_response
from mapmore_cli.spec.simulated_experiments import LoadCycles, Perturbations, StepResponses, pressure_label
from mapmore_cli.spec.simulation import McKibbenMuscle, SensorSpec, SimulationSpec
from mapmore_cli.spec.waveform_rig import Waveforms, WaveformSpec
from mapmore_cli.stages.pipeline.stage import Progress
from mapmore_cli.stages.simulation.rig_parts import (
    KPA,
    hysteresis_of,
    load_cycle_of,
    muscle_of,
    step_rig_of,
    strokes_of,
    waveform_of,
    waveform_rig_of,
    wet_muscle_of,
)
from mapmore_cli.storage.atomic import refusals_told, write_text

UNITS = {"pressure": KPA, "muscle_pressure": KPA, "flow": 1e-3 / 60.0, "displacement": 1e-3}
"""Of the recordings, in SI units: kPa, L/min, mm; the other columns have the rig's own."""

HEADER = {
    "time": "t",
    "input": "U",
    "pressure": "P",
    "strain": "eps",
    "force": "F",
    "flow": "Q",
    "muscle_pressure": "Pm",
    "displacement": "x",
    "load": "W",
}
"""Column of the file for each quantity: s, V, kPa, 1, N, L/min, kPa, mm, N."""

INPUT_STEP = 0.001
"""Of the commanded input in the files, V."""

Cause = float | WaveformSpec
"""What tells one recording of a simulation from another: its pressure (kPa), or its waveform."""


def simulate(spec: SimulationSpec, folder: Path, progress: Progress) -> list[Path]:
    """Write one recording for each pressure or waveform into `folder` (made where missing); return their paths, in the order of the spec.

    Raises `WriteError` where a file cannot be written; files are replaced whole.
    """
    causes = causes_of(spec)
    paths = []
    with refusals_told(folder):
        folder.mkdir(parents=True, exist_ok=True)
    for done, cause in enumerate(causes, start=1):
        text = csv_text(recording(spec, cause), decimals(spec))
        path = folder / f"{spec.output}_{label(cause)}.csv"
        write_text(path, text)
        paths.append(path)
        progress("simulate", done, len(causes))
    return paths


def causes_of(spec: SimulationSpec) -> list[Cause]:
    """One for each recording."""
    experiment = spec.experiment
    return [*experiment.waveforms] if isinstance(experiment, Waveforms) else [*experiment.pressures]


def label(cause: Cause) -> str:
    """Name of a recording within its file's name."""
    return cause.name if isinstance(cause, WaveformSpec) else pressure_label(cause)


def recording(spec: SimulationSpec, cause: Cause) -> Columns:
    """Readings, each `(n,)`, by the names and in the units of `HEADER`: those that the experiment measures."""
    rng = recording_generator(spec.seed, f"waveform={cause.name}" if isinstance(cause, WaveformSpec) else f"pressure={cause:g}")
    in_units = {name: values / UNITS.get(name, 1.0) for name, values in truth(spec, cause, rng).items()}
    return measure(in_units, {name: Sensor(sensor.noise, sensor.resolution) for name, sensor in sensors(spec).items()}, rng)


def truth(spec: SimulationSpec, cause: Cause, rng: np.random.Generator) -> Columns:
    """What happens in the spec's experiment, in SI units."""
    match spec.experiment, spec.muscle, cause:
        case Waveforms() as experiment, McKibbenMuscle() as muscle, WaveformSpec() as waveform:
            hanging = waveform_rig_of(muscle, spec.hysteresis, experiment)
            return waveform_response(hanging, waveform_of(experiment, waveform), waveform.load)
        case LoadCycles() as experiment, muscle, float(pressure):
            cycle, regulation = load_cycle_of(experiment)
            return load_cycle(muscle_of(muscle), hysteresis_of(spec.hysteresis), cycle, regulation, pressure * KPA, rng)
        case StepResponses() as experiment, _, float(pressure):
            rig, times = step_rig_of(spec, experiment)
            weight = next(step.weight for step in experiment.steps if step.pressure == pressure)
            return step_response(rig, times, pressure * KPA, weight)
        case Perturbations() as experiment, _, float(pressure):
            wet = wet_muscle_of(spec, experiment.rig)
            return perturbation(wet, strokes_of(experiment), pressure * KPA, experiment.rig.load_cell)
    raise ValueError(f"{spec.experiment.type} has no recording of {cause}")


def sensors(spec: SimulationSpec) -> dict[str, SensorSpec]:
    """The sensors that the experiment has, by quantity."""
    return {name: sensor for name, sensor in spec.sensors if sensor is not None}


def decimals(spec: SimulationSpec) -> dict[str, int]:
    """Digits after the point that each column needs: those of its quantisation step, none more."""
    commanded = {"input": INPUT_STEP} if isinstance(spec.experiment, Waveforms) else {}
    steps = {"time": spec.experiment.sample_time, **commanded, **{name: sensor.resolution for name, sensor in sensors(spec).items()}}
    return {name: _digits(step) for name, step in steps.items()}


def _digits(step: float) -> int:
    exponent = Decimal(repr(step)).normalize().as_tuple().exponent
    return max(0, -int(exponent))


def csv_text(columns: Columns, digits: Mapping[str, int]) -> str:
    """The file: a header, and a line for each sample."""
    names = [name for name in HEADER if name in columns]
    formatted = [[f"{value:.{digits[name]}f}" for value in columns[name]] for name in names]
    lines = [",".join(HEADER[name] for name in names), *map(",".join, zip(*formatted, strict=True))]
    return "\n".join(lines) + "\n"
