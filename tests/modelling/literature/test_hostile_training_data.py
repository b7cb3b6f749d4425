"""Data that do not determine a formula: told by status and notes, refused only where nothing can be
fitted.
"""

import numpy as np
import pytest
from literature_cases import STATIC, grid, noisy_wrist, wrist_force

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.literature import Formula, Nonlinear, get

METHODS = ["variable_projection", "levenberg_marquardt"]
FORMULAS = ["sarosi", "polynomial_2", "polynomial_5"]
LEVELS = {
    "one strain": grid(np.arange(1.0, 8.0), np.array([0.1])),
    "zero strain": grid(np.arange(1.0, 8.0), np.array([0.0])),
    "one pressure": grid(np.array([3.0]), np.linspace(0, 0.2, 9)),
    "zero pressure": grid(np.array([0.0]), np.linspace(0, 0.2, 9)),
    "one point": grid(np.array([3.0]), np.array([0.1])),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", FORMULAS)
@pytest.mark.parametrize("columns", LEVELS.values(), ids=LEVELS)
def test_one_level_is_rank_deficient_but_still_fits_what_it_shows(columns, name, method):
    columns = {quantity: np.repeat(column, 24) for quantity, column in columns.items()}
    y = wrist_force(columns)
    formula = get(name)
    fit = formula.fit(columns, y, method)
    assert fit.status == "rank_deficient"
    assert fit.rank < len(formula.parameters)
    assert np.isfinite(list(fit.parameters.values())).all()
    assert np.isnan(list(fit.errors.values())).any()
    assert any("rank" in note for note in fit.notes)
    if method == "variable_projection":
        assert np.sqrt(fit.sse / len(y)) < 0.1 * np.abs(y).max()
        np.testing.assert_allclose(
            np.sum((formula.predict(fit.parameters, columns) - y) ** 2),
            fit.sse,
            rtol=1e-6,
            atol=1e-12,
        )


HOSTILE = {
    "zero": lambda y: np.zeros_like(y),
    "noise": lambda y: np.random.default_rng(0).standard_normal(len(y)),
    "one spike": lambda y: np.where(np.arange(len(y)) == 5, 1e6, 0.0),
    "upside down": lambda y: -y,
    "huge": lambda y: 1e100 * y,
    "tiny": lambda y: 1e-100 * y,
}


@pytest.mark.parametrize("target", HOSTILE.values(), ids=HOSTILE)
@pytest.mark.parametrize("name", STATIC)
def test_any_finite_target_gets_an_answer_no_worse_than_nothing(name, target):
    """And a status of the vocabulary; what ends at a bound is named."""
    columns, y = noisy_wrist(0, rows=60)
    columns["pressure"] *= 100.0
    y = target(y)
    fit = get(name).fit(columns, y)
    if name == "bolen" and not y.any():  # its c0 is a share of the force at rest, here 0/0
        assert fit.failed
        return
    assert fit.status in ("converged", "at_bound", "rank_deficient", "stopped_by_limit")
    assert np.isfinite(get(name).predict(fit.parameters, columns)).all()
    # its foot may not be without width
    assert fit.sse <= (1 + 1e-9) * float(y @ y) + 1e-12 * len(y) * (name == "sarosi_hinged")
    if fit.status == "at_bound":
        assert any(
            note.startswith(f"{parameter} ") for parameter in fit.parameters for note in fit.notes
        )


@pytest.mark.parametrize("name", STATIC)
def test_absurd_inputs_are_no_reason_to_raise(name):
    """Pressures of minus 10 MPa, where exp(-P) of W eq 10 overflows, with the strain in per
    cent.
    """
    columns, y = noisy_wrist(0, rows=60)
    fit = get(name).fit(
        {"pressure": -1e6 * columns["pressure"], "strain": 100.0 * columns["strain"]}, y
    )
    assert fit.failed == (name in ("tondu_lopez_corrected", "kerscher"))
    assert np.isnan(list(fit.parameters.values())).all() == fit.failed


def test_a_curvature_that_runs_away_is_at_bound():
    """A step at the smallest strain is the limit of ever faster decay, and a parabola p*x^2 that of
    none.
    """
    columns = grid(np.arange(1.0, 8.0), np.linspace(0.0, 0.2, 9))
    p, x = columns["pressure"], columns["strain"]
    step = get("sarosi").fit(columns, p * (x == 0.0) + 0.01 * p * x)
    assert step.status == "at_bound"
    assert step.parameters["a3"] * 0.2 == pytest.approx(-50.0)
    parabola = get("sarosi").fit(columns, p * x**2 + x)
    assert parabola.status == "at_bound"
    assert abs(parabola.parameters["a3"] * 0.2) == pytest.approx(1e-3)
    assert any("a3 went to" in note for note in parabola.notes)
    assert parabola.sse < 1e-6 * np.sum((p * x**2 + x) ** 2)


@pytest.mark.parametrize("name", STATIC)
def test_one_sample_less_than_parameters_is_refused(name):
    count = len(get(name).parameters)
    columns, y = noisy_wrist(0, rows=count - 1)
    with pytest.raises(
        DataError, match=f"{count} parameters, but there are only {count - 1} samples"
    ):
        get(name).fit(columns, y)
    assert not get(name).fit(*noisy_wrist(0, rows=count)).failed


def test_as_many_samples_as_parameters_leave_no_standard_error():
    columns, y = noisy_wrist(1, rows=5)
    fit = get("polynomial_2").fit(columns, y)
    assert fit.status == "converged"
    assert fit.sse < 1e-15 * np.sum(y**2)
    assert np.isnan(list(fit.errors.values())).all()


def test_unknown_methods_are_refused():
    columns, y = noisy_wrist(0)
    with pytest.raises(ValueError, match="unknown method `magic`"):
        get("sarosi").fit(columns, y, "magic")


@pytest.mark.parametrize("method", [*METHODS, "simplex"])
def test_a_formula_that_overflows_everywhere_has_failed(method):
    nonlinear = tuple(Nonlinear(name, None, ((1e6, 1e7),)) for name in "bc")
    explosive = Formula("explosive", "-", ("x",), ("a", "b", "c"), "a*exp(b*x + c*x^2)", nonlinear)
    fit = explosive.fit({"x": np.linspace(1, 2, 9)}, np.ones(9), method)
    assert fit.failed
    assert fit.notes == ("every start overflowed",)
    assert np.isnan(list(fit.parameters.values())).all()
    assert np.isnan(explosive.predict(fit.parameters, {"x": np.ones(3)})).all()


@pytest.mark.parametrize(
    ("text", "nonlinear", "message"),
    [
        ("a*x + c", (), "must contain all declared inputs"),
        ("a*x*b", (), "to `nonlinear`, because the derivative"),
        ("a*x + b*x + x", (), "no linear parameter"),
        ("a*exp(b*x)", (), "to `nonlinear`, because the derivative"),
    ],
)
def test_a_formula_that_is_not_what_it_declares_cannot_be_made(text, nonlinear, message):
    with pytest.raises(ValueError, match=message):
        Formula("wrong", "-", ("x",), ("a", "b"), text, nonlinear).checked()
