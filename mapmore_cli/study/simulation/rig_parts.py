"""From the spec of a simulation to the rig's parts, in SI units."""

from __future__ import annotations

import numpy as np

from mapmore_cli.rig.antagonists import Joint, Swing
from mapmore_cli.rig.chamber import Braid, Chamber, Tubes
from mapmore_cli.rig.closed_muscle import ClosedMuscle, RandomMotion
from mapmore_cli.rig.load_cycle import LoadCycle, Loading, Regulation, Strokes
from mapmore_cli.rig.mckibben import McKibben
from mapmore_cli.rig.muscle import Hysteresis, StaticMuscle
from mapmore_cli.rig.peano import Peano
from mapmore_cli.rig.step_response import StepRig, StepTimes
from mapmore_cli.rig.waveform import Regulator, Waveform, WaveformRig
from mapmore_cli.rig.wet_muscle import Plumbing, WetMuscle
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


def muscle_of(muscle: McKibbenMuscle | PeanoMuscle) -> StaticMuscle:
    """The muscle at rest."""
    return braid_of(muscle) if isinstance(muscle, McKibbenMuscle) else tube_of(muscle)


def chamber_of(muscle: McKibbenMuscle | PeanoMuscle) -> Chamber:
    """The same muscle, full of water."""
    return Braid(braid_of(muscle)) if isinstance(muscle, McKibbenMuscle) else Tubes(tube_of(muscle), muscle.tubes)


def tube_of(muscle: PeanoMuscle) -> Peano:
    """One tube."""
    return Peano(
        tube_width=muscle.tube_width,
        tube_length=muscle.tube_length,
        end_loss=muscle.end_loss,
        stiffness=muscle.stiffness,
        bending=muscle.bending,
        threshold=muscle.threshold * KPA,
        threshold_width=muscle.threshold_width * KPA,
    )


def braid_of(muscle: McKibbenMuscle) -> McKibben:
    """The braid and its rubber."""
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
    """Its friction."""
    return Hysteresis(
        base=hysteresis.base,
        per_pressure=hysteresis.per_pressure / KPA,
        yield_strains=np.array([stop.yield_strain for stop in hysteresis.stops]),
        shares=np.array([stop.share for stop in hysteresis.stops]),
    )


def load_cycle_of(experiment: LoadCycles) -> tuple[LoadCycle, Regulation]:
    """The slow cycle and its regulator."""
    cycle = LoadCycle(experiment.duration, experiment.sample_time, experiment.dwell, experiment.least_stroke, tuple(experiment.turns))
    return cycle, experiment.regulation


def wet_muscle_of(spec: SimulationSpec, rig: WaterRig) -> WetMuscle:
    """The muscle at the end of its water line."""
    return WetMuscle(
        chamber=chamber_of(spec.muscle),
        hysteresis=hysteresis_of(spec.hysteresis),
        rubber=rig.rubber,
        wall=rig.wall,
        plumbing=Plumbing(
            line=rig.line,
            hose=rig.hose,
            tube=rig.tube,
            trapped_air=rig.trapped_air,
        ),
    )


def step_rig_of(spec: SimulationSpec, experiment: StepResponses) -> tuple[StepRig, StepTimes]:
    """The rig of the step responses, and when its valve is switched."""
    rig = StepRig(
        muscle=wet_muscle_of(spec, experiment.rig),
        reservoir=experiment.reservoir,
        bumper=experiment.bumper,
        load_cell=experiment.rig.load_cell,
    )
    return rig, StepTimes(experiment.rest, experiment.hold, experiment.fall, experiment.sample_time)


def strokes_of(experiment: Perturbations) -> Strokes:
    """The actuator's moves."""
    stretched, contracted = experiment.between
    return Strokes(stretched, contracted, tuple(experiment.moves), experiment.dwell, experiment.sample_time)


def waveform_rig_of(muscle: McKibbenMuscle, hysteresis: HysteresisSpec, experiment: Waveforms) -> WaveformRig:
    """The muscle that hangs behind a regulator."""
    return WaveformRig(
        muscle=braid_of(muscle),
        hysteresis=hysteresis_of(hysteresis),
        rubber=experiment.rubber,
        regulator=regulator_of(experiment.regulator),
        polytropic=experiment.polytropic,
        dead_volume=experiment.dead_volume,
        end_mass=experiment.end_mass,
    )


def regulator_of(regulator: RegulatorSpec) -> Regulator:
    """The regulator."""
    return Regulator(
        slope=regulator.slope * KPA,
        offset=regulator.offset * KPA,
        lag=regulator.lag,
        band=regulator.band * KPA,
        supply=regulator.supply * KPA,
        supply_conductance=regulator.supply_conductance,
        exhaust_conductance=regulator.exhaust_conductance,
        critical_ratio=regulator.critical_ratio,
    )


def waveform_of(experiment: Waveforms, waveform: WaveformSpec) -> Waveform:
    """The input of one recording."""
    return Waveform(
        shape=waveform.shape,
        low=waveform.low,
        high=waveform.high,
        frequency=waveform.frequency,
        wavelengths=waveform.wavelengths,
        rest=experiment.rest,
        rest_input=waveform.rest_at,
        sample_time=experiment.sample_time,
    )


def loading_of(experiment: ContractionTable) -> Loading:
    """The weights of a table of contractions."""
    return Loading(tuple(experiment.masses), experiment.regulator_error * KPA)


def closed_muscle_of(muscle: McKibbenMuscle, hysteresis: HysteresisSpec, experiment: RandomVelocity | Antagonists) -> ClosedMuscle:
    """A muscle full of air."""
    air = experiment.air
    return ClosedMuscle(braid_of(muscle), hysteresis_of(hysteresis), experiment.rubber, air)


def random_motion_of(experiment: RandomVelocity) -> RandomMotion:
    """What the motor does."""
    return RandomMotion(
        duration=experiment.duration,
        sample_time=experiment.sample_time,
        every=experiment.every,
        speeds=experiment.speeds,
        rest=_rest_of(experiment.rest),
        taut=experiment.taut,
        drawn_out=experiment.drawn_out,
        load_cell=experiment.load_cell,
    )


def joint_of(flexor: McKibbenMuscle, hysteresis: HysteresisSpec, experiment: Antagonists) -> tuple[Joint, Swing]:
    """The joint, and its sine."""
    joint = Joint(
        muscles=(closed_muscle_of(flexor, hysteresis, experiment), closed_muscle_of(experiment.extensor, hysteresis, experiment)),
        radius=experiment.radius,
        inertia=experiment.inertia,
        damping=experiment.damping,
        load_cell=experiment.load_cell,
        rest=_rest_of(experiment.rest),
        upright=(experiment.pressure * KPA, experiment.taut),
    )
    return joint, Swing(experiment.duration, experiment.sample_time, experiment.frequency)


def _rest_of(rest: RestLength) -> tuple[float, float]:
    return rest.pressure * KPA, rest.force
