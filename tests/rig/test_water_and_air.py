from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.rig.chamber import ATMOSPHERE, Reservoir, bubble_compliance, valve_flow
from mapmore_cli.rig.wet_muscle import WATER_DENSITY, WATER_VISCOSITY, Pipe

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
