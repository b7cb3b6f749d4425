"""Parameters that the data do not show are named with what would; other minima that they hardly
tell apart.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from literature_cases import MUSCLE_LIKE, TABLE_I, grid
from scipy.stats import t as student

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature import Formula, Nonlinear, get
from mapmore_cli.modelling.literature.identifiability import half_width
from mapmore_cli.modelling.literature.problem import nominal

LINE = Formula("line", "-", ("x", "z"), ("a", "b", "c"), "a + b*x + c*z")


def named(notes: tuple[str, ...]) -> dict[str, str]:
    """What to measure, by parameter."""
    found = [
        re.fullmatch(r"(.+) (?:is|are) not identified \(.*\): measure (.+)", note) for note in notes
    ]
    return {name: match[2] for match in found if match for name in match[1].split(", ")}


def table(rows: int = 40) -> tuple[dict[str, Array], Array]:
    rng = np.random.default_rng(0)
    columns = {"x": rng.uniform(1, 2, rows), "z": np.full(rows, 3.0)}
    return columns, 1.0 + 2.0 * columns["x"] + 0.5 * columns["z"] + 0.01 * rng.standard_normal(rows)


def test_an_input_that_never_moved_is_what_to_move() -> None:
    columns, y = table()
    fit = LINE.fit(columns, y)
    assert fit.status == "rank_deficient"
    told = named(fit.notes)
    assert set(told) == {"a", "c"}
    assert all(re.fullmatch(r"at z (above|below) 3", where) for where in told.values())
    moved = {**columns, "z": np.where(np.arange(40) < 20, 3.0, 4.0)}
    assert (
        named(
            LINE.fit(
                moved, 1.0 + 2.0 * moved["x"] + 0.5 * moved["z"] + 0.01 * np.sin(np.arange(40.0))
            ).notes
        )
        == {}
    )


def test_a_well_measured_formula_has_no_such_note() -> None:
    columns = grid(np.linspace(100, 600, 6), np.linspace(0, 0.2, 9))
    truth = {"area": 1.0, "theta": 0.5}
    fit = get("tondu_lopez").fit(
        columns, get("tondu_lopez").predict(truth, columns) + np.cos(np.arange(54.0))
    )
    assert named(fit.notes) == {}


def test_damping_is_not_seen_in_a_record_at_rest_and_motion_shows_it() -> None:
    rng = np.random.default_rng(1)
    columns = {
        "pressure": rng.uniform(200, 600, 400),
        "length": rng.uniform(0, 0.03, 400),
        "velocity": rng.uniform(-1e-4, 1e-4, 400),
    }
    truth = dict(zip(MUSCLE_LIKE, TABLE_I["16 cm"], strict=True))
    fit = get("muscle_like").fit(
        columns, get("muscle_like").predict(truth, columns) + rng.standard_normal(400)
    )
    assert named(fit.notes)["b0"].startswith("at velocity ")
    moving = {**columns, "velocity": rng.uniform(-0.5, 0.5, 400)}
    again = get("muscle_like").fit(
        moving, get("muscle_like").predict(truth, moving) + rng.standard_normal(400)
    )
    assert "b0" not in named(again.notes)


def test_few_levels_ask_for_more_of_them() -> None:
    """A parabola over two levels of x is told by a third."""
    parabola = Formula("parabola", "-", ("x",), ("a", "b", "c"), "a + b*x + c*x^2")
    fit = parabola.fit(
        {"x": np.repeat([1.0, 2.0], 20)}, np.repeat([1.0, 3.0], 20) + 0.01 * np.sin(np.arange(40.0))
    )
    assert set(named(fit.notes)) == {"a", "b", "c"}
    assert all(
        where.startswith("at ") and " x " in f" {where} " for where in named(fit.notes).values()
    )


def test_the_measurement_named_for_a_parameter_takes_most_from_its_error() -> None:
    """Two inputs could be carried further: the decay shows at small x alone, and the note says
    so.
    """
    decay = Formula(
        "decay",
        "-",
        ("x", "z"),
        ("a", "b", "k"),
        "a*exp(-k*x) + b*z",
        (Nonlinear("k", "x", ((1e-2, 50.0),)),),
    )
    rng = np.random.default_rng(2)
    columns = {"x": rng.uniform(3.0, 4.0, 60), "z": rng.uniform(0.0, 1.0, 60)}
    fit = decay.fit(
        columns, 50.0 * np.exp(-2.0 * columns["x"]) + columns["z"] + 0.05 * rng.standard_normal(60)
    )
    assert named(fit.notes)["a"] == f"at x below {columns['x'].min():.3g}"


@pytest.mark.parametrize("freedom", [1, 5, 84])
def test_half_width_is_that_of_the_t_distribution(freedom: int) -> None:
    assert half_width(2.0, freedom) == pytest.approx(2.0 * student.ppf(0.975, freedom), rel=1e-9)
    assert np.isnan(half_width(2.0, 0))


LEVELS = (80.0, 150.0, 250.0, 350.0)


def two_valleys(seed=0):
    """A sum of a decaying and a growing exponential of the strain: Sarosi's formula can have one of
    them.
    """
    rng = np.random.default_rng(seed)
    strain = np.tile(np.linspace(0, 0.25, 60), 4)
    pressure = np.repeat(LEVELS, 60)
    force = 0.3 * pressure * (np.exp(-20 * strain) + 0.95 * np.exp(20 * (strain - 0.25)))
    return {"pressure": pressure, "strain": strain}, force + rng.normal(0, 0.5, strain.size)


def test_a_second_valley_is_told_with_its_parameters():
    columns, force = two_valleys()
    formula = literature.get("sarosi")
    fit = formula.fit(columns, force)
    (rival,) = fit.rivals
    assert fit.parameters["a3"] * rival.parameters["a3"] < 0
    assert fit.sse < rival.sse <= 1.25 * fit.sse
    residual = formula.predict(rival.parameters, columns) - force
    assert residual @ residual == pytest.approx(rival.sse, rel=1e-6)


def test_a_formula_with_one_valley_has_no_rival():
    columns, _ = two_valleys()
    force = columns["pressure"] * (2 * np.exp(-12 * columns["strain"]) - 1 - columns["strain"])
    assert literature.get("sarosi").fit(columns, force).rivals == ()


@settings(max_examples=15, deadline=None)
@given(st.floats(1e-10, 3e-3), st.integers(0, 100))
def test_scatter_of_held_pressures_hides_no_deficiency(scatter, seed):
    """`polynomial_5` has rank 18 with four pressures, however these scatter; the fit is that at the
    nominal ones.
    """
    rng = np.random.default_rng(seed)
    strain, level = np.tile(np.linspace(0, 0.25, 60), 4), np.repeat(LEVELS, 60)
    force = level * (1 - 3 * strain) ** 2
    pressure = level + 350 * scatter * rng.uniform(-1, 1, level.size)
    formula = literature.get("polynomial_5")
    fit = formula.fit({"pressure": pressure, "strain": strain}, force)
    assert (fit.status, fit.rank) == ("rank_deficient", 18)
    between = {"pressure": np.full(5, 200.0), "strain": np.linspace(0, 0.25, 5)}
    exact = formula.fit({"pressure": level, "strain": strain}, force)
    np.testing.assert_allclose(
        formula.predict(fit.parameters, between),
        formula.predict(exact.parameters, between),
        rtol=20 * scatter + 1e-6,
        atol=0.5,
    )


def test_swept_quantities_have_no_levels():
    rng = np.random.default_rng(0)
    for column in (
        np.linspace(0, 1, 500),
        rng.uniform(size=1000),
        rng.normal(size=50),
        np.zeros(7),
        np.array([0.0, 100.0, 2000.0]),
    ):
        assert nominal(column) is column


@given(st.lists(st.integers(-50, 50), min_size=2, max_size=6, unique=True), st.integers(0, 1000))
def test_every_value_becomes_the_level_it_scatters_about(levels, seed):
    rng = np.random.default_rng(seed)
    of = np.repeat(np.array(levels, dtype=float), 20)
    found = nominal(of + 0.02 * rng.uniform(-1, 1, of.size))
    assert len(np.unique(found)) == len(levels)
    assert np.abs(found - of).max() <= 0.02
