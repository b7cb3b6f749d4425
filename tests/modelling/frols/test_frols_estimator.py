"""`FROLS` keeps the protocol of scikit-learn, and says what the engine says."""

from fractions import Fraction

import numpy as np
import pyarrow as pa
import pytest
from common import python
from sklearn.model_selection import GridSearchCV
from sklearn.utils.estimator_checks import check_estimator

import mapmore_cli as mm
from mapmore_cli.api.estimator import _expanded, _no_unit
from mapmore_cli.modelling.frols import frols


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.SkipTestWarning")  # pandas is not installed
@pytest.mark.filterwarnings("ignore:Estimator FROLS does not inherit")  # it needs no scikit-learn
def test_every_check_of_scikit_learn_passes():
    results = check_estimator(mm.FROLS(), on_fail=None)
    assert len(results) > 40
    assert {one["status"] for one in results} <= {"passed", "skipped"}, [
        r["check_name"] for r in results if r["status"] == "failed"
    ]


def test_the_engine_decides():
    rng = np.random.default_rng(1)
    X = rng.normal(size=(80, 3))
    y = 2 * X[:, 0] * X[:, 2] - 0.5 * X[:, 1] ** 2 + 1e-3 * rng.normal(size=80)
    model = mm.FROLS(order=2, max_terms=2).fit(X, y)
    assert model.terms_ == ("x0*x2", "x1^2")
    P = np.column_stack([X[:, 0] * X[:, 2], X[:, 1] ** 2])
    np.testing.assert_allclose(model.coef_, frols(P, y).theta, rtol=1e-12)
    assert [row["term"] for row in model.table_] == list(model.terms_)
    assert sum(model.err_) == pytest.approx(1, abs=1e-5)
    assert model.equations_[0].startswith("2")
    assert model.score(X, y) > 0.999


def test_a_search_of_scikit_learn_chooses_its_settings():
    x = np.linspace(-1, 1, 60)[:, None]
    found = GridSearchCV(mm.FROLS(tolerance=0.0), {"order": [1, 3]}, cv=3).fit(x, x[:, 0] ** 3)
    assert found.best_params_ == {"order": 3}


def test_neither_scikit_learn_nor_numpy_is_loaded_before_it_is_needed():
    code = (
        "import sys, mapmore_cli; assert 'numpy' not in sys.modules, 'numpy'\n"
        "import numpy as np\n"
        "m = mapmore_cli.FROLS().fit(np.arange(10.)[:, None], np.arange(10.)); repr(m), m.table_\n"
        "try: mapmore_cli.FROLS().predict([[1.0]])\n"
        "except ValueError as e: assert 'not fitted' in str(e)\n"
        "assert 'sklearn' not in sys.modules, 'sklearn'; assert 'matplotlib' not in sys.modules"
    )
    python(code, check=True)


@pytest.mark.parametrize("offset", [0.0, 1e3, 1e5, 1e6, 1e8, -1e6])
def test_columns_far_from_zero_are_as_good_as_columns_about_zero(offset):
    x = np.linspace(0, 1, 200)
    y, columns = 1 + 2 * x + 3 * x**2, (offset + x)[:, None]
    model = mm.FROLS(order=2).fit(columns, y)
    # what rounding of the columns themselves leaves
    assert np.abs(model.predict(columns) - y).max() < 1e-13 + 8 * abs(offset) * 2.3e-16
    found = dict(zip(model.terms_, model.coef_, strict=True))
    wanted = {"1": 1 - 2 * offset + 3 * offset**2, "x0": 2 - 6 * offset, "x0^2": 3.0}
    assert found == pytest.approx(wanted, rel=1e-7)
    assert model.err_.sum() == pytest.approx(1)


@pytest.mark.parametrize(("offset", "name"), [(0.5, "x0 - 0.5"), (-0.5, "x0 + 0.5")])
def test_terms_of_a_centred_column_name_its_offset(offset, name):
    x = np.arange(-25, 26)
    model = mm.FROLS(order=1, max_terms=1).fit((offset + x / 2**30)[:, None], 7 * x)
    assert model.selection_.names == (name,)


def test_powers_of_differences_are_expanded_by_the_binomial_theorem():
    """x (y - 3)^2 = 9 x - 6 x y + x y^2."""
    expanded = dict(_expanded([1, 2], [Fraction(0), Fraction(3)]))
    assert expanded == {(1, 0): 9, (1, 1): -6, (1, 2): 1}


def test_what_the_shift_of_columns_makes_and_takes_again_is_no_term():
    x = 1024 + np.random.default_rng(0).integers(0, 64, (50, 2)) / 64
    model = mm.FROLS(order=2, tolerance=0.0).fit(x, x[:, 0] ** 2 - 3 * x[:, 0] * x[:, 1])
    found = dict(zip(model.terms_, model.coef_, strict=True))
    assert found == pytest.approx({"x0^2": 1.0, "x0*x1": -3.0}, rel=1e-6)


def test_a_target_whose_square_is_no_number_is_fitted():
    x = np.linspace(0, 1, 50)
    model = mm.FROLS().fit(x[:, None], 1e200 * (1 + 2 * x))
    assert dict(zip(model.terms_, model.coef_, strict=True)) == pytest.approx(
        {"1": 1e200, "x0": 2e200}
    )
    assert model.score(x[:, None], 1e200 * (1 + 2 * x)) == pytest.approx(1)


def test_noise_is_not_explained_where_no_tolerance_is_given():
    counts = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        X = rng.uniform(-1, 1, (200, 2))
        y = 1 + 2 * X[:, 0] - 3 * X[:, 0] * X[:, 1]
        found = mm.FROLS(order=3).fit(X, y + 0.01 * y.std() * rng.normal(size=200))
        counts.append(len(found.coef_))
        assert {"1", "x0", "x0*x1"} <= set(found.terms_)
    assert counts.count(3) >= 19


@pytest.mark.parametrize(
    ("order", "limit"), [(0, 4.5036e5), (1, 4.5036e5), (2, 671.09), (3, 76.65)]
)
def test_a_column_is_centred_where_its_powers_would_differ_by_rounding_alone(order, limit):
    """Rounding removes 1e-10 of a power at `(1e-10/eps)^(1/order)` standard deviations."""
    for mean, is_far in ((0.999 * limit, 0), (1.001 * limit, 1), (-1.001 * limit, 1)):
        column = np.array([[mean - 1], [mean + 1]])
        wanted = mean * is_far
        assert mm.FROLS(order=order)._centre_of(column) == pytest.approx([wanted])
        assert mm.FROLS(order=order, constant=False)._centre_of(column).tolist() == [0]
    assert mm.FROLS(order=order)._centre_of(np.full((3, 1), 1e9)).tolist() == [0]


X = np.column_stack([np.arange(6.0), np.arange(6.0) ** 2])


@pytest.mark.parametrize(
    ("table", "target", "words"),
    [
        (X[:, 0], X[:, 0], "Expected 2D array, got 1D array instead"),
        (X[:0], X[:0, 0], r"0 sample\(s\) while a minimum of 1"),
        (X[:1], X[:1, 0], "n_samples=1: at least 2 samples are needed"),
        (X, X[:5, 0], "inconsistent numbers of samples: 6 and 5"),
        (X, X, r"y should be a 1d array, got an array of shape \(6, 2\)"),
        (X, X[:, 0] + np.inf, "Input contains NaN or infinity"),
        ({"a": X[:, 0], "b": ["x"] * 6}, X[:, 0], "X"),
    ],
)
def test_tables_that_cannot_be_fitted(table, target, words):
    with pytest.raises((ValueError, TypeError), match=words):
        mm.FROLS().fit(table, target)


def test_two_samples_are_enough_and_names_that_are_no_identifiers_are_numbered():
    table = pa.table({"a": [0.0, 1.0], "b c": [0.0, 0.0]})
    model = mm.FROLS(order=1, max_terms=2, tolerance=0.0).fit(table, [1.0, 3.0])
    assert dict(zip(model.terms_, model.coef_, strict=True)) == pytest.approx({"1": 1, "x0": 2})
    model.fit(table.rename_columns(["a", "b"]), [1.0, 3.0])
    assert {*model.terms_} == {"1", "a"}
    assert [*model.feature_names_in_] == ["a", "b"]
    assert not hasattr(model.fit(X, X[:, 0]), "feature_names_in_")


def test_numbers_with_a_unit_are_refused_unless_it_is_one():
    assert _no_unit(X, "dimensionless") is X
    with pytest.raises(ValueError, match="unit kPa"):
        _no_unit(X, "kPa")


def test_a_model_predicts_tables_of_the_columns_that_it_was_fitted_to():
    model = mm.FROLS(order=2, tolerance=0.0, max_terms=2)
    model.fit(X, 2 - 3 * X[:, 1])
    assert (model.n_features_in_, model.terms_) == (2, model.selection_.names)
    assert model.equations_[0] in ("2 - 3*x1", "-3*x1 + 2", "2 - 3*x0^2", "-3*x0^2 + 2")
    np.testing.assert_allclose(model.predict(X), 2 - 3 * X[:, 1], atol=1e-9)
    assert model.score(X, np.full(6, 7.0)) == 0
    y = 2 - 3 * X[:, 1]
    worse = 1 - np.sum((y + 1 - model.predict(X)) ** 2) / np.sum((y - y.mean()) ** 2)
    assert model.score(X, y + 1) == pytest.approx(worse)


@pytest.mark.parametrize(("samples", "most"), [(4, 3), (9, 4), (10, 5)])
def test_a_model_has_three_terms_or_half_as_many_as_samples(samples, most):
    rng = np.random.default_rng(samples)
    noise = rng.normal(size=(samples, 4))
    assert len(mm.FROLS(order=2, tolerance=0.0).fit(noise[:, :3], noise[:, 3]).terms_) == most


def test_without_a_tolerance_a_term_of_a_ten_thousandth_is_the_last():
    """Of orthogonal columns, whose shares of the squares are those of their coefficients."""
    columns = np.linalg.qr(np.random.default_rng(0).normal(size=(40, 3)))[0]
    model = mm.FROLS(order=1, stop="tolerance", max_terms=3, constant=False)
    for share, terms in ((3e-4, 2), (3e-5, 1)):
        found = model.fit(columns, columns @ [1, np.sqrt(share), 0])
        assert len(found.terms_) == terms


def test_settings_are_shown_where_they_are_not_the_usual_ones():
    model = mm.FROLS(tolerance=0.5, constant=False)
    assert repr(model) == "FROLS(tolerance=0.5, constant=False)"
    model.set_params(order=3)
    with pytest.raises(ValueError, match=r"Invalid parameter 'ordr' for estimator FROLS\(order=3"):
        model.set_params(ordr=3)
    assert mm.FROLS().__sklearn_tags__().target_tags.required
