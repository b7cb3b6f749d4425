"""The step response against the laws that it must obey and against what M2 says of its data."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, trapezoid
from scipy.signal import find_peaks

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.rig.chamber import ATMOSPHERE, Braid, Tubes
from mapmore_cli.rig.mckibben import volume
from mapmore_cli.rig.muscle import stop, stop_rates
from mapmore_cli.rig.step_response import Bumper, StepTimes, step_response
from mapmore_cli.rig.wet_muscle import Wall, integrate
from mapmore_cli.spec.loader import load_as
from mapmore_cli.spec.simulation import SimulationSpec
from mapmore_cli.study.simulate import step_rig_of

DATASETS = Path(__file__).parents[2] / "datasets"
KINDS = ("mckibben", "peano")
TIMES = StepTimes(rest=0.1, hold=2.5, fall=0.8, sample_time=0.001)
VALIDATION = {"mckibben": 250e3, "peano": 350e3}  # Pa, of 115 N
WEIGHT = 115.0
BUMPER = Bumper(stiffness=3e5, damping=6.0, pretension=0.7)
both = pytest.mark.parametrize("kind", KINDS)


@cache
def rig(kind):
    spec = load_as(DATASETS / kind / "step_responses.yaml", SimulationSpec).spec
    return step_rig_of(spec, spec.experiment)[0]


@cache
def response(kind):
    return step_response(rig(kind), TIMES, VALIDATION[kind], WEIGHT)


def swollen(kind, pressure, strain):
    """Water in muscle, wall and bubble, m3, less a constant."""
    muscle = rig(kind).muscle
    chamber = muscle.chamber
    if isinstance(chamber, Braid):
        inside = float(volume(chamber.muscle, np.asarray(strain)))
    else:
        assert isinstance(chamber, Tubes)
        inside = quad(lambda p: chamber.respond(p, strain).filling, 0, pressure, points=[1, 30, 1e3, 1e4], limit=500)[0]
        inside += quad(lambda e: chamber.respond(0.0, e).displacement, -1e-3, strain, points=[0.0, 1e-3], limit=500)[0]
    bubble = muscle.plumbing.trapped_air * ATMOSPHERE / (ATMOSPHERE + pressure)
    return inside + muscle.wall.compliance * pressure - bubble


@both
def test_water_is_conserved(kind):
    """All that came through the tube until the plateau is in the muscle."""
    truth = response(kind)
    end = 2590
    came = trapezoid(truth["flow"][: end + 1], truth["time"][: end + 1])
    there = swollen(kind, truth["muscle_pressure"][end], truth["strain"][end]) - swollen(kind, 0.0, truth["strain"][0])
    assert came > 5e-6
    assert there == pytest.approx(came, rel=5e-3)


@both
def test_the_plateau_is_an_equilibrium_within_the_friction(kind):
    truth, muscle = response(kind), rig(kind).muscle
    at_end = {name: float(values[2400:2590].mean()) for name, values in truth.items()}
    assert at_end["force"] == pytest.approx(WEIGHT, rel=5e-3)
    assert at_end["pressure"] == pytest.approx(VALIDATION[kind], rel=5e-3)
    assert at_end["muscle_pressure"] == pytest.approx(at_end["pressure"], rel=5e-3)
    static = float(muscle.chamber.muscle.force(at_end["muscle_pressure"], at_end["strain"]))
    assert abs(static - WEIGHT) < float(muscle.hysteresis.half_width(VALIDATION[kind])) + 0.01 * WEIGHT
    assert np.ptp(truth["strain"][2400:2590]) < 0.01 * at_end["strain"]


def test_the_mckibben_rings_as_slowly_as_measured():
    """M2 section 5.3: 3.4 Hz on the plateau at 250 kPa."""
    strain = response("mckibben")["strain"][600:2400]
    peaks, _ = find_peaks(strain, prominence=5e-5)
    assert len(peaks) >= 3
    assert 1.0 / (1e-3 * np.diff(peaks).mean()) == pytest.approx(3.4, rel=0.15)


def test_the_peano_fills_before_it_moves():
    """M2 section 6.3: force, but no motion to speak of, for the first 0.09 s."""
    truth = response("peano")
    moved = truth["strain"] - truth["strain"][0]
    still = int(np.argmax(moved > 0.02 * moved[2500]))
    assert 1e-3 * (still - 100) == pytest.approx(0.09, rel=0.15)
    assert truth["force"][still] > 0.3 * WEIGHT
    assert trapezoid(truth["flow"][100:still], truth["time"][100:still]) > 1e-6


@both
def test_a_finer_integration_changes_less_than_the_sensors_see(kind):
    short = StepTimes(rest=0.02, hold=0.6, fall=0.3, sample_time=0.001)
    coarse, fine = (step_response(rig(kind), short, VALIDATION[kind], WEIGHT, tolerance) for tolerance in (1e-6, 5e-7))
    for name, noise in (("pressure", 400.0), ("muscle_pressure", 400.0), ("strain", 2e-5), ("force", 0.7), ("flow", 3e-7)):
        assert np.abs(coarse[name] - fine[name]).max() < noise, name


@settings(deadline=None)
@given(depth=st.floats(-0.01, 0.01), speed=st.floats(-5, 5))
def test_the_stop_never_gives_energy(depth, speed):
    """It only pushes, and takes at least the power of a loss-free spring, which gives back what it takes on a closed path."""
    spring = Bumper(BUMPER.stiffness, 0.0, BUMPER.pretension)
    assert BUMPER.push(depth, speed) >= 0
    assert BUMPER.push(depth, speed) * speed >= spring.push(depth, 0.0) * speed - 1e-9


def test_a_wall_bulges_late_and_both_its_laws_agree():
    wall = Wall(compliance=2e-12, relaxation_time=0.01)
    assert wall.growth(2e-7, 1e5) == 0
    assert wall.pressure(1e-7, wall.growth(1e-7, 3e5)) == pytest.approx(3e5)
    path = integrate(lambda _, bulge: np.array([wall.growth(bulge[0], 1e5)]), np.zeros(1), np.linspace(0, 0.01, 11), np.array([1e-7]))
    assert path[-1, 0] == pytest.approx(2e-7 * (1 - np.exp(-1)), rel=1e-4)


def test_moving_stop_operators_are_those_of_the_path():
    yields = np.array([0.001, 0.004, 0.016])
    time = np.linspace(0, 1, 2001)
    moved = integrate(lambda t, states: stop_rates(states, yields, 0.1 * np.cos(6 * t)), np.zeros(3), time, np.ones(3))
    np.testing.assert_allclose(moved, stop(0.1 * np.sin(6 * time) / 6, yields), atol=2e-3)


def test_equations_that_explode_are_reported():
    with pytest.raises(SpecError, match=r"could not be solved.*\n.*nearer to their defaults"):
        integrate(lambda _, state: state**2, np.array([1.0]), np.linspace(0, 2, 11), np.ones(1))
