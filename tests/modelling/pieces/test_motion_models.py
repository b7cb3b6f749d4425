"""Models of motion: segments by direction and pressure, damping as what a static model leaves."""

from dataclasses import replace

import numpy as np
import pytest
from common import curve_of
from surfaces import recipe as settings_of

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.kinds import equations as model_equations
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.recipe import CutByDirection
from mapmore_cli.modelling.signals.plateau import damping_component

QUANTITIES = {
    name: Quantity(name, unit)
    for name, unit in {
        "pressure": "kPa",
        "strain_rate": "1/s",
        "direction": "1",
        "damping": "N",
    }.items()
}


def curve(level, **columns):
    """A step response at one pressure; its damping is what `columns` says, else one."""
    rng = np.random.default_rng(0)
    way = np.repeat([1.0, -1.0], 200)
    base = {
        "strain_rate": way * rng.uniform(0.1, 1.0, 400),
        "pressure": rng.uniform(0.0, level, 400),
        "direction": way,
    }
    made = curve_of({**base, "damping": np.ones(400), **columns}, name=f"step_pressure={level:g}")
    return replace(made, level=level)


def built(curves, level, *terms):
    cuts = {"direction": CutByDirection("pressure", 1.0)}
    made = settings_of(
        target="damping", level=level, cuts=cuts, dictionary=terms, scaling="max_abs"
    )
    return build("d", curves, made, QUANTITIES)


def test_each_direction_has_terms_of_its_own():
    one = curve(350.0)
    x, way = one.columns["strain_rate"], one.columns["direction"]
    planted = np.where(way > 0, -30.0 * x, 7.0 * x**2)
    model = built([curve(350.0, damping=planted)], None, "strain_rate", "strain_rate^2")
    assert {e.id: e.text for e in model_equations(model)} == {
        "step_pressure=350;direction=fall/all": "7*strain_rate^2",
        "step_pressure=350;direction=rise/all": "-30*strain_rate",
    }
    assert np.allclose(predict(model, one.columns), planted)
    in_ms = model_equations(model, {"strain_rate": 1000.0})
    assert in_ms[0].text == "7e+06*strain_rate^2"


def test_a_direction_that_never_occurs_is_refused():
    with pytest.raises(DataError, match="direction=fall"):
        built([curve(350.0, direction=np.ones(400))], None, "strain_rate")


def test_the_plateau_never_trains():
    resting = np.arange(400) % 3 == 0
    spoilt = replace(curve(350.0, damping=np.where(resting, 1e6, 1.0)), at_rest=resting)
    assert np.allclose(predict(built([spoilt], None, "1"), spoilt.columns), 1.0)


def test_the_steady_state_is_taken_from_each_recording_by_itself():
    """Two recordings at one pressure, whose static models err by 3 and by -5 N."""
    one = curve(350.0)
    origin = np.repeat([0, 1], 200)
    at_rest = np.arange(400) % 200 >= 150
    both = replace(one, recordings=("a", "b"), at_rest=at_rest, origin=origin)
    moving = np.where(at_rest, 0.0, one.columns["strain_rate"])
    off = moving + np.where(origin == 0, 3.0, -5.0)
    assert np.allclose(damping_component(off, both), moving)
    assert damping_component(off, one) is off  # there is no plateau
