"""Errors over one wavelength, against sums written out here."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motion_samples import STEP

from mapmore_cli.modelling.motion.simulation import last_wavelength, motion_errors, velocity


@given(st.integers(5, 40), st.integers(2, 5), st.integers(0, 30), st.integers(0, 2**31))
def test_the_last_wavelength_is_where_an_input_repeats_itself(length, times, rest, seed):
    wave = np.random.default_rng(seed).standard_normal(length)
    u = np.concatenate([np.zeros(rest), np.tile(wave, times)])
    assert last_wavelength(u) == length


@pytest.mark.parametrize("u", [np.arange(50.0), np.zeros(50), np.array([1.0]), np.random.default_rng(1).standard_normal(60)])
def test_without_repetition_it_is_the_whole_record(u):
    assert last_wavelength(u) == len(u)


def test_errors_are_those_of_the_last_wavelength():
    n, length = 240, 80
    u = np.sin(2 * np.pi * np.arange(n) / length)
    error = np.where(np.arange(n) < n - length, 3.0, 0.5 * np.sin(2 * np.pi * np.arange(n) / length))
    measured = 2 * u
    found = motion_errors(measured, measured + error, u, STEP)
    tail = error[-length:]
    assert found.samples == length
    assert found.displacement_rmse == pytest.approx(math.sqrt(sum(e * e for e in tail) / length))
    assert found.max_displacement == pytest.approx(max(abs(e) for e in tail))
    assert found.transient == pytest.approx(3.0)
    slopes = [(error[k + 1] - error[k - 1]) / (2 * STEP) for k in range(n - length + 1, n - 1)]
    assert found.max_velocity >= max(abs(slope) for slope in slopes) - 1e-12


def test_velocity_of_a_ramp():
    np.testing.assert_allclose(velocity(3.0 * STEP * np.arange(10), STEP), 3.0)
    assert velocity(np.array([1.0]), STEP).tolist() == [0.0]
