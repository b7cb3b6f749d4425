"""The inverse finds every solution that a fine scan finds, also the force of a model of the strain;
derivatives agree with differences.
"""

from dataclasses import replace

import numpy as np
import pytest
from agreement import edges_of, points
from export_samples import FORMULAS, STATIC, WITH_MEMORY
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import built, curves

from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.inverse import (
    _Line,
    invert,
    knots,
    may_turn_twice,
    parts_between,
    solve_for_input,
)
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.programs import slopes

INVERTED = [
    ("straight beyond the levels", "pressure"),
    ("straight beyond the levels", "strain"),
    ("backbone, shrunken", "pressure"),
]


@pytest.mark.parametrize(("name", "of"), INVERTED)
def test_every_solution_of_a_fine_scan_is_found(name, of):
    model = STATIC[name]
    rng = np.random.default_rng(4)
    ends = knots(model, of)
    other = "strain" if of == "pressure" else "pressure"
    given = {other: rng.uniform(*{"strain": (0.03, 0.2), "pressure": (110.0, 480.0)}[other], 8)}
    at = {of: rng.uniform(ends[0], ends[-1], 8), **given}
    wanted = predict(model, at)
    found = invert(model, wanted, given, of)
    back = predict(model, {of: found.values, other: given[other][found.rows]})
    assert np.all(
        np.abs(back - wanted[found.rows]) <= 1e-6 * np.maximum(np.abs(wanted[found.rows]), 1.0)
    )
    fine = np.linspace(ends[0], ends[-1], 4_001)
    for row in range(8):
        own = found.values[found.rows == row]
        assert np.all(np.diff(own) > 0)
        values = (
            predict(model, {of: fine, other: np.full(len(fine), given[other][row])}) - wanted[row]
        )
        crossings = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
        step = np.abs(np.diff(values))
        for i in crossings:
            if step[i] < 20 * np.median(step) + 1e-9:  # a jump is no solution
                assert np.min(np.abs(own - fine[i])) <= 2 * (fine[1] - fine[0]), (row, fine[i], own)
        flat = found.status[row] == "flat"
        assert flat or found.status[row] == ("one" if len(own) == 1 else "several")
        assert found.picked[row] == own[0]


def test_out_of_reach_flat_and_the_nearest_rule():
    model = STATIC["values"]
    none = invert(model, np.array([1e9]), {"strain": np.array([0.1])}, "pressure")
    assert none.status == ("none",)
    assert np.isnan(none.picked).all()
    slack = STATIC["no levels"]
    assert invert(slack, predict(slack, {"strain": np.array([0.1])}), {}, "strain").status[0] in (
        "one",
        "several",
    )
    several = STATIC["straight beyond the levels"]
    asked = np.full(12, 150.0), {"strain": np.linspace(0.02, 0.2, 12)}, "pressure"
    every = [invert(several, *asked, *rule) for rule in (("nearest",), ())]
    before = None
    for row, (nearest, lowest) in enumerate(zip(*(one.picked for one in every), strict=True)):
        own = every[0].values[every[0].rows == row].tolist()
        if own:
            before = own[0] if before is None else min(own, key=lambda x, at=before: abs(x - at))
            assert (nearest, lowest) == (before, own[0])


def test_some_rows_at_a_time_give_what_all_give(monkeypatch):
    asked = np.full(12, 150.0), {"strain": np.linspace(0.02, 0.2, 12)}, "pressure"
    whole = invert(STATIC["values"], *asked)
    monkeypatch.setattr("mapmore_cli.modelling.inverse.CHUNK", 5)
    parts = invert(STATIC["values"], *asked)
    assert parts.status == whole.status
    for one, other in ((parts.values, whole.values), (parts.rows, whole.rows)):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(parts.picked, whole.picked)


def test_a_jump_across_the_wanted_output_is_no_solution():
    model, pressure = STATIC["steps"], np.linspace(110, 480, 4)
    found = invert(model, np.full(4, 100.0), {"pressure": pressure}, "strain")
    said = predict(model, {"strain": found.values, "pressure": pressure[found.rows]})
    np.testing.assert_allclose(said, 100.0, rtol=2e-6)


def test_a_slack_range_is_flat_and_its_low_end_counts():
    flat = STATIC["widest zones, zero"]  # nothing beyond the curves: zero at every pressure
    found = invert(flat, np.array([0.0]), {"strain": np.array([0.9])}, "pressure")
    assert found.status == ("flat",)
    assert found.values.tolist() == found.picked.tolist() == [100.0]


def test_what_cannot_be_inverted():
    for model, rule, error, told in (
        (STATIC["steps"], ("volume",), UsageError, "no input"),
        (STATIC["steps"], ("pressure", "highest"), UsageError, "no rule"),
        (WITH_MEMORY["lags"], ("pressure",), DataError, "memory"),
    ):
        with pytest.raises(error, match=told):
            invert(model, np.ones(1), {"strain": np.ones(1)}, *rule)
    with pytest.raises(UsageError, match="no input 'load'"):
        solve_for_input(MODEL, {"pressure": np.ones(1), "strain": np.ones(1)}, "load")


@pytest.mark.parametrize(
    "name",
    [*STATIC, "sarosi_hinged", "kerscher", "polynomial_5", "tondu_lopez_corrected", "peternel"],
)
def test_derivatives_against_central_differences(name):
    """Away from boundaries, where the differences to both sides agree."""
    model = {**STATIC, **FORMULAS}[name]
    columns = points(model, 500)
    found = slopes(model, columns)
    for quantity in model.inputs:
        x = columns[quantity.name]
        h = 1e-6 * np.ptp(x)
        with np.errstate(all="ignore"):
            up, here, down = (
                predict(model, {**columns, quantity.name: x + way}) for way in (h, 0.0, -h)
            )
        left, right, central = (here - down) / h, (up - here) / h, (up - down) / (2 * h)
        size = np.maximum(np.abs(central), np.nanmedian(np.abs(central)))
        smooth = np.isfinite(central) & (np.abs(left - right) <= 1e-4 * size)
        smooth &= (
            np.min(np.abs(x[:, None] - np.array([*edges_of(model, quantity.name), 0.0])), axis=1)
            > 2 * h
        )
        assert smooth.mean() > 0.2
        noise = 1e-15 * np.abs(here) / h
        assert np.all(
            np.abs(found[quantity.name] - central)[smooth]
            <= (1e-4 * size + 20 * noise)[smooth] + 1e-9
        )


LEVELS = (80.0, 150.0, 250.0, 350.0)
OF_STRAIN = {
    "target": "strain",
    "cuts": {"force": Cuts("even", 3)},
    "dictionary": ("1", "force", "force^2", "force^3"),
    "max_terms": 3,
}


def taut():
    """Strains that fall with the force in a straight line of each level: `(0.05 + 0.0005 P)(1 -
    F/(3 P))`.
    """
    made = []
    for curve in curves(levels=LEVELS, held_out=(), n=60):
        force = np.linspace(0, 2 * curve.level, 60)
        strain = (0.05 + 0.0005 * curve.level) * (1 - force / (3 * curve.level))
        columns = {
            "pressure": np.full(60, curve.level),
            "force": force,
            "strain": strain,
        }
        made.append(replace(curve, columns=columns))
    return tuple(made)


MODEL = built(taut(), **OF_STRAIN)


@settings(max_examples=10)
@given(st.lists(st.tuples(st.floats(80, 350), st.floats(0.02, 0.98)), min_size=1, max_size=8))
def test_the_force_gives_the_strain_back(places):
    pressure, share = np.array(places).T
    force = share * 2 * 80.0  # a force that every level has seen
    strain = predict(MODEL, {"pressure": pressure, "force": force})
    found = solve_for_input(MODEL, {"pressure": pressure, "strain": strain}, "force")
    assert found.solved.all()
    np.testing.assert_allclose(
        predict(MODEL, {"pressure": pressure, "force": found.values}), strain, rtol=1e-12, atol=0
    )


def test_the_law_that_made_the_strain_is_found_again():
    (curve, *_) = taut()
    said = forecast(MODEL, curve, "force")
    inner = slice(3, -3)
    np.testing.assert_allclose(said.values[inner], curve.columns["force"][inner], atol=1e-3 * 160)
    np.testing.assert_array_equal(
        forecast(MODEL, curve, "strain").values, predict(MODEL, curve.columns)
    )


def test_a_strain_that_no_force_makes_has_the_force_at_the_end_of_the_range():
    columns = {
        "pressure": np.array([150.0, 150.0, np.nan, 150.0]),
        "strain": np.array([0.9, -0.9, 0.1, np.nan]),
    }
    found = solve_for_input(MODEL, columns, "force")
    assert found.solved.tolist() == [False] * 4
    assert np.isnan(found.values[2:]).all()
    fine = predict(MODEL, {"pressure": np.full(500, 150.0), "force": np.linspace(0, 700, 500)})
    at_ends = predict(MODEL, {"pressure": np.full(2, 150.0), "force": found.values[:2]})
    wanted = columns["strain"][:2]
    nearest = np.abs(fine[:, None] - wanted).min(axis=0)
    assert (np.abs(at_ends - wanted) <= nearest + 1e-9).all()


def test_a_formula_is_smooth_between_the_ends_of_its_training_range():
    assert knots(FORMULAS["sarosi"], "strain").tolist() == [0, 0.25]
    (held,) = FORMULAS["sarosi"].body.ranges
    held = replace(held, limits={**held.limits, "strain": (0.1, 0.1)})
    model = FORMULAS["sarosi"]
    with pytest.raises(UsageError, match="the training range of 'strain' is not known"):
        knots(replace(model, body=replace(model.body, ranges=(held,))), "strain")


def test_ninety_six_parts_of_all_intervals_and_two_of_each_are_scanned():
    assert [parts_between(np.arange(n)) for n in (2, 5, 6, 49, 50, 200)] == [96, 24, 20, 2, 2, 2]


@pytest.mark.parametrize(("beyond", "status"), [(0.9, "one"), (1.1, "none")])
def test_an_output_just_beyond_the_range_has_the_end_as_its_solution(beyond, status):
    """What is beyond by less than rounding, 1e-9 times the span of outputs or the output itself,
    whichever is more.
    """
    rows, ends = {"pressure": np.full(2, 150.0)}, knots(MODEL, "force")[[0, -1]]
    at_ends = predict(MODEL, {**rows, "force": ends})
    out = beyond * 1e-9 * max(np.ptp(at_ends), np.abs(at_ends).max())
    wanted = at_ends + out * np.sign(at_ends - at_ends[::-1])
    found = invert(MODEL, wanted, rows, "force")
    assert found.status == (status, status)
    if status == "one":
        assert found.picked == pytest.approx(ends, abs=1e-6)


def test_three_solutions_between_two_places_at_which_the_slope_is_evaluated():
    """The output turns twice within a 96th of the range, in whose middle it is zero."""
    middle, away = 0.5 + 1 / 192, 1 / 400
    cubic = np.polynomial.Polynomial.fromroots([middle - away, middle, middle + away])
    line = _Line(
        lambda at: [1e6 * cubic(at["x"])],
        lambda at: [1e6 * cubic(at["x"]), 1e6 * cubic.deriv()(at["x"])],
        *("x", ("x",), np.array([0.0, 0.0]), {}),
    )
    values, rows, flat, nearest = line.solutions(*line.edges(np.array([0.0, 1.0])), 1.0)
    assert rows.tolist() == [0, 0, 0, 1, 1, 1]
    np.testing.assert_allclose(values, 2 * [middle - away, middle, middle + away], rtol=1e-9)
    assert (flat.any(), *nearest) == (False, *[pytest.approx(middle)] * 2)


@pytest.mark.parametrize(
    ("ends", "slopes_", "twice"),
    [
        ((0.5, 1.5), (1.0, 1.0), False),  # straight
        ((0.5, 1.5), (2.9, 2.9), False),  # a cubic that still rises
        ((0.5, 1.5), (3.0, 3.0), False),  # three times the slope of the secant
        ((0.5, 1.5), (1.0, -1.0), False),
        ((0.5, 1.5), (3.1, 0.0), True),
        ((0.5, 1.5), (0.0, 3.1), True),
        ((-0.5, -1.5), (-3.1, 0.0), True),
        ((0.5, 1.5), (-1.1, 0.0), True),  # it starts downward, and ends above
        ((5.0, 6.0), (3.1, 0.0), False),  # zero is farther away than it can stray
    ],
)
def test_a_part_may_turn_twice_by_its_slopes_at_both_ends(ends, slopes_, twice):
    """The bound of Fritsch and Carlson (1980), of a part of width one."""
    values = (np.array([one]) for one in (*ends, *slopes_))
    assert may_turn_twice(*values, np.ones(1)).tolist() == [twice]
