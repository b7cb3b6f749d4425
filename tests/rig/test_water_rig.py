"""Water, air and stop against their laws; step responses and strokes against what M2 says of its
data.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rig_cases import BRAID, MUSCLES, both, spec
from scipy.integrate import quad, trapezoid
from scipy.signal import find_peaks

from datasets.rig.air import ATMOSPHERE, Reservoir, valve_flow
from datasets.rig.load_cycle import perturbation
from datasets.rig.sensors import integrate, low_pass
from datasets.rig.static_muscles import volume
from datasets.rig.step_response import Bumper, PressureStep, step_response
from datasets.rig.water import (
    WATER_DENSITY,
    WATER_VISCOSITY,
    Pipe,
    WetMuscle,
    bubble_compliance,
)
from mapmore_cli.domain.errors import SpecError

TUBE = Pipe(length=0.5, diameter=0.0045, loss=0.0)
RESERVOIR = Reservoir(
    air_volume=2e-4,
    polytropic=1.2,
    supply_conductance=0.4e-8,
    exhaust_conductance=1e-8,
    critical_ratio=0.3,
)
absolute = st.floats(2e4, 1e6)


def flow_at(reynolds):
    return reynolds * WATER_VISCOSITY * TUBE.area / (WATER_DENSITY * TUBE.diameter)


@pytest.mark.parametrize(
    ("reynolds", "friction_factor"),
    [(10, 64 / 10), (200, 64 / 200), (2e4, 0.316 * 2e4**-0.25), (1e5, 0.316 * 1e5**-0.25)],
)
def test_friction_is_poiseuilles_and_blasius(reynolds, friction_factor):
    speed = flow_at(reynolds) / TUBE.area
    expected = friction_factor * TUBE.length / TUBE.diameter * 0.5 * WATER_DENSITY * speed**2
    assert TUBE.drop(flow_at(reynolds)) == pytest.approx(expected, rel=2e-3)


@given(first=absolute, second=absolute)
def test_a_valve_has_no_preferred_direction_and_flows_downhill(first, second):
    flow = valve_flow(1e-8, 0.3, first, second)
    assert flow == -valve_flow(1e-8, 0.3, second, first)
    assert flow * (first - second) >= 0
    assert abs(flow) <= 1e-8 * max(first, second)


def test_a_choked_valve_does_not_feel_what_lies_behind_it():
    assert (
        valve_flow(1e-8, 0.3, 5e5, 1.5e5)
        == valve_flow(1e-8, 0.3, 5e5, 1e4)
        == pytest.approx(1e-8 * 5e5)
    )


def test_a_closed_reservoir_gains_what_the_valve_lets_in():
    """Without water flow, isothermal: `dP V = p0 q dt`."""
    isothermal = replace(RESERVOIR, polytropic=1.0)
    assert isothermal.rate(1e5, 0.0, 1e-4) * 2e-4 == pytest.approx(ATMOSPHERE * 1e-4)
    assert isothermal.rate(1e5, 1e-5, 0.0) == pytest.approx(-(1e5 + ATMOSPHERE) * 1e-5 / 2e-4)


def test_supply_fills_to_its_own_pressure_and_exhaust_to_none():
    assert RESERVOIR.supplied(1e5, 3e5) > 0 > RESERVOIR.supplied(4e5, 3e5)
    assert RESERVOIR.supplied(3e5, 3e5) == 0 == RESERVOIR.exhausted(0.0)
    assert RESERVOIR.exhausted(1e5) < 0 < RESERVOIR.exhausted(-1e4)


@given(pressure=st.floats(-8e4, 1e6))
def test_a_bubble_obeys_boyles_law(pressure):
    def volume(gauge):
        return 1e-6 * ATMOSPHERE / (ATMOSPHERE + gauge)

    slope = (volume(pressure - 10) - volume(pressure + 10)) / 20
    assert bubble_compliance(1e-6, pressure) == pytest.approx(slope, rel=1e-4)


VALIDATION = {"mckibben": 250e3, "peano": 350e3}  # Pa, of 115 N
WEIGHT = 115.0
BUMPER = Bumper(stiffness=3e5, damping=6.0, pretension=0.7)


def wet_muscle(found):
    return WetMuscle(
        found.muscle, found.hysteresis, found.experiment.rig.rubber, found.experiment.rig
    )


@cache
def rig(kind, *changes):
    found = spec(f"{kind}/step_responses", *changes)
    return found.experiment, wet_muscle(found)


@cache
def response(kind):
    return step_response(*rig(kind), PressureStep(VALIDATION[kind], WEIGHT))


def swollen(kind, pressure, strain):
    """Water in muscle, wall and bubble, m3, less a constant."""
    wet, muscle = rig(kind)[1], MUSCLES[kind]
    if muscle is BRAID:
        inside = float(volume(muscle, np.asarray(strain)))
    else:
        inside = quad(
            lambda p: muscle.respond(p, strain).filling,
            0,
            pressure,
            points=[1, 30, 1e3, 1e4],
            limit=500,
        )[0]
        inside += quad(
            lambda e: muscle.respond(0.0, e).displacement,
            -1e-3,
            strain,
            points=[0.0, 1e-3],
            limit=500,
        )[0]
    bubble = wet.rig.trapped_air * ATMOSPHERE / (ATMOSPHERE + pressure)
    return inside + wet.rig.wall.compliance * pressure - bubble


@both
def test_water_is_conserved(kind):
    """All that came through the tube until the plateau is in the muscle."""
    truth = response(kind)
    end = 2590
    came = trapezoid(truth["flow"][: end + 1], truth["time"][: end + 1])
    there = swollen(kind, truth["muscle_pressure"][end], truth["strain"][end]) - swollen(
        kind, 0.0, truth["strain"][0]
    )
    assert came > 5e-6
    assert there == pytest.approx(came, rel=5e-3)


@both
def test_the_plateau_is_an_equilibrium_within_the_friction(kind):
    truth, muscle = response(kind), rig(kind)[1]
    at_end = {name: float(values[2400:2590].mean()) for name, values in truth.items()}
    assert at_end["force"] == pytest.approx(WEIGHT, rel=5e-3)
    assert at_end["pressure"] == pytest.approx(VALIDATION[kind], rel=5e-3)
    assert at_end["muscle_pressure"] == pytest.approx(at_end["pressure"], rel=5e-3)
    static = float(muscle.muscle.force(at_end["muscle_pressure"], at_end["strain"]))
    assert (
        abs(static - WEIGHT) < float(muscle.hysteresis.half_width(VALIDATION[kind])) + 0.01 * WEIGHT
    )
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


@given(depth=st.floats(-0.01, 0.01), speed=st.floats(-5, 5))
def test_the_stop_never_gives_energy(depth, speed):
    """It only pushes, and takes at least the power of a loss-free spring, which gives back what it
    takes on a closed path.
    """
    spring = Bumper(BUMPER.stiffness, 0.0, BUMPER.pretension)
    assert BUMPER.push(depth, speed) >= 0
    assert BUMPER.push(depth, speed) * speed >= spring.push(depth, 0.0) * speed - 1e-9


def test_equations_that_explode_are_reported():
    with pytest.raises(SpecError, match=r"could not be solved.*\n.*nearer to their defaults"):
        integrate(lambda _, state: state**2, np.array([1.0]), np.linspace(0, 2, 11), np.ones(1))


TWO_MOVES = "experiment.moves=[1.0, 0.3]"


def strokes(kind, *changes):
    found = spec(f"{kind}/perturbations", *changes)
    return perturbation(wet_muscle(found), found.experiment, 350e3)


@both
def test_a_slow_stroke_is_a_load_cycle(kind):
    """Slowly, what is left is the static force and at most the half-width of the friction."""
    changes = ("moves=[3]", "dwell=0.3", "sample_time=0.01", "rig.load_cell=20")
    slow = strokes(kind, *(f"experiment.{change}" for change in changes))
    away = slow["force"] - MUSCLES[kind].force(350e3, slow["strain"])
    assert (
        np.abs(away).max() < float(spec(f"{kind}/perturbations").hysteresis.half_width(350e3)) * 1.1
    )
    assert away[100:300].mean() > 0 > away[400:600].mean()


def test_the_amplifier_passes_slow_forces_and_halves_the_power_at_its_cut_off():
    time = 1e-3 * np.arange(4000)
    for frequency, gain in ((0.5, 1.0), (40.0, np.sqrt(0.5))):
        passed = low_pass(np.sin(2 * np.pi * frequency * time), 40.0, 1e-3)[2000:]
        assert passed.std() * np.sqrt(2) == pytest.approx(gain, rel=0.05)


def test_the_amplifier_neither_rings_nor_turns_a_pull_into_a_push():
    step = np.where(np.arange(200) < 100, 1000.0, 0.0)
    passed = low_pass(step, 40.0, 1e-3)
    assert passed[:100] == pytest.approx(1000.0)
    assert np.all(np.diff(passed) <= 1e-9)
    assert passed[-1] == pytest.approx(0.0, abs=1e-6)
    assert passed.min() >= -1e-9
