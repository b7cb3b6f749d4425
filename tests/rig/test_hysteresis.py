"""The stop operators: bounded, rate independent, dissipative, with return-point memory."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import trapezoid

from mapmore_cli.rig.muscle import Hysteresis, stop

YIELDS = np.array([0.001, 0.004, 0.016])
FRICTION = Hysteresis(base=3.0, per_pressure=6e-5, yield_strains=YIELDS, shares=np.array([0.4, 0.35, 0.25]))
paths = st.lists(st.floats(-0.05, 0.3), min_size=2, max_size=30).map(np.array)


@settings(deadline=None)
@given(path=paths)
def test_no_stop_leaves_its_bounds(path):
    assert np.all(np.abs(stop(path, YIELDS)) <= 1.0)


@settings(deadline=None)
@given(path=paths, pressure=st.floats(0, 5e5))
def test_the_force_stays_within_the_half_width(path, pressure):
    assert np.all(np.abs(FRICTION.force(pressure, path)) <= 3.0 + 6e-5 * pressure + 1e-9)


@settings(deadline=None)
@given(path=paths, data=st.data())
def test_time_does_not_matter(path, data):
    """The same inputs passed through slower, faster and with rests give the same states."""
    pieces, where = [path[:1]], [0]
    for start, end in pairwise(path):
        warp = np.sort(data.draw(st.lists(st.floats(0, 1), max_size=4)))
        pieces.append(np.concatenate([start + (end - start) * warp, [end]]))
        where.append(where[-1] + len(pieces[-1]))
    np.testing.assert_allclose(stop(np.concatenate(pieces), YIELDS)[where], stop(path, YIELDS), atol=1e-9)


@settings(deadline=None)
@given(peak=st.floats(1e-4, 0.1), back=st.floats(0, 1))
def test_a_minor_loop_is_forgotten(peak, back):
    """Return-point memory: from a turning point part of the way back and up to it again, as if it had not been left."""
    states = stop(np.array([0.0, peak, (1 - back) * peak, peak]), YIELDS)
    np.testing.assert_allclose(states[3], states[1], atol=1e-9)
    assert np.all(states[2] <= states[1])


@settings(deadline=None)
@given(path=paths, pressure=st.floats(0, 5e5))
def test_friction_never_gives_work_back_over_a_closed_cycle(path, pressure):
    cycle = np.concatenate([path, path[:1], path, path[:1]])  # twice, so that the second run starts from where it ends
    fine = np.concatenate([np.linspace(a, b, 50) for a, b in pairwise(cycle)])
    force = FRICTION.force(pressure, fine)
    second = slice(len(fine) // 2, None)
    assert trapezoid(force[second], fine[second]) >= -1e-6


@pytest.mark.parametrize("amplitude", [0.05, 0.2])
def test_the_dissipated_work_of_one_stop(amplitude):
    """Half-width r, yield strain y, relaxed start, to A and back: `r (2A - 5y/2)`."""
    one = Hysteresis(base=10.0, per_pressure=0.0, yield_strains=np.array([0.01]), shares=np.array([1.0]))
    path = np.concatenate([np.linspace(0, amplitude, 20001), np.linspace(amplitude, 0, 20001)])
    assert trapezoid(one.force(0.0, path), path) == pytest.approx(10.0 * (2 * amplitude - 0.025), rel=1e-6)


def test_the_half_width_grows_with_pressure():
    sliding = np.array([0.0, 0.1])
    assert FRICTION.force(0.0, sliding)[-1] == pytest.approx(3.0)
    assert FRICTION.force(350e3, sliding)[-1] == pytest.approx(24.0)
    assert FRICTION.force(np.array([0.0, 350e3]), sliding)[-1] == pytest.approx(24.0)
    assert FRICTION.force(350e3, -sliding)[-1] == pytest.approx(-24.0)
