"""The synthetic muscles against published numbers, their own geometry and common sense; their
friction.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rig_cases import BRAID, MUSCLES, TUBES, both, friction
from scipy.integrate import quad, trapezoid

from datasets.rig.muscle import (
    effective_pressure,
    stop,
    zero_force_strain,
)
from datasets.rig.static_muscles import (
    opening_angle,
    volume,
)
from mapmore_cli.domain.errors import SpecError

PUBLISHED = {  # kPa, force at zero strain N, free strain
    "mckibben": ((80, 215, 0.036), (150, 445, 0.104), (250, 735, 0.181), (350, 1002, 0.221)),
    "peano": ((80, 227, 0.155), (200, 422, 0.234), (350, 605, 0.274), (500, 756, 0.295)),
}

contractions = st.floats(0.001, 0.3)
pressures = st.floats(1e3, 6e5)
strains = st.floats(0.0, 0.25)


def free_strain(muscle, pressure):
    return zero_force_strain(lambda strain: float(muscle.force(pressure, strain)))


@both
def test_the_documented_forces_free_strains_and_lengths(kind):
    muscle = MUSCLES[kind]
    assert muscle.length == pytest.approx({"mckibben": 0.088, "peano": 0.069}[kind])
    for kpa, force, strain in PUBLISHED[kind]:
        assert float(muscle.force(kpa * 1e3, 0.0)) == pytest.approx(force, rel=0.005)  # asked: 0.05
        assert free_strain(muscle, kpa * 1e3) == pytest.approx(strain, abs=6e-4)


@settings(max_examples=25)
@given(strain=contractions)
def test_the_volume_is_that_of_the_tapered_profile(strain):
    length = BRAID.length * (1 - strain)
    fibre = BRAID.length / np.cos(BRAID.braid_angle)
    turns = fibre * np.sin(BRAID.braid_angle) / (2 * np.pi * BRAID.radius)
    growth = np.sqrt(fibre**2 - length**2) / (2 * np.pi * turns) - BRAID.radius
    end = BRAID.taper * growth

    def section(x):
        s = min(min(x, length - x) / end, 1.0)
        return np.pi * (BRAID.radius + growth * (2 * s - s**2)) ** 2

    swept = 2 * quad(section, 0, end)[0] + quad(section, end, length - end)[0]
    assert float(volume(BRAID, np.float64(strain))) == pytest.approx(swept, rel=1e-8)


@given(alpha=st.floats(1e-3, 1.57), pressure=st.floats(0.0, 600e3))
def test_the_peano_solver_returns_to_the_angle_that_it_is_given(alpha, pressure):
    """From an angle follow strain and force in closed form; the solver has to find that force from
    the strain alone.
    """
    driving = float(effective_pressure(pressure, TUBES.threshold, TUBES.threshold_width))
    width = TUBES.tube_width
    across = TUBES.tube_length - 2 * TUBES.end_loss * width * np.sin(alpha)
    force = driving * width * across * np.cos(alpha) / alpha - TUBES.bending * alpha
    strain = 1 - np.sin(alpha) / alpha - force / TUBES.stiffness
    assert float(TUBES.force(pressure, strain)) == pytest.approx(force, rel=1e-9, abs=1e-7)


def test_a_muscle_that_never_stops_pulling_is_refused():
    endless = replace(BRAID, braid_angle=np.deg2rad(12.0), c10=0.0, c01=0.0, taper=0.0)
    with pytest.raises(
        SpecError, match=r"does not vanish between strains -0\.02 and 0\.36.*\n.*lower the pressure"
    ):
        free_strain(endless, 500e3)


@given(pressure=st.floats(0, 6e5), strain=st.floats(-0.005, 0.25))
def test_the_tension_is_the_static_force(pressure, strain):
    for chamber in (BRAID, TUBES):
        assert chamber.respond(pressure, strain).tension == pytest.approx(
            float(chamber.force(pressure, strain)), rel=1e-6, abs=1e-5
        )


@given(pressure=pressures, strain=strains)
def test_the_tubes_do_as_much_work_as_the_water(pressure, strain):
    """Virtual work: `L0 dF/dP_e` at constant strain is `dV/de` at constant pressure."""
    width = TUBES.threshold_width
    step = 1e-4 * pressure
    low, high = (TUBES.respond(at, strain).tension for at in (pressure - step, pressure + step))
    driven = float(
        effective_pressure(pressure + step, 6e3, width)
        - effective_pressure(pressure - step, 6e3, width)
    )
    assert TUBES.length * (high - low) / driven == pytest.approx(
        TUBES.respond(pressure, strain).displacement, rel=1e-4
    )


def test_a_locked_tube_fills_to_the_area_between_its_arcs():
    """`n D w^2 (alpha - sin(alpha) cos(alpha))/(2 alpha^2)`, of tubes whose ends take nothing
    away.
    """
    open_ended = replace(TUBES, end_loss=0.0)
    driving = float(effective_pressure(2e5, 6e3, 3e3))
    alpha = opening_angle(open_ended, driving, 0.0)
    area = open_ended.tube_width**2 * (alpha - np.sin(alpha) * np.cos(alpha)) / (2 * alpha**2)
    filled = quad(
        lambda pressure: open_ended.respond(pressure, 0.0).filling,
        0,
        2e5,
        points=[1, 30, 1e3, 1e4],
        limit=500,
    )[0]
    assert filled == pytest.approx(4 * 0.046 * area, rel=1e-4)
    assert 1e-6 < filled < 20e-6


@given(pressure=st.floats(-9e4, 6e5), strain=st.floats(-0.01, 0.25))
def test_no_chamber_swells_when_it_is_sucked(pressure, strain):
    for chamber in (BRAID, TUBES):
        response = chamber.respond(pressure, strain)
        assert np.all(np.isfinite(response))
        assert response.filling >= 0
        assert response.displacement >= 0


YIELDS = np.array([0.001, 0.004, 0.016])
FRICTION = friction(3.0, 6e-5, YIELDS, (0.4, 0.35, 0.25))
paths = st.lists(st.floats(-0.05, 0.3), min_size=2, max_size=30).map(np.array)


@given(peak=st.floats(1e-4, 0.1), back=st.floats(0, 1))
def test_a_minor_loop_is_forgotten(peak, back):
    """Return-point memory: from a turning point part of the way back and up to it again, as if it
    had not been left.
    """
    states = stop(np.array([0.0, peak, (1 - back) * peak, peak]), YIELDS)
    np.testing.assert_allclose(states[3], states[1], atol=1e-9)
    assert np.all(states[2] <= states[1])


@given(path=paths, pressure=st.floats(0, 5e5))
def test_friction_never_gives_work_back_over_a_closed_cycle(path, pressure):
    # twice, so that the second run starts from where it ends
    cycle = np.concatenate([path, path[:1], path, path[:1]])
    fine = np.concatenate([np.linspace(a, b, 50) for a, b in pairwise(cycle)])
    force = FRICTION.force(pressure, fine)
    second = slice(len(fine) // 2, None)
    assert trapezoid(force[second], fine[second]) >= -1e-6


@pytest.mark.parametrize("amplitude", [0.05, 0.2])
def test_the_dissipated_work_of_one_stop(amplitude):
    """Half-width r, yield strain y, relaxed start, to A and back: `r (2A - 5y/2)`."""
    one = friction(10.0, 0.0, [0.01], [1.0])
    path = np.concatenate([np.linspace(0, amplitude, 20001), np.linspace(amplitude, 0, 20001)])
    assert trapezoid(one.force(0.0, path), path) == pytest.approx(
        10.0 * (2 * amplitude - 0.025), rel=1e-6
    )
