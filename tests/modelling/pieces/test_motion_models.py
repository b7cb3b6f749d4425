"""Models of motion: segments by direction and pressure, sums, damping as what a static model leaves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from surfaces import recipe as settings_of

from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.models import Model, Part
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling.kinds import equations as model_equations
from mapmore_cli.modelling.kinds import outside_range, predict
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.recipe import CutByDirection, Recipe
from mapmore_cli.modelling.pieces.segmentation import trained_at
from mapmore_cli.modelling.signals.plateau import damping_component
from mapmore_cli.modelling.sums.joint import sum_of

QUANTITIES = {
    name: Quantity(name, unit)
    for name, unit in {"pressure": "kPa", "strain_rate": "1/s", "direction": "1", "damping": "N", "force": "N", "strain": "1"}.items()
}


def curve(level: float, seed: int = 0, **columns: np.ndarray) -> Curve:
    """A step response at one pressure; its damping is what `columns` says, else one."""
    rng = np.random.default_rng(seed)
    n = 400
    way = np.repeat([1.0, -1.0], n // 2)
    rate = way * rng.uniform(0.1, 1.0, n)
    pressure = rng.uniform(0.0, level, n)
    base = {"pressure": pressure, "strain_rate": rate, "direction": way, "damping": np.ones(n), "strain": rng.uniform(0, 0.2, n)}
    given_or_base = {**base, **columns}
    return Curve(f"step_pressure={level:g}", level, given_or_base, np.zeros(n, bool), (f"r{level:g}",), np.zeros(n, bool))


def recipe(level: str | None, terms: tuple[str, ...]) -> Recipe:
    cuts = {"direction": CutByDirection("pressure", 1.0)}
    return settings_of(target="damping", level=level, cuts=cuts, dictionary=terms, scaling="max_abs")


def constant_pieces() -> Model:
    """Directions x pressures, every segment function equal to one."""
    return build("ones", [curve(p) for p in (80.0, 150.0, 350.0)], recipe("pressure", ("1",)), QUANTITIES)


@given(st.lists(st.tuples(st.floats(-50, 600), st.sampled_from([-1.0, 1.0])), min_size=1, max_size=30))
def test_weights_of_direction_and_pressure_sum_to_one(points: list[tuple[float, float]]) -> None:
    pressure, way = (np.array(values) for values in zip(*points, strict=True))
    found = predict(constant_pieces(), {"pressure": pressure, "direction": way})
    assert np.allclose(found, 1.0, atol=1e-12)


def test_each_direction_has_terms_of_its_own() -> None:
    one = curve(350.0)
    x, way = one.columns["strain_rate"], one.columns["direction"]
    planted = np.where(way > 0, -30.0 * x, 7.0 * x**2)
    model = build("d", [curve(350.0, damping=planted)], recipe(None, ("strain_rate", "strain_rate^2")), QUANTITIES)
    assert {e.id: e.text for e in model_equations(model)} == {
        "step_pressure=350;direction=fall/all": "7*strain_rate^2",
        "step_pressure=350;direction=rise/all": "-30*strain_rate",
    }
    assert np.allclose(predict(model, one.columns), planted)
    in_ms = model_equations(model, {"strain_rate": 1000.0})
    assert in_ms[0].text == "7e+06*strain_rate^2"


def test_a_direction_that_never_occurs_is_refused() -> None:
    rising = curve(350.0)
    up = Curve("up", 350.0, {**rising.columns, "direction": np.ones(rising.size)}, rising.held_out, ("r",))
    with pytest.raises(DataError, match="direction=fall"):
        build("d", [up], recipe(None, ("strain_rate",)), QUANTITIES)


def test_one_level_trains_the_pieces() -> None:
    """`highest` is the highest that trains: 350 kPa is held out here."""
    curves = [curve(p, damping=np.full(400, p)) for p in (80.0, 150.0, 350.0)]
    held = Curve(curves[2].id, 350.0, curves[2].columns, np.ones(400, bool), curves[2].recordings, curves[2].at_rest)
    model = build("d", trained_at([*curves[:2], held], "highest"), recipe(None, ("1",)), QUANTITIES)
    assert np.allclose(predict(model, curves[0].columns), 150.0)
    assert np.allclose(predict(build("d", trained_at(curves, 80.0), recipe(None, ("1",)), QUANTITIES), curves[0].columns), 80.0)


def test_the_plateau_never_trains() -> None:
    one = curve(350.0)
    resting = np.arange(one.size) % 3 == 0
    spoilt = Curve(one.id, 350.0, {**one.columns, "damping": np.where(resting, 1e6, 1.0)}, one.held_out, one.recordings, resting)
    model = build("d", [spoilt], recipe(None, ("1",)), QUANTITIES)
    assert np.allclose(predict(model, one.columns), 1.0)


def test_the_steady_state_is_taken_from_each_recording_by_itself() -> None:
    """Two recordings at one pressure, whose static models err by 3 and by -5 N."""
    one = curve(350.0)
    origin = np.repeat([0, 1], 200)
    at_rest = np.arange(400) % 200 >= 150
    both = Curve(one.id, 350.0, one.columns, one.held_out, ("a", "b"), at_rest, origin)
    moving = np.where(at_rest, 0.0, one.columns["strain_rate"])
    assert np.allclose(damping_component(moving + np.where(origin == 0, 3.0, -5.0), both), moving)


def test_a_sum_adds_its_models_and_their_ranges() -> None:
    static = build(
        "s",
        [curve(100.0, force=np.full(400, 5.0))],
        settings_of(target="force", level=None, cuts={}, dictionary=("strain",), scaling="max_abs"),
        QUANTITIES,
    )
    damping = build("d", [curve(350.0)], recipe(None, ("strain_rate",)), QUANTITIES)
    total = sum_of("t", [Part(static), Part(damping)], QUANTITIES["force"], QUANTITIES)
    columns = curve(350.0, seed=5).columns
    assert [quantity.name for quantity in total.inputs] == ["direction", "strain", "strain_rate"]
    assert np.array_equal(predict(total, columns), predict(static, columns) + predict(damping, columns))
    assert np.array_equal(outside_range(total, columns), outside_range(static, columns) | outside_range(damping, columns))
    assert [e.id.split(":")[0] for e in model_equations(total)] == ["s", "d", "d"]


def test_a_sum_of_two_units_is_refused() -> None:
    damping = build("d", [curve(350.0)], recipe(None, ("strain_rate",)), QUANTITIES)
    with pytest.raises(SpecError, match="in N, the force of this study in kN"):
        sum_of("t", [Part(damping)], Quantity("force", "kN"), QUANTITIES)
    with pytest.raises(SpecError, match="function of direction"):
        sum_of("t", [Part(damping)], QUANTITIES["force"], {})
