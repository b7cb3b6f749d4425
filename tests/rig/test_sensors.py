"""Sensors, and the muscle in a loop."""

import numpy as np
import pytest
from closed_loop import Lift, Loop, closed_loop, wanted_force
from hypothesis import given
from hypothesis import strategies as st
from rig_cases import friction

from datasets.rig.muscle import GRAVITY
from datasets.rig.sensors import Sensor, recording_generator


@given(
    resolution=st.sampled_from([0.1, 0.25, 1.1e-4, 3.0]),
    noise=st.floats(0, 5),
    level=st.floats(-1e3, 1e3),
)
def test_readings_are_whole_steps_near_the_truth(resolution, noise, level):
    readings = Sensor(noise, resolution).read(np.full(50, level), np.random.default_rng(3))
    steps = readings / resolution
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    assert np.all(np.abs(readings - level) <= 6 * noise + 0.5001 * resolution)


def test_no_reading_is_minus_zero():
    assert not np.signbit(
        Sensor(0.0, 0.1).read(np.array([-0.01, -0.0, 0.01]), np.random.default_rng(1))
    ).any()


def test_seed_and_name_fix_the_numbers():
    first = recording_generator(1, "pressure=80").standard_normal(5)
    np.testing.assert_array_equal(first, recording_generator(1, "pressure=80").standard_normal(5))
    for seed, name in ((2, "pressure=80"), (1, "pressure=150")):
        assert not np.any(first == recording_generator(seed, name).standard_normal(5))


LIFT = Lift(mass=10.0, length=0.1, damping=300.0, lag=0.02, highest=4e5, step=1e-3)
NO_FRICTION = friction(0.0, 0.0, [0.01], [1.0])


class Spring:
    """`F = 1e-3 P - 1000 e`: 10 kg hang at rest where `P = 1e3 (98.1 + 1000 e)`."""

    def force(self, pressure, strain):
        return np.asarray(1e-3 * np.asarray(pressure) - 1000.0 * np.asarray(strain))


def pressure_at_rest(strain):
    return 1e3 * (LIFT.mass * GRAVITY + 1000.0 * strain)


def test_the_right_pressure_keeps_it_at_rest():
    reference = np.full(200, 0.05)
    found = closed_loop(
        Spring(), NO_FRICTION, LIFT, Loop(5e-3, 0.0, 0.0), reference, pressure_at_rest(reference)
    )
    assert found["strain"] == pytest.approx(reference, abs=1e-9)
    assert wanted_force(LIFT, reference, 5e-3) == pytest.approx(np.full(200, LIFT.mass * GRAVITY))


def test_the_loop_takes_a_wrong_pressure_off_and_the_command_stays_in_its_limits():
    reference = np.full(800, 0.05)
    wrong = pressure_at_rest(reference) + 3e4
    free, closed = (
        closed_loop(Spring(), NO_FRICTION, LIFT, loop, reference, wrong)
        for loop in (Loop(5e-3, 0, 0), Loop(5e-3, 2e5, 2e6))
    )
    assert free["strain"][-1] == pytest.approx(0.08, abs=1e-4)
    assert closed["strain"][-1] == pytest.approx(0.05, abs=1e-4)
    high = closed_loop(
        Spring(),
        NO_FRICTION,
        LIFT,
        Loop(5e-3, 1e8, 0.0),
        np.full(50, 0.5),
        pressure_at_rest(np.full(50, 0.1)),
    )
    assert (high["command"].min() >= 0.0) & (high["command"].max() <= LIFT.highest)


def test_friction_holds_it_back():
    holding = friction(30.0, 0.0, [0.002], [1.0])
    reference = np.full(400, 0.05)
    pushed = pressure_at_rest(reference) + 2e4
    held = closed_loop(Spring(), holding, LIFT, Loop(5e-3, 0.0, 0.0), reference, pushed)["strain"][
        -1
    ]
    assert 0.05 < held < 0.055
