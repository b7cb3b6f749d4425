"""`mapmore simulate`: runs a synthetic rig and writes what its logger would have written.

The same spec gives the same bytes on one machine; on another, a value may round to the neighbouring quantisation step.
"""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from pathlib import Path

import numpy as np

from mapmore_cli.domain.arrays import Columns
from mapmore_cli.rig.hysteresis import Hysteresis
from mapmore_cli.rig.load_cycle import LoadCycle, Regulation, load_cycle, measure
from mapmore_cli.rig.mckibben import McKibben
from mapmore_cli.rig.muscle import StaticMuscle
from mapmore_cli.rig.peano import Peano
from mapmore_cli.rig.sensors import Sensor, recording_generator
from mapmore_cli.spec.simulation import HysteresisSpec, McKibbenMuscle, PeanoMuscle, SimulationSpec, pressure_label
from mapmore_cli.stages.stage import Progress
from mapmore_cli.storage.atomic import refusals_told, write_text

KPA = 1e3
"""Pa; the rig computes in Pa, specs and recordings say kPa."""

HEADER = {"time": "t", "pressure": "P", "strain": "eps", "force": "F"}
"""Column of the file for each quantity: s, kPa, 1, N."""


def simulate(spec: SimulationSpec, folder: Path, progress: Progress) -> list[Path]:
    """Write one recording for each pressure into `folder` (made where missing) and return their paths, in the order of the spec.

    Raises `WriteError` where a file cannot be written; files are replaced whole.
    """
    pressures = spec.experiment.pressures
    paths = []
    with refusals_told(folder):
        folder.mkdir(parents=True, exist_ok=True)
    for done, pressure in enumerate(pressures, start=1):
        text = csv_text(recording(spec, pressure), decimals(spec))
        path = folder / f"{spec.output}_{pressure_label(pressure)}.csv"
        write_text(path, text)
        paths.append(path)
        progress("simulate", done, len(pressures))
    return paths


def recording(spec: SimulationSpec, pressure: float) -> Columns:
    """Readings of one load cycle at `pressure` (kPa): time s, pressure kPa, strain, force N, each `(n,)`."""
    experiment = spec.experiment
    cycle = LoadCycle(experiment.duration, experiment.sample_time, experiment.dwell, experiment.least_stroke)
    regulation = Regulation(experiment.regulation.ripple, experiment.regulation.correlation_time)
    rng = recording_generator(spec.seed, f"pressure={pressure:g}")
    truth = load_cycle(muscle_of(spec.muscle), hysteresis_of(spec.hysteresis), cycle, regulation, pressure * KPA, rng)
    in_kpa = {**truth, "pressure": truth["pressure"] / KPA}
    sensors = {name: Sensor(sensor.noise, sensor.resolution) for name, sensor in spec.sensors}
    return measure(in_kpa, sensors, rng)


def muscle_of(muscle: McKibbenMuscle | PeanoMuscle) -> StaticMuscle:
    """The rig's muscle, in SI units."""
    if isinstance(muscle, PeanoMuscle):
        return Peano(
            tube_width=muscle.tube_width,
            tube_length=muscle.tube_length,
            end_loss=muscle.end_loss,
            stiffness=muscle.stiffness,
            bending=muscle.bending,
            threshold=muscle.threshold * KPA,
            threshold_width=muscle.threshold_width * KPA,
        )
    return McKibben(
        length=muscle.length,
        radius=0.5 * muscle.diameter,
        braid_angle=float(np.deg2rad(muscle.braid_angle)),
        taper=muscle.taper,
        wall=muscle.wall,
        c10=muscle.c10 * KPA,
        c01=muscle.c01 * KPA,
        threshold=muscle.threshold * KPA,
        threshold_width=muscle.threshold_width * KPA,
        crimp_force=muscle.crimp_force,
        crimp_pressure=muscle.crimp_pressure * KPA,
        crimp_strain=muscle.crimp_strain,
        crimp_exponent=muscle.crimp_exponent,
        stretch_stiffness=muscle.stretch_stiffness,
        stretch_strain=muscle.stretch_strain,
    )


def hysteresis_of(hysteresis: HysteresisSpec) -> Hysteresis:
    """The rig's friction, in SI units."""
    return Hysteresis(
        base=hysteresis.base,
        per_pressure=hysteresis.per_pressure / KPA,
        yield_strains=np.array([stop.yield_strain for stop in hysteresis.stops]),
        shares=np.array([stop.share for stop in hysteresis.stops]),
    )


def decimals(spec: SimulationSpec) -> dict[str, int]:
    """Digits after the point that each column needs: those of its quantisation step, none more."""
    steps = {"time": spec.experiment.sample_time, **{name: sensor.resolution for name, sensor in spec.sensors}}
    return {name: _digits(step) for name, step in steps.items()}


def _digits(step: float) -> int:
    exponent = Decimal(repr(step)).normalize().as_tuple().exponent
    return max(0, -int(exponent))


def csv_text(columns: Columns, digits: Mapping[str, int]) -> str:
    """The file: a header, and a line for each sample."""
    formatted = [[f"{value:.{digits[name]}f}" for value in columns[name]] for name in HEADER]
    lines = [",".join(HEADER.values()), *map(",".join, zip(*formatted, strict=True))]
    return "\n".join(lines) + "\n"
