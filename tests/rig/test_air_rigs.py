"""H's random motion and joint, and P's muscle behind a regulator: the laws that they obey, and what
is published.
"""

import csv
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pages import PUBLISHED
from rig_cases import DATASETS, spec
from scipy.integrate import solve_ivp, trapezoid
from scipy.interpolate import CubicSpline

from datasets.rig.air import ATMOSPHERE, ClosedMuscle
from datasets.rig.antagonists import Joint, driven, swung
from datasets.rig.random_velocity import random_velocity
from datasets.rig.sensors import recording_generator
from datasets.rig.simulate import recording
from datasets.rig.static_muscles import volume
from datasets.rig.waveform import Waveform, waveform_response


@cache
def closed_muscle():
    found = spec("muscle-like/random_velocity_16cm")
    return ClosedMuscle(
        found.muscle, found.hysteresis, found.experiment.rubber, found.experiment.air
    )


def committed(path):
    table = np.genfromtxt(DATASETS / path, delimiter=",", names=True)
    return {name: table[name] for name in table.dtype.names}


@settings(max_examples=15)
@given(st.floats(0.02, 0.2), st.floats(-0.1, 0.1), st.floats(2e5, 6e5))
def test_slow_air_keeps_its_temperature_and_fast_air_its_heat(start, change, pressure):
    muscle = closed_muscle()
    strain = np.linspace(start, min(max(start + change, 0.0), 0.24), 2001)
    chamber = volume(muscle.muscle, strain) + muscle.air.dead_volume
    for step, exponent in ((1.0, 1.0), (1e-7, muscle.air.heat_ratio)):
        absolute = muscle.closed_pressure(strain, pressure, step) + ATMOSPHERE
        assert absolute[-1] * chamber[-1] ** exponent == pytest.approx(
            absolute[0] * chamber[0] ** exponent, rel=3e-3
        )


def test_the_pressure_is_that_of_the_gas_and_its_warmth_integrated_apart():
    """Pressure and temperature of a fixed mass as two equations: `p V = m R T`, `m c_v T' = -p V' +
    k (T_w - T)`.
    """
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
    motion = spec(
        "muscle-like/random_velocity_16cm", "experiment.duration=6", "experiment.every=1"
    ).experiment
    found = random_velocity(closed_muscle(), motion, 4e5, recording_generator(1, "a"))
    assert found["velocity"][1:-1] == pytest.approx(
        -np.gradient(found["length"], found["time"])[1:-1], abs=2e-3
    )
    assert np.abs(found["velocity"]).max() <= motion.speeds[1] * 1.01
    assert found["force"][0] == pytest.approx(10.0, abs=0.1)
    assert found["force"].min() >= 0.0
    drawn = found["length"] - found["length"][0]
    assert drawn.min() > -1e-9
    # a muscle that is drawn out holds less
    assert np.corrcoef(drawn, found["pressure"])[0, 1] > 0.8


def test_what_one_muscle_of_the_joint_gives_the_other_takes():
    found = spec("muscle-like/joint", "experiment.duration=2", "experiment.sample_time=0.01")
    setup, joint = found.experiment, Joint(found.muscle, found.hysteresis, found.experiment)
    closed = swung(joint)
    assert closed["velocity_1"] == pytest.approx(-closed["velocity_2"])
    assert np.ptp(closed["length_1"] + closed["length_2"]) == pytest.approx(0.0, abs=1e-9)
    assert np.corrcoef(closed["pressure_1"], closed["length_1"])[0, 1] > 0.9
    moved = driven(joint, setup.asked("driven", np.random.default_rng(1)))
    later = setup.clock > 0.5
    assert np.corrcoef(moved["pressure_1"][later], moved["pressure_2"][later])[0, 1] < -0.9
    turning = (
        setup.radius * (moved["force_1"] - moved["force_2"])
        - setup.damping * moved["velocity_1"] / setup.radius
    )
    acceleration = np.gradient(moved["velocity_1"], setup.clock) / setup.radius
    # but for the filter of the load cells
    assert np.corrcoef(turning[later], setup.inertia * acceleration[later])[0, 1] > 0.95


def test_a_stiff_tendon_is_none():
    """The states, step by step, come to what the filters of a muscle at closed valves have."""
    short = ("experiment.duration=1.5", "experiment.sample_time=0.005", "experiment.every=1")
    stiff = "experiment.tendon={stiffness: 2.0e+6, damping: 10000}"
    studies = (
        spec("muscle-like/random_velocity_16cm", *short),
        spec("muscle-like/tendon", *short, stiff),
    )
    plain, stiff = (
        random_velocity(closed_muscle(), study.experiment, 4e5, recording_generator(1, "a"))
        for study in studies
    )
    assert stiff["pressure"] == pytest.approx(plain["pressure"], rel=5e-3)
    assert stiff["force"] == pytest.approx(plain["force"], abs=1.0)


def test_a_tendon_gives_way():
    """What is drawn out is shared by tendon and muscle: the pressure, which the muscle's length
    makes, varies less, the force too.
    """
    short = ("experiment.duration=2", "experiment.every=1", "experiment.sample_time=0.005")
    found = [
        recording(spec(f"muscle-like/{name}", *short), 5e5)
        for name in ("random_velocity_16cm", "tendon")
    ]
    assert np.ptp(found[0]["length"]) == pytest.approx(np.ptp(found[1]["length"]), rel=0.5)
    spans = [np.ptp(one["pressure"]) / np.ptp(one["length"]) for one in found]
    assert spans[1] < 0.9 * spans[0]


@pytest.mark.parametrize(
    ("name", "cause", "shipped"),
    [("valves", 3e5, "valves_300"), ("joint_random", "random", "joint_random")],
)
def test_the_records_of_random_pressures_begin_as_shipped(name, cause, shipped):
    """But for the noise; what a regulator is told is what the muscle takes on a little later."""
    short = spec(
        f"muscle-like/{name}",
        "experiment.duration=2",
        *(["experiment.every=2"] if name == "valves" else []),
    )
    made, committed_ = recording(short, cause), committed(f"muscle-like/{shipped}.csv")
    columns = {
        "input": ("U", 0.0),
        "pressure": ("P", 10.0),
        "force": ("F", 3.0),
        "length": ("l", 0.2),
        "velocity": ("v", 5.0),
    }
    for number in ("",) if name == "valves" else ("_1", "_2"):
        for column, (head, noise) in columns.items():
            theirs = committed_[f"{head}{number}"][: len(made["time"])]
            assert made[f"{column}{number}"] == pytest.approx(theirs, abs=noise + 1e-3), column
        later = 125.0 * np.roll(made[f"input{number}"], round(0.03 / made["time"][1]))
        assert made[f"pressure{number}"][50:] == pytest.approx(later[50:], abs=20.0)


FREE = {1.4: 1.7, 3.0: 6.4, 4.0: 8.8, 5.0: 9.9, 6.0: 10.3}
"""Free contraction (cm) of the muscle at pressures in bar, as P's data suggest it."""


@cache
def hanging():
    found = spec("waveforms/validation")
    return found.experiment, found.experiment.hung(found.muscle, found.hysteresis)


@cache
def response(load=0.0):
    return waveform_response(*hanging(), Waveform("loaded", "sine", 0.0, 5.0, 0.5, 1, load=load))


@pytest.mark.parametrize(("bar", "centimetres"), FREE.items())
def test_free_contraction_is_what_the_published_data_suggest(bar, centimetres):
    setup, muscle = hanging()
    start, end = (
        setup.resting_strain(muscle, pressure, 0.0)
        for pressure in (float(setup.regulator.wanted(0.0)), bar * 1e5)
    )
    assert 100 * muscle.muscle.length * (end - start) == pytest.approx(centimetres, abs=0.3)


def test_a_load_stretches_the_muscle_at_rest_and_hardly_shortens_the_stroke():
    """P section 4: "the weight to have little effect on the motion"."""
    free, loaded = response(), response(load=5.0)
    assert loaded["displacement"][0] < free["displacement"][0] == pytest.approx(0.0, abs=1e-12)
    assert np.ptp(loaded["displacement"]) == pytest.approx(np.ptp(free["displacement"]), rel=0.06)


def test_the_load_cell_feels_weight_and_inertia():
    truth = response(load=5.0)
    assert truth["load"][0] == pytest.approx(5 * 9.81, rel=1e-6)
    # Over the whole motion the inertia's impulse is the change of momentum.
    step = truth["time"][1]
    speed = np.gradient(truth["displacement"], step)
    impulse = trapezoid(truth["load"] - 5 * 9.81, dx=step)
    assert impulse == pytest.approx(5 * (speed[-1] - speed[0]), abs=0.05)
    assert np.all(response()["load"] == 0.0)


def test_the_waveforms_are_those_of_the_published_table():
    """P table 2, its column of types read with the names."""
    with (PUBLISHED / "p_table_2.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    lows, swings = ([float(row[key]) for row in rows] for key in ("offset_V", "amplitude_V"))
    told = [
        (
            row["experiment"],
            low,
            low + swing,
            float(row["frequency_Hz"]),
            int(row["wavelengths"]),
            float(row["load_kg"]),
        )
        for row, low, swing in zip(rows, lows, swings, strict=True)
    ]
    waveforms = spec("waveforms/validation").experiment.waveforms
    assert [
        (each.name, each.low, each.high, each.frequency, each.wavelengths, each.load)
        for each in waveforms
    ] == told
    shapes = {each.name: each.shape for each in waveforms}
    assert shapes == dict.fromkeys(shapes, "sine") | {"triangle": "triangle", "square": "square"}
