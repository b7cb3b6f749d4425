"""`mapmore simulate`: runs a synthetic rig and writes what its logger would have written.

The same spec gives the same bytes on one machine; on another, a value may round to the neighbouring quantisation step.
"""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from importlib.resources import files
from pathlib import Path

import numpy as np

from mapmore_cli.domain.arrays import Columns
from mapmore_cli.domain.declared import taken
from mapmore_cli.domain.errors import WriteError
from mapmore_cli.fitting.stage import Progress
from mapmore_cli.rig.air import Air, ClosedMuscle, Regulator
from mapmore_cli.rig.antagonists import Joint, Swing, driven, sines, swung
from mapmore_cli.rig.load_cycle import LoadCycle, Loading, Regulation, Strokes, contraction_table, load_cycle, perturbation
from mapmore_cli.rig.muscle import Hysteresis, Muscle
from mapmore_cli.rig.random_velocity import Course, RandomMotion, random_velocity
from mapmore_cli.rig.sensors import Sensor, measure, recording_generator
from mapmore_cli.rig.static_muscles import McKibben, Peano
from mapmore_cli.rig.step_response import StepRig, StepTimes, step_response
from mapmore_cli.rig.water import Plumbing, WetMuscle
from mapmore_cli.rig.waveform import Waveform, WaveformRig, waveform_response
from mapmore_cli.spec.fields import Section
from mapmore_cli.spec.loader import load_as
from mapmore_cli.spec.simulation import (
    Antagonists,
    ContractionTable,
    HysteresisSpec,
    LoadCycles,
    McKibbenMuscle,
    PeanoMuscle,
    Perturbations,
    RandomVelocity,
    RegulatorSpec,
    RestLength,
    SensorSpec,
    SimulationSpec,
    StepResponses,
    WaterRig,
    Waveforms,
    WaveformSpec,
    pressure_label,
)
from mapmore_cli.spec.simulation import Course as CourseSpec
from mapmore_cli.storage.atomic import refusals_told, write_text

KPA = 1e3
"""Pa; the rig computes in Pa, specs and recordings say kPa."""


def _in_pascal(settings: Section, *names: str) -> dict[str, float]:
    """Return pressures of a spec, which are in kPa, in Pa."""
    return {name: getattr(settings, name) * KPA for name in names}


def muscle_of(muscle: McKibbenMuscle | PeanoMuscle) -> Muscle:
    """Return the muscle."""
    if isinstance(muscle, McKibbenMuscle):
        return braid_of(muscle)
    return taken(Peano, muscle, **_in_pascal(muscle, "threshold", "threshold_width"))


def braid_of(muscle: McKibbenMuscle) -> McKibben:
    """Return the braid and its rubber."""
    pressures = _in_pascal(muscle, "c10", "c01", "threshold", "threshold_width", "crimp_pressure")
    return taken(McKibben, muscle, radius=0.5 * muscle.diameter, braid_angle=float(np.deg2rad(muscle.braid_angle)), **pressures)


def hysteresis_of(hysteresis: HysteresisSpec) -> Hysteresis:
    """Its friction."""
    return Hysteresis(
        base=hysteresis.base,
        per_pressure=hysteresis.per_pressure / KPA,
        yield_strains=np.array([stop.yield_strain for stop in hysteresis.stops]),
        shares=np.array([stop.share for stop in hysteresis.stops]),
    )


def load_cycle_of(experiment: LoadCycles) -> tuple[LoadCycle, Regulation]:
    """Return the slow cycle and its regulator."""
    return taken(LoadCycle, experiment, turns=tuple(experiment.turns)), experiment.regulation


def wet_muscle_of(spec: SimulationSpec, rig: WaterRig) -> WetMuscle:
    """Return the muscle at the end of its water line."""
    return WetMuscle(muscle_of(spec.muscle), hysteresis_of(spec.hysteresis), rig.rubber, rig.wall, taken(Plumbing, rig))


def step_rig_of(spec: SimulationSpec, experiment: StepResponses) -> tuple[StepRig, StepTimes]:
    """Return the rig of the step responses, and when its valve is switched."""
    rig = taken(StepRig, experiment, muscle=wet_muscle_of(spec, experiment.rig), load_cell=experiment.rig.load_cell)
    return rig, taken(StepTimes, experiment)


def strokes_of(experiment: Perturbations) -> Strokes:
    """Return the actuator's moves."""
    stretched, contracted = experiment.between
    return Strokes(stretched, contracted, tuple(experiment.moves), experiment.dwell, experiment.sample_time)


def waveform_rig_of(muscle: McKibbenMuscle, hysteresis: HysteresisSpec, experiment: Waveforms) -> WaveformRig:
    """Return the muscle that hangs behind a regulator."""
    air = Air(experiment.polytropic, np.inf, experiment.dead_volume)
    filled = ClosedMuscle(braid_of(muscle), hysteresis_of(hysteresis), experiment.rubber, air)
    return WaveformRig(filled, regulator_of(experiment.regulator), experiment.end_mass)


def regulator_of(regulator: RegulatorSpec) -> Regulator:
    """Return the regulator."""
    return taken(Regulator, regulator, **_in_pascal(regulator, "slope", "offset", "band", "supply"))


def waveform_of(experiment: Waveforms, waveform: WaveformSpec) -> Waveform:
    """Return the input of one recording."""
    return taken(Waveform, waveform, rest=experiment.rest, rest_input=waveform.rest_at, sample_time=experiment.sample_time)


def loading_of(experiment: ContractionTable) -> Loading:
    """Return the weights of a table of contractions."""
    return Loading(tuple(experiment.masses), experiment.regulator_error * KPA)


def closed_muscle_of(muscle: McKibbenMuscle, hysteresis: HysteresisSpec, experiment: RandomVelocity | Antagonists) -> ClosedMuscle:
    """Return a muscle full of air."""
    return ClosedMuscle(braid_of(muscle), hysteresis_of(hysteresis), experiment.rubber, experiment.air)


def random_motion_of(experiment: RandomVelocity) -> RandomMotion:
    """Return what the motor does."""
    valves = experiment.valves
    driven = {} if valves is None else {"regulator": regulator_of(valves.regulator), "course": course_of(valves.course)}
    return taken(RandomMotion, experiment, rest=_rest_of(experiment.rest), **driven)


def course_of(course: CourseSpec) -> Course:
    """Return the random moves of a wanted pressure."""
    return Course((course.between[0] * KPA, course.between[1] * KPA), course.pace)


def joint_of(flexor: McKibbenMuscle, hysteresis: HysteresisSpec, experiment: Antagonists) -> tuple[Joint, Swing]:
    """Return the joint, and its sine."""
    muscles = (closed_muscle_of(flexor, hysteresis, experiment), closed_muscle_of(experiment.extensor, hysteresis, experiment))
    upright = (experiment.pressure * KPA, experiment.taut)
    return taken(Joint, experiment, muscles=muscles, rest=_rest_of(experiment.rest), upright=upright), taken(Swing, experiment)


def _rest_of(rest: RestLength) -> tuple[float, float]:
    return rest.pressure * KPA, rest.force


UNITS = {"pressure": KPA, "muscle_pressure": KPA, "flow": 1e-3 / 60.0, "displacement": 1e-3, "length": 1e-3, "velocity": 1e-3}
"""Of the recordings, in SI units: kPa, L/min, mm, mm/s; the other columns have the rig's own."""

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
    "length": "l",
    "velocity": "v",
}
"""Column of the file for each quantity: s, V, kPa, 1, N, L/min, kPa, mm, N, mm, mm/s; of two muscles, `P_1` is the first one's."""

SET_STEPS = {
    **{kind: {"input": 0.001} for kind in ("waveforms", "random_velocity", "antagonists")},
    "contraction_table": {"force": 0.001},
}
"""Steps in the files of what is set and not measured: V, N."""

Cause = float | WaveformSpec | str
"""What tells one recording of a simulation from another: its pressure (kPa), its waveform, or a name."""


def simulate(spec: SimulationSpec, folder: Path, progress: Progress, force: bool = False) -> list[Path]:
    """Write one recording for each pressure or waveform into `folder` (made where missing); return their paths, in the order of the spec.

    Raises `WriteError` where a file cannot be written, or exists and is not to be replaced by `force`; files are replaced whole.
    """
    causes = causes_of(spec)
    paths = [folder / f"{spec.output}_{label(cause)}.csv" for cause in causes]
    standing = [path for path in paths if path.is_file()]
    if standing and not force:
        raise WriteError(f"{standing[0]}: exists already", "write elsewhere with -o, or replace it with --force")
    with refusals_told(folder):
        folder.mkdir(parents=True, exist_ok=True)
    for done, (cause, path) in enumerate(zip(causes, paths, strict=True), start=1):
        write_text(path, csv_text(recording(spec, cause), decimals(spec)))
        progress("simulate", done, len(causes))
    return paths


def causes_of(spec: SimulationSpec) -> list[Cause]:
    """Return one cause for each recording."""
    experiment = spec.experiment
    if isinstance(experiment, Waveforms):
        return [*experiment.waveforms]
    return [*(experiment.recordings if isinstance(experiment, Antagonists) else experiment.pressures)]


def label(cause: Cause) -> str:
    """Name of a recording within its file's name."""
    if isinstance(cause, WaveformSpec):
        return cause.name
    return cause if isinstance(cause, str) else pressure_label(cause)


def recording(spec: SimulationSpec, cause: Cause) -> Columns:
    """Return readings, each `(n,)`, by the names and in the units of `HEADER`: those that the experiment measures."""
    rng = recording_generator(spec.seed, f"pressure={cause:g}" if isinstance(cause, float) else f"waveform={label(cause)}")
    repeats = spec.experiment.repeats if isinstance(spec.experiment, ContractionTable) else 1
    read = [_readings(spec, cause, rng) for _ in range(repeats)]
    return {name: np.mean([one[name] for one in read], axis=0) for name in read[0]} if repeats > 1 else read[0]


def _readings(spec: SimulationSpec, cause: Cause, rng: np.random.Generator) -> Columns:
    in_units = {name: values / UNITS.get(quantity(name), 1.0) for name, values in truth(spec, cause, rng).items()}
    seen = {name: Sensor(sensor.noise, sensor.resolution) for name, sensor in sensors(spec).items()}
    return measure(in_units, {name: seen[quantity(name)] for name in in_units if quantity(name) in seen}, rng)


def quantity(name: str) -> str:
    """Return the quantity of a column: `pressure` of `pressure_2`, which is the second muscle's."""
    return name.removesuffix("_1").removesuffix("_2")


def truth(spec: SimulationSpec, cause: Cause, rng: np.random.Generator) -> Columns:
    """Return what happens in the spec's experiment, in SI units."""
    match spec.experiment, spec.muscle, cause:
        case Waveforms() as experiment, McKibbenMuscle() as muscle, WaveformSpec() as waveform:
            hanging = waveform_rig_of(muscle, spec.hysteresis, experiment)
            return waveform_response(hanging, waveform_of(experiment, waveform), waveform.load)
        case ContractionTable() as experiment, muscle, float(pressure):
            return contraction_table(muscle_of(muscle), hysteresis_of(spec.hysteresis), loading_of(experiment), pressure * KPA, rng)
        case RandomVelocity() as experiment, McKibbenMuscle() as muscle, float(pressure):
            closed = closed_muscle_of(muscle, spec.hysteresis, experiment)
            return random_velocity(closed, random_motion_of(experiment), pressure * KPA, rng)
        case Antagonists() as experiment, McKibbenMuscle() as flexor, str(name):
            joint, swing = joint_of(flexor, spec.hysteresis, experiment)
            if name == "closed":
                return swung(joint, swing, experiment.amplitude, experiment.pressure * KPA)
            asked = sines(swing, experiment.pressures[0] * KPA, experiment.pressures[1] * KPA)
            if name == "random" and experiment.course is not None:
                course = course_of(experiment.course)
                first, second = (course.drawn(joint.upright[0], experiment.duration, own) for own in rng.spawn(2))
                asked = lambda time: float(first(time)), lambda time: float(second(time))
            return driven(joint, swing, regulator_of(experiment.regulator), asked)
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
    """Return the sensors that the experiment has, by quantity."""
    return {name: sensor for name, sensor in spec.sensors if sensor is not None}


def decimals(spec: SimulationSpec) -> dict[str, int]:
    """Digits after the point that each column needs: those of its quantisation step, none more."""
    clock = {} if isinstance(spec.experiment, ContractionTable) else {"time": spec.experiment.sample_time}
    steps = {**clock, **SET_STEPS.get(spec.experiment.type, {}), **{name: sensor.resolution for name, sensor in sensors(spec).items()}}
    return {name: _digits(step) for name, step in steps.items()}


def _digits(step: float) -> int:
    exponent = Decimal(repr(step)).normalize().as_tuple().exponent
    return max(0, -int(exponent))


def csv_text(columns: Columns, digits: Mapping[str, int]) -> str:
    """Return the file: a header, and a line for each sample."""
    names = [name for number in ("", "_1", "_2") for name in (f"{of}{number}" for of in HEADER) if name in columns]
    formatted = [[f"{value:.{digits[quantity(name)]}f}" for value in columns[name]] for name in names]
    header = [HEADER[quantity(name)] + name.removeprefix(quantity(name)) for name in names]
    lines = [",".join(header), *map(",".join, zip(*formatted, strict=True))]
    return "\n".join(lines) + "\n"


SPECS = ("rig.yaml", "study.yaml")
STUDY = "study.yaml"


def write_example(folder: Path, progress: Progress) -> list[Path]:
    """Write the study, the rig and its simulated recordings into a folder, which is made where missing; their paths, the study first.

    Raises WriteError where the folder is not empty, or cannot be written.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise WriteError(f"{folder}: is not an empty folder", "name a new folder")
    with refusals_told(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name in SPECS:
            write_text(folder / name, files("mapmore_cli.study.simulation").joinpath("example_study", name).read_text(encoding="utf-8"))
    recordings = simulate(load_as(folder / "rig.yaml", SimulationSpec, ()).spec, folder, progress)
    return [folder / STUDY, folder / "rig.yaml", *recordings]
