"""Pull and volume belong together; water and air obey their laws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from mapmore_cli.rig.chamber import (
    ATMOSPHERE,
    Braid,
    Chamber,
    Reservoir,
    Tubes,
    bubble_compliance,
    geometric_slope_ratio,
    geometric_strain,
    opening,
    opening_angle,
    valve_flow,
)
from mapmore_cli.rig.mckibben import volume
from mapmore_cli.rig.muscle import effective_pressure, effective_pressure_slope
from mapmore_cli.rig.wet_muscle import WATER_DENSITY, WATER_VISCOSITY, Pipe
from mapmore_cli.spec.muscle_rigs import McKibbenMuscle, PeanoMuscle
from mapmore_cli.study.simulate import braid_of, chamber_of, tube_of

BRAID = Braid(braid_of(McKibbenMuscle(kind="mckibben")))
TUBES = Tubes(tube_of(PeanoMuscle(kind="peano")), 4)
pressures = st.floats(1e3, 6e5)
strains = st.floats(0.0, 0.25)


def test_the_shipped_muscles_have_the_papers_lengths():
    for spec, length in ((McKibbenMuscle(kind="mckibben"), 0.088), (PeanoMuscle(kind="peano"), 0.069)):
        chamber: Chamber = chamber_of(spec)
        assert chamber.length == pytest.approx(length)


@settings(deadline=None)
@given(pressure=st.floats(0, 6e5), strain=st.floats(-0.005, 0.25))
def test_the_tension_is_the_static_force(pressure, strain):
    for chamber in (BRAID, TUBES):
        assert chamber.respond(pressure, strain).tension == pytest.approx(float(chamber.muscle.force(pressure, strain)), rel=1e-6, abs=1e-5)


@settings(deadline=None)
@given(pressure=pressures, strain=strains)
def test_the_tubes_do_as_much_work_as_the_water(pressure, strain):
    """Virtual work: `L0 dF/dP_e` at constant strain is `dV/de` at constant pressure."""
    width = TUBES.muscle.threshold_width
    step = 1e-4 * pressure
    low, high = (TUBES.respond(at, strain).tension for at in (pressure - step, pressure + step))
    driven = float(effective_pressure(pressure + step, 6e3, width) - effective_pressure(pressure - step, 6e3, width))
    assert TUBES.length * (high - low) / driven == pytest.approx(TUBES.respond(pressure, strain).displacement, rel=1e-4)


@settings(deadline=None)
@given(pressure=pressures, strain=strains)
def test_the_tubes_volume_is_a_state(pressure, strain):
    """Whichever way pressure and strain are reached, the volume is the same: the slopes are those of one function."""
    dp, de = 1e-4 * pressure, 1e-6
    crossed = (TUBES.respond(pressure, strain + de).filling - TUBES.respond(pressure, strain - de).filling) / (2 * de)
    back = (TUBES.respond(pressure + dp, strain).displacement - TUBES.respond(pressure - dp, strain).displacement) / (2 * dp)
    assert crossed == pytest.approx(back, rel=1e-3, abs=1e-14)


def test_a_locked_tube_fills_to_the_area_between_its_arcs():
    """`n D w^2 (alpha - sin(alpha) cos(alpha))/(2 alpha^2)`, of tubes whose ends take nothing away."""
    open_ended = Tubes(replace(TUBES.muscle, end_loss=0.0), 4)
    driving = float(effective_pressure(2e5, 6e3, 3e3))
    alpha = opening_angle(open_ended.muscle, driving, 0.0)
    area = open_ended.muscle.tube_width**2 * (alpha - np.sin(alpha) * np.cos(alpha)) / (2 * alpha**2)
    filled = quad(lambda pressure: open_ended.respond(pressure, 0.0).filling, 0, 2e5, points=[1, 30, 1e3, 1e4], limit=500)[0]
    assert filled == pytest.approx(4 * 0.046 * area, rel=1e-4)
    assert 1e-6 < filled < 20e-6


def test_the_braid_moves_the_volume_within_it():
    moved = quad(lambda strain: BRAID.respond(1e5, strain).displacement, 0.0, 0.2)[0]
    assert moved == pytest.approx(float(volume(BRAID.muscle, np.asarray(0.2)) - volume(BRAID.muscle, np.asarray(0.0))), rel=1e-6)
    assert BRAID.respond(1e5, 0.1).filling == 0


@settings(deadline=None)
@given(pressure=st.floats(-9e4, 6e5), strain=st.floats(-0.01, 0.25))
def test_no_chamber_swells_when_it_is_sucked(pressure, strain):
    for chamber in (BRAID, TUBES):
        response = chamber.respond(pressure, strain)
        assert np.all(np.isfinite(response))
        assert response.filling >= 0
        assert response.displacement >= 0


@settings(deadline=None)
@given(driving=st.floats(0, 6e5), strain=st.floats(-0.01, 0.25))
def test_one_angle_is_found_as_many_are(driving, strain):
    many = float(opening(TUBES.muscle, np.asarray(driving), np.asarray(strain)))
    assert opening_angle(TUBES.muscle, driving, strain) == pytest.approx(many, abs=2e-9)


@settings(deadline=None)
@given(alpha=st.floats(1e-3, 1.57) | st.floats(9.9e-3, 1.01e-2))
def test_the_slope_ratio_belongs_to_the_geometric_strain(alpha):
    h = 1e-4 * alpha
    slope = float(geometric_strain(np.asarray(alpha + h)) - geometric_strain(np.asarray(alpha - h))) / (2 * h)
    assert geometric_slope_ratio(alpha) * alpha == pytest.approx(slope, rel=1e-5, abs=1e-12 / h)


@pytest.mark.parametrize("pressure", [-5e4, 0.0, 2e3, 2.2e4, 1e5, 5e5])
def test_the_slope_of_the_effective_pressure(pressure):
    numeric = float(effective_pressure(pressure + 1, 2.2e4, 8e3) - effective_pressure(pressure - 1, 2.2e4, 8e3)) / 2
    assert effective_pressure_slope(pressure, 2.2e4, 8e3) == pytest.approx(numeric, abs=1e-9)


TUBE = Pipe(length=0.5, diameter=0.0045, loss=0.0)
RESERVOIR = Reservoir(air_volume=2e-4, polytropic=1.2, supply_conductance=0.4e-8, exhaust_conductance=1e-8, critical_ratio=0.3)
absolute = st.floats(2e4, 1e6)


def flow_at(reynolds: float) -> float:
    return reynolds * WATER_VISCOSITY * TUBE.area / (WATER_DENSITY * TUBE.diameter)


@pytest.mark.parametrize(
    ("reynolds", "friction_factor"), [(10, 64 / 10), (200, 64 / 200), (2e4, 0.316 * 2e4**-0.25), (1e5, 0.316 * 1e5**-0.25)]
)
def test_friction_is_poiseuilles_and_blasius(reynolds, friction_factor):
    speed = flow_at(reynolds) / TUBE.area
    expected = friction_factor * TUBE.length / TUBE.diameter * 0.5 * WATER_DENSITY * speed**2
    assert TUBE.drop(flow_at(reynolds)) == pytest.approx(expected, rel=2e-3)


@settings(deadline=None)
@given(flow=st.floats(0, 1e-3), more=st.floats(1e-8, 1e-4))
def test_a_drop_opposes_its_flow_and_grows_with_it(flow, more):
    pipe = Pipe(length=0.3, diameter=0.01, loss=3.0)
    assert pipe.drop(-flow) == -pipe.drop(flow)
    assert pipe.drop(flow + more) > pipe.drop(flow)


@settings(deadline=None)
@given(first=absolute, second=absolute)
def test_a_valve_has_no_preferred_direction_and_flows_downhill(first, second):
    flow = valve_flow(1e-8, 0.3, first, second)
    assert flow == -valve_flow(1e-8, 0.3, second, first)
    assert flow * (first - second) >= 0
    assert abs(flow) <= 1e-8 * max(first, second)


def test_a_choked_valve_does_not_feel_what_lies_behind_it():
    assert valve_flow(1e-8, 0.3, 5e5, 1.5e5) == valve_flow(1e-8, 0.3, 5e5, 1e4) == pytest.approx(1e-8 * 5e5)


def test_a_closed_reservoir_gains_what_the_valve_lets_in():
    """Without water flow, isothermal: `dP V = p0 q dt`."""
    isothermal = Reservoir(2e-4, 1.0, 0.4e-8, 1e-8, 0.3)
    assert isothermal.rate(1e5, 0.0, 1e-4) * 2e-4 == pytest.approx(ATMOSPHERE * 1e-4)
    assert isothermal.rate(1e5, 1e-5, 0.0) == pytest.approx(-(1e5 + ATMOSPHERE) * 1e-5 / 2e-4)


def test_supply_fills_to_its_own_pressure_and_exhaust_to_none():
    assert RESERVOIR.supplied(1e5, 3e5) > 0 > RESERVOIR.supplied(4e5, 3e5)
    assert RESERVOIR.supplied(3e5, 3e5) == 0 == RESERVOIR.exhausted(0.0)
    assert RESERVOIR.exhausted(1e5) < 0 < RESERVOIR.exhausted(-1e4)


@settings(deadline=None)
@given(pressure=st.floats(-8e4, 1e6))
def test_a_bubble_obeys_boyles_law(pressure):
    def volume(gauge: float) -> float:
        return 1e-6 * ATMOSPHERE / (ATMOSPHERE + gauge)

    slope = (volume(pressure - 10) - volume(pressure + 10)) / 20
    assert bubble_compliance(1e-6, pressure) == pytest.approx(slope, rel=1e-4)
