"""Sensors, and the muscle in a loop."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from datasets.rig.sensors import Sensor


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
