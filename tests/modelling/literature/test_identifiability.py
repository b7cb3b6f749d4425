"""Parameters that the data do not show are named; other minima that they hardly tell apart."""

import numpy as np
import pytest
from global_fits import least_rmse
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.stats import t as student

from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature.formulas.sarosi import DECAY, sarosi
from mapmore_cli.modelling.literature.linear import half_width
from mapmore_cli.modelling.literature.problem import nominal
from mapmore_cli.modelling.literature.solvers import METHODS


@pytest.mark.parametrize("freedom", [1, 5, 84])
def test_half_width_is_that_of_the_t_distribution(freedom):
    assert half_width(2.0, freedom) == pytest.approx(2.0 * student.ppf(0.975, freedom), rel=1e-9)
    assert np.isnan(half_width(2.0, 0))


@pytest.mark.parametrize(("share", "noted"), [(0.99, True), (1.01, False), (-1.01, False)])
def test_a_parameter_within_its_half_width_of_zero_is_not_identified(share, noted):
    x, scatter = np.linspace(-1, 1, 30), np.cos(np.linspace(0, 40, 30))
    scatter -= x * (x @ scatter) / (x @ x)
    width = student.ppf(0.975, 29) * np.sqrt(scatter @ scatter / 29 / (x @ x))
    line = literature.Formula("line", "-", ("x",), ("a",), "a*x")
    notes = line.fit({"x": x}, share * width * x + scatter).notes
    assert notes == (("not identified (95 % interval contains zero): a",) if noted else ())


LEVELS = (80.0, 150.0, 250.0, 350.0)


EITHER = sarosi("a", (*DECAY, (1e-3, 50.0)))


def two_valleys():
    """A sum of a decaying and a growing exponential of the strain: a formula with an exponent of
    either sign can have one of them.
    """
    rng = np.random.default_rng(0)
    strain = np.tile(np.linspace(0, 0.25, 60), 4)
    pressure = np.repeat(LEVELS, 60)
    force = 0.3 * pressure * (np.exp(-20 * strain) + 0.95 * np.exp(20 * (strain - 0.25)))
    return {"pressure": pressure, "strain": strain}, force + rng.normal(0, 0.5, strain.size)


def test_a_second_valley_is_told_with_its_parameters():
    columns, force = two_valleys()
    fit = EITHER.fit(columns, force)
    (rival,) = fit.rivals
    assert fit.parameters["a3"] * rival.parameters["a3"] < 0
    assert fit.sse < rival.sse <= 1.25 * fit.sse
    residual = EITHER.predict(rival.parameters, columns) - force
    assert residual @ residual == pytest.approx(rival.sse, rel=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_the_exponent_has_the_sign_that_every_author_prints(method):
    """A force that falls faster and faster with the strain is told better by a growing
    exponential; `sarosi` is fitted with a decaying one, by every method.
    """
    rng = np.random.default_rng(0)
    columns, _ = two_valleys()
    pressure, strain = columns["pressure"], columns["strain"]
    force = 0.3 * pressure * (np.exp(-6 * strain) - 0.4 * np.exp(60 * (strain - 0.25)))
    force += rng.normal(0, 0.5, force.size)
    assert EITHER.fit(columns, force).parameters["a3"] > 0
    fit = literature.get("sarosi").fit(columns, force, method)
    assert fit.parameters["a3"] < 0


@settings(max_examples=15)
@given(st.floats(1e-10, 3e-3), st.integers(0, 100))
@example(1e-10, 20)  # the scatter raises the rank to 20
def test_scatter_of_held_pressures_hides_no_deficiency(scatter, seed):
    """`polynomial_5` has rank 18 with four pressures, however these scatter, and a note says so;
    the fit is plain least squares on the measured ones, on which it is scored.
    """
    rng = np.random.default_rng(seed)
    strain, level = np.tile(np.linspace(0, 0.25, 60), 4), np.repeat(LEVELS, 60)
    pressure = level + 350 * scatter * rng.uniform(-1, 1, level.size)
    formula = literature.get("polynomial_5")
    columns = {"pressure": pressure, "strain": strain}
    force = level * (1 - 3 * strain) ** 2 + rng.normal(0, 5, level.size)
    fit = formula.fit(columns, force)
    assert any("rank 18 of 21" in note and "4 of pressure" in note for note in fit.notes)
    assert np.sqrt(fit.sse / len(force)) <= 1.0001 * least_rmse("polynomial_5", columns, force)


@pytest.mark.parametrize(
    ("width", "count", "levels"),
    [(0.9, 5, [0.45, 10.45]), (0.95, 5, None), (0.9, 4, None), (0.0, 5, None)],
)
def test_a_level_is_the_middle_of_at_least_five_values_within_a_tenth_of_the_gap(
    width, count, levels
):
    """The gap between two groups of this width is 10 less the width; equal values are one."""
    column = np.concatenate([np.linspace(0, width, 5), 10 + np.linspace(0, width, count)])
    expected = column if levels is None else np.repeat(levels, 5)
    np.testing.assert_allclose(nominal(column), expected, atol=1e-12)


def test_of_levels_within_levels_the_finest_count():
    scatter = np.linspace(-0.01, 0.01, 5)
    column = np.concatenate([level + scatter for level in (0.0, 1.0, 100.0, 101.0)])
    np.testing.assert_allclose(nominal(column), np.repeat([0.0, 1.0, 100.0, 101.0], 5), atol=1e-12)


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
