"""From the spec of a simulation to the rig's parts, in SI units."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.declared import taken
from mapmore_cli.rig.antagonists import Joint, Swing
from mapmore_cli.rig.chamber import Braid, Chamber, Peano, Tubes
from mapmore_cli.rig.closed_muscle import ClosedMuscle, RandomMotion
from mapmore_cli.rig.load_cycle import LoadCycle, Loading, Regulation, Strokes
from mapmore_cli.rig.mckibben import McKibben
from mapmore_cli.rig.muscle import Hysteresis, StaticMuscle
from mapmore_cli.rig.step_response import StepRig, StepTimes
from mapmore_cli.rig.waveform import Regulator, Waveform, WaveformRig
from mapmore_cli.rig.wet_muscle import Plumbing, WetMuscle
from mapmore_cli.spec.fields import Section
from mapmore_cli.spec.muscle_rigs import Antagonists, ContractionTable, McKibbenMuscle, PeanoMuscle, RandomVelocity, RestLength
from mapmore_cli.spec.simulated_experiments import (
    LoadCycles,
    Perturbations,
    RegulatorSpec,
    StepResponses,
    WaterRig,
    Waveforms,
    WaveformSpec,
)
from mapmore_cli.spec.simulation import HysteresisSpec, SimulationSpec

KPA = 1e3
"""Pa; the rig computes in Pa, specs and recordings say kPa."""


def _in_pascal(settings: Section, *names: str) -> dict[str, float]:
    """Return pressures of a spec, which are in kPa, in Pa."""
    return {name: getattr(settings, name) * KPA for name in names}


def muscle_of(muscle: McKibbenMuscle | PeanoMuscle) -> StaticMuscle:
    """Return the muscle at rest."""
    return braid_of(muscle) if isinstance(muscle, McKibbenMuscle) else tube_of(muscle)


def chamber_of(muscle: McKibbenMuscle | PeanoMuscle) -> Chamber:
    """Return the same muscle, full of water."""
    return Braid(braid_of(muscle)) if isinstance(muscle, McKibbenMuscle) else Tubes(tube_of(muscle), muscle.tubes)


def tube_of(muscle: PeanoMuscle) -> Peano:
    """One tube."""
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
    return WetMuscle(chamber_of(spec.muscle), hysteresis_of(spec.hysteresis), rig.rubber, rig.wall, taken(Plumbing, rig))


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
    parts = {"hysteresis": hysteresis_of(hysteresis), "regulator": regulator_of(experiment.regulator)}
    return taken(WaveformRig, experiment, muscle=braid_of(muscle), **parts)


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
    return taken(RandomMotion, experiment, rest=_rest_of(experiment.rest))


def joint_of(flexor: McKibbenMuscle, hysteresis: HysteresisSpec, experiment: Antagonists) -> tuple[Joint, Swing]:
    """Return the joint, and its sine."""
    muscles = (closed_muscle_of(flexor, hysteresis, experiment), closed_muscle_of(experiment.extensor, hysteresis, experiment))
    upright = (experiment.pressure * KPA, experiment.taut)
    return taken(Joint, experiment, muscles=muscles, rest=_rest_of(experiment.rest), upright=upright), taken(Swing, experiment)


def _rest_of(rest: RestLength) -> tuple[float, float]:
    return rest.pressure * KPA, rest.force
