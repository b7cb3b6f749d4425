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
from rig_cases import spec
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from datasets.rig.air import ATMOSPHERE, ClosedMuscle
from datasets.rig.antagonists import Joint, driven, swung
from datasets.rig.static_muscles import volume


@cache
def closed_muscle():
    found = spec("muscle-like/random_velocity_16cm")
    return ClosedMuscle(
        found.muscle, found.hysteresis, found.experiment.rubber, found.experiment.air
    )


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


FREE = {1.4: 1.7, 3.0: 6.4, 4.0: 8.8, 5.0: 9.9, 6.0: 10.3}
"""Free contraction (cm) of the muscle at pressures in bar, as P's data suggest it."""


@cache
def hanging():
    found = spec("waveforms/validation")
    return found.experiment, found.experiment.hung(found.muscle, found.hysteresis)


@pytest.mark.parametrize(("bar", "centimetres"), FREE.items())
def test_free_contraction_is_what_the_published_data_suggest(bar, centimetres):
    setup, muscle = hanging()
    start, end = (
        setup.resting_strain(muscle, pressure, 0.0)
        for pressure in (float(setup.regulator.wanted(0.0)), bar * 1e5)
    )
    assert 100 * muscle.muscle.length * (end - start) == pytest.approx(centimetres, abs=0.3)


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
