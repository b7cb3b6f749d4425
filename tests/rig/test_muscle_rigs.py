"""W's table of contractions, H's random motion at closed valves and H's joint: the laws that they obey, and what is shipped."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.rig.antagonists import driven, sines, swung
from mapmore_cli.rig.chamber import ATMOSPHERE
from mapmore_cli.rig.closed_muscle import random_velocity
from mapmore_cli.rig.load_cycle import resting_strains
from mapmore_cli.rig.mckibben import volume
from mapmore_cli.rig.muscle import Hysteresis
from mapmore_cli.rig.sensors import recording_generator
from mapmore_cli.spec.loader import load_as
from mapmore_cli.spec.simulation import SimulationSpec
from mapmore_cli.study import simulate
from mapmore_cli.study.simulate import csv_text, decimals, recording

DATASETS = Path(__file__).parents[2] / "datasets"
LENGTHS = ("22", "16", "12")


@cache
def spec(name: str, *changes: str) -> SimulationSpec:
    folder = "wrist" if name == "contraction_table" else "muscle-like"
    return load_as(DATASETS / folder / f"{name}.yaml", SimulationSpec, changes).spec


def committed(path: str) -> dict[str, np.ndarray]:
    table = np.genfromtxt(DATASETS / path, delimiter=",", names=True)
    return {name: table[name] for name in table.dtype.names}


@cache
def closed_muscle(length: str = "16"):
    short = spec(f"random_velocity_{length}cm")
    return simulate.closed_muscle_of(short.muscle, short.hysteresis, short.experiment)


# Contraction table --------------------------------------------------------------------------------------------------------------------


def test_each_weight_hangs_where_the_muscle_balances_it():
    table = spec("contraction_table")
    muscle, weights = simulate.muscle_of(table.muscle), np.linspace(0.0, 290.0, 7)
    without = Hysteresis(0.0, 0.0, np.array([0.01]), np.array([1.0]))
    strains = resting_strains(muscle, without, 4e5, weights)
    assert muscle.force(4e5, strains) == pytest.approx(weights, abs=1e-6)
    assert (np.diff(strains) < 0).all()


def test_the_shipped_table_regenerates():
    table = spec("contraction_table")
    made = csv_text(recording(table, 300.0), decimals(table))
    shipped = (DATASETS / "wrist/contraction_300.csv").read_text()
    ours, theirs = (np.loadtxt(text.splitlines()[1:], delimiter=",") for text in (made, shipped))
    assert (np.abs(ours - theirs).max(axis=0) <= [1.0, 2.2e-5, 0.0]).all()


def test_repeats_are_averaged():
    """The mean of nine repeats scatters less around the weights' balance than one of them does."""
    single, many = (spec("contraction_table", f"experiment.repeats={n}", "experiment.regulator_error=0") for n in (1, 9))
    exact = resting_strains(
        simulate.muscle_of(single.muscle), simulate.hysteresis_of(single.hysteresis), 6e5, 9.81 * np.array(single.experiment.masses)
    )
    one, nine = (np.std(recording(table, 600.0)["strain"] - exact) for table in (single, many))
    assert nine < 0.6 * one


def test_a_weight_that_nothing_balances_is_told():
    with pytest.raises(SpecError, match="does not vanish"):
        recording(spec("contraction_table", "experiment.masses=[1000]"), 100.0)


# Closed valves ------------------------------------------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=15)
@given(st.floats(0.02, 0.2), st.floats(-0.1, 0.1), st.floats(2e5, 6e5))
def test_slow_air_keeps_its_temperature_and_fast_air_its_heat(start, change, pressure):
    muscle = closed_muscle()
    strain = np.linspace(start, min(max(start + change, 0.0), 0.24), 2001)
    chamber = volume(muscle.muscle, strain) + muscle.air.dead_volume
    for step, exponent in ((1.0, 1.0), (1e-7, muscle.air.heat_ratio)):
        absolute = muscle.closed_pressure(strain, pressure, step) + ATMOSPHERE
        assert absolute[-1] * chamber[-1] ** exponent == pytest.approx(absolute[0] * chamber[0] ** exponent, rel=3e-3)


def test_the_pressure_is_that_of_the_gas_and_its_warmth_integrated_apart():
    """Pressure and temperature of a fixed mass as two equations: `p V = m R T`, `m c_v T' = -p V' + k (T_w - T)`."""
    muscle, dt = closed_muscle(), 1e-3
    time = dt * np.arange(1500)
    strain = 0.12 + 0.08 * np.sin(2 * np.pi * 1.3 * time)
    chamber = CubicSpline(time, volume(muscle.muscle, strain) + muscle.air.dead_volume)
    gamma, tau, p0 = muscle.air.heat_ratio, muscle.air.cooling_time, 4e5 + ATMOSPHERE

    def rate(t, warmth):
        p = p0 * chamber(0.0) / chamber(t) * warmth
        return -(gamma - 1) * p * chamber(t, 1) / (p0 * chamber(0.0)) + (1 - warmth) / tau

    warmth = solve_ivp(rate, (0, time[-1]), [1.0], t_eval=time, rtol=1e-9, atol=1e-9).y[0]
    expected = p0 * chamber(0.0) / chamber(time) * warmth - ATMOSPHERE
    assert muscle.closed_pressure(strain, 4e5, dt) == pytest.approx(expected, rel=2e-4)


def test_a_random_motion_is_what_its_columns_say():
    motion = simulate.random_motion_of(spec("random_velocity_16cm", "experiment.duration=6", "experiment.every=1").experiment)
    found = random_velocity(closed_muscle(), motion, 4e5, recording_generator(1, "a"))
    assert found["velocity"][1:-1] == pytest.approx(-np.gradient(found["length"], found["time"])[1:-1], abs=2e-3)
    assert np.abs(found["velocity"]).max() <= motion.speeds[1] * 1.01
    assert found["force"][0] == pytest.approx(10.0, abs=0.1)
    assert found["force"].min() >= 0.0
    drawn = found["length"] - found["length"][0]
    assert drawn.min() > -1e-9
    assert np.corrcoef(drawn, found["pressure"])[0, 1] > 0.8  # a muscle that is drawn out holds less


def test_fewer_logged_samples_are_those_of_the_full_record():
    full, few = (
        recording(spec("random_velocity_12cm", "experiment.duration=8", f"experiment.every={n}", "sensors.force.noise=0"), 300.0)
        for n in (1, 40)
    )
    assert few["force"] == pytest.approx(full["force"][::40])
    assert few["time"] == pytest.approx(full["time"][::40])


def test_what_one_muscle_of_the_joint_gives_the_other_takes():
    joint, swing = simulate.joint_of(
        spec("joint").muscle, spec("joint").hysteresis, spec("joint", "experiment.duration=2", "experiment.sample_time=0.01").experiment
    )
    closed = swung(joint, swing, 0.5, 5e5)
    assert closed["velocity_1"] == pytest.approx(-closed["velocity_2"])
    assert closed["length_1"] + closed["length_2"] == pytest.approx(
        np.full(len(swing.clock), closed["length_1"][0] + closed["length_2"][0])
    )
    assert np.corrcoef(closed["pressure_1"], closed["length_1"])[0, 1] > 0.9
    regulator = simulate.regulator_of(spec("joint").experiment.regulator)
    moved = driven(joint, swing, regulator, sines(swing, 0.5e5, 5e5))
    later = swing.clock > 0.5
    assert np.corrcoef(moved["pressure_1"][later], moved["pressure_2"][later])[0, 1] < -0.9
    turning = joint.radius * (moved["force_1"] - moved["force_2"]) - joint.damping * moved["velocity_1"] / joint.radius
    acceleration = np.gradient(moved["velocity_1"], swing.clock) / joint.radius
    assert np.corrcoef(turning[later], joint.inertia * acceleration[later])[0, 1] > 0.95  # but for the filter of the load cells


def test_a_stiff_tendon_is_none():
    """The states, step by step, come to what the filters of a muscle at closed valves have."""
    short = ("experiment.duration=1.5", "experiment.sample_time=0.005", "experiment.every=1")
    plain, stiff = (
        random_velocity(closed_muscle(), simulate.random_motion_of(spec(name, *short, *more).experiment), 4e5, recording_generator(1, "a"))
        for name, more in (("random_velocity_16cm", ()), ("tendon", ("experiment.tendon={stiffness: 2.0e+6, damping: 10000}",)))
    )
    assert stiff["pressure"] == pytest.approx(plain["pressure"], rel=5e-3)
    assert stiff["force"] == pytest.approx(plain["force"], abs=1.0)


def test_a_tendon_gives_way():
    """What is drawn out is shared by tendon and muscle: the pressure, which the muscle's length makes, varies less, the force too."""
    short = ("experiment.duration=2", "experiment.every=1", "experiment.sample_time=0.005")
    found = [recording(spec(name, *short), 500.0) for name in ("random_velocity_16cm", "tendon")]
    assert np.ptp(found[0]["length"]) == pytest.approx(np.ptp(found[1]["length"]), rel=0.5)
    spans = [np.ptp(one["pressure"]) / np.ptp(one["length"]) for one in found]
    assert spans[1] < 0.9 * spans[0]


@pytest.mark.parametrize(("name", "cause", "shipped"), [("valves", 300.0, "valves_300"), ("joint_random", "random", "joint_random")])
def test_the_records_of_random_pressures_begin_as_shipped(name, cause, shipped):
    """But for the noise; what a regulator is told is what the muscle takes on a little later."""
    short = spec(name, "experiment.duration=2", *(["experiment.every=2"] if name == "valves" else []))
    made, committed_ = recording(short, cause), committed(f"muscle-like/{shipped}.csv")
    columns = {"input": ("U", 0.0), "pressure": ("P", 10.0), "force": ("F", 3.0), "length": ("l", 0.2), "velocity": ("v", 5.0)}
    for number in ("",) if name == "valves" else ("_1", "_2"):
        for column, (head, noise) in columns.items():
            theirs = committed_[f"{head}{number}"][: len(made["time"])]
            assert made[f"{column}{number}"] == pytest.approx(theirs, abs=noise + 1e-3), column
        later = 125.0 * np.roll(made[f"input{number}"], round(0.03 / made["time"][1]))
        assert made[f"pressure{number}"][50:] == pytest.approx(later[50:], abs=20.0)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("contraction_table", "experiment.repeats=0", "greater than or equal to 1|at least 1"),
        ("contraction_table", "sensors.force={noise: 1, resolution: 1}", "goes with"),
        ("random_velocity_16cm", "experiment.speeds=[0.2, 0.1]", "slower one first"),
        ("random_velocity_16cm", "experiment.every=40000", "fewer than 100 samples"),
        ("random_velocity_16cm", "muscle={kind: peano}", "kind: mckibben|unknown key"),
        ("joint", "experiment.recordings=[swung]", "closed"),
        ("joint", "experiment.recordings=[random]", "needs a `course`"),
        ("tendon", "experiment.tendon.stiffness=0", "greater than 0"),
    ],
)
def test_impossible_experiments_are_refused(name, change, words):
    with pytest.raises(SpecError, match=words):
        spec(name, change)
