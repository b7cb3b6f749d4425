from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.rig.sensors import Sensor, measure, recording_generator


@settings(deadline=None)
@given(resolution=st.sampled_from([0.1, 0.25, 1.1e-4, 3.0]), noise=st.floats(0, 5), level=st.floats(-1e3, 1e3))
def test_readings_are_whole_steps_near_the_truth(resolution, noise, level):
    readings = Sensor(noise, resolution).read(np.full(50, level), np.random.default_rng(3))
    steps = readings / resolution
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    assert np.all(np.abs(readings - level) <= 6 * noise + 0.5001 * resolution)


def test_noise_has_the_declared_size():
    readings = Sensor(0.7, 0.1).read(np.full(20_000, 100.0), np.random.default_rng(1))
    assert readings.std() == pytest.approx(np.hypot(0.7, 0.1 / np.sqrt(12)), rel=0.03)
    assert readings.mean() == pytest.approx(100.0, abs=0.02)


def test_no_reading_is_minus_zero():
    assert not np.signbit(Sensor(0.0, 0.1).read(np.array([-0.01, -0.0, 0.01]), np.random.default_rng(1))).any()


def test_seed_and_name_fix_the_numbers():
    first = recording_generator(1, "pressure=80").standard_normal(5)
    np.testing.assert_array_equal(first, recording_generator(1, "pressure=80").standard_normal(5))
    for seed, name in ((2, "pressure=80"), (1, "pressure=150")):
        assert not np.any(first == recording_generator(seed, name).standard_normal(5))


def test_only_sensed_columns_are_read():
    truth = {"time": np.array([0.0, 0.02]), "force": np.array([1.234, 5.678])}
    logged = measure(truth, {"force": Sensor(0.0, 0.1)}, np.random.default_rng(1))
    np.testing.assert_array_equal(logged["time"], truth["time"])
    np.testing.assert_allclose(logged["force"], [1.2, 5.7])
