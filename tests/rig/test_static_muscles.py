"""The synthetic muscles against published numbers, against their own geometry, and against common sense."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.rig.chamber import Peano
from mapmore_cli.rig.mckibben import McKibben, energy, energy_slope, volume, volume_slope
from mapmore_cli.rig.muscle import effective_pressure, free_strain
from mapmore_cli.spec.muscle_rigs import McKibbenMuscle, PeanoMuscle
from mapmore_cli.study.simulate import muscle_of

MCKIBBEN = muscle_of(McKibbenMuscle(kind="mckibben"))
PEANO = muscle_of(PeanoMuscle(kind="peano"))
assert isinstance(MCKIBBEN, McKibben)
assert isinstance(PEANO, Peano)

PUBLISHED = [  # muscle, kPa, force at zero strain N, free strain
    pytest.param(MCKIBBEN, 80, 215, 0.036, id="mckibben-080"),
    pytest.param(MCKIBBEN, 150, 445, 0.104, id="mckibben-150"),
    pytest.param(MCKIBBEN, 250, 735, 0.181, id="mckibben-250"),
    pytest.param(MCKIBBEN, 350, 1002, 0.221, id="mckibben-350"),
    pytest.param(PEANO, 80, 227, 0.155, id="peano-080"),
    pytest.param(PEANO, 200, 422, 0.234, id="peano-200"),
    pytest.param(PEANO, 350, 605, 0.274, id="peano-350"),
    pytest.param(PEANO, 500, 756, 0.295, id="peano-500"),
]
both = pytest.mark.parametrize("muscle", [pytest.param(MCKIBBEN, id="mckibben"), pytest.param(PEANO, id="peano")])
contractions = st.floats(0.001, 0.3)
pressures = st.floats(0.0, 600e3)


@pytest.mark.parametrize(("muscle", "kpa", "force", "strain"), PUBLISHED)
def test_the_documented_forces_and_free_strains(muscle, kpa, force, strain):
    assert float(muscle.force(kpa * 1e3, 0.0)) == pytest.approx(force, rel=0.005)  # asked: 0.05
    assert free_strain(muscle, kpa * 1e3) == pytest.approx(strain, abs=6e-4)


@both
def test_pressures_and_strains_broadcast(muscle):
    grid = muscle.force(np.array([[0.0], [80e3], [350e3]]), np.linspace(-0.01, 0.3, 7))
    assert grid.shape == (3, 7)
    assert float(muscle.force(80e3, np.linspace(-0.01, 0.3, 7)[4])) == pytest.approx(grid[1, 4], rel=1e-12)


@settings(deadline=None)
@given(strain=contractions | st.floats(-0.05, -0.001))
def test_virtual_work_slopes_are_the_derivatives(strain):
    h = 1e-5
    for value, slope in ((volume, volume_slope), (energy, energy_slope)):
        numeric = (value(MCKIBBEN, strain + h) - value(MCKIBBEN, strain - h)) / (2 * h)
        assert float(slope(MCKIBBEN, np.float64(strain))) == pytest.approx(float(numeric), rel=1e-5, abs=1e-7)


@settings(deadline=None, max_examples=25)
@given(strain=contractions)
def test_the_volume_is_that_of_the_tapered_profile(strain):
    length = MCKIBBEN.length * (1 - strain)
    fibre = MCKIBBEN.length / np.cos(MCKIBBEN.braid_angle)
    turns = fibre * np.sin(MCKIBBEN.braid_angle) / (2 * np.pi * MCKIBBEN.radius)
    growth = np.sqrt(fibre**2 - length**2) / (2 * np.pi * turns) - MCKIBBEN.radius
    end = MCKIBBEN.taper * growth

    def section(x):
        s = min(min(x, length - x) / end, 1.0)
        return np.pi * (MCKIBBEN.radius + growth * (2 * s - s**2)) ** 2

    swept = 2 * quad(section, 0, end)[0] + quad(section, end, length - end)[0]
    assert float(volume(MCKIBBEN, np.float64(strain))) == pytest.approx(swept, rel=1e-8)


@settings(deadline=None)
@given(alpha=st.floats(1e-3, 1.57), pressure=pressures)
def test_the_peano_solver_returns_to_the_angle_that_it_is_given(alpha, pressure):
    """From an angle follow strain and force in closed form; the solver has to find that force from the strain alone."""
    driving = float(effective_pressure(pressure, PEANO.threshold, PEANO.threshold_width))
    width = PEANO.tube_width
    across = PEANO.tube_length - 2 * PEANO.end_loss * width * np.sin(alpha)
    force = driving * width * across * np.cos(alpha) / alpha - PEANO.bending * alpha
    strain = 1 - np.sin(alpha) / alpha - force / PEANO.stiffness
    assert float(PEANO.force(pressure, strain)) == pytest.approx(force, rel=1e-9, abs=1e-7)


def test_a_muscle_that_never_stops_pulling_is_refused():
    endless = muscle_of(McKibbenMuscle(kind="mckibben", braid_angle=12.0, c10=0.0, c01=0.0, taper=0.0))
    with pytest.raises(SpecError, match=r"does not vanish between strains -0\.02 and 0\.36.*\n.*lower the pressure"):
        free_strain(endless, 500e3)
