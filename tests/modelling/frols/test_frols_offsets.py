"""A target that stands far from zero, as a length does: the constant explains nearly all of `y'y`,
and ends nothing.
"""

import numpy as np
import pytest
from common import curve_of
from textbook import frols_streamed

from mapmore_cli.domain.fits import Scaling, SegmentFit
from mapmore_cli.modelling.frols import frols
from mapmore_cli.modelling.frols.moments import blocks_of_rows, standard
from mapmore_cli.modelling.frols.offsets import far_from_zero

X = np.linspace(0, 1, 4000)
P = np.column_stack([X**0, X, X**2, np.cos(9 * X)])
FORMS = {
    "whole": frols,
    "streamed": lambda P, y, *rest, **named: frols_streamed(blocks_of_rows(P, y), *rest, **named),
}


def spread(y):
    return float(np.sum((y - y.mean()) ** 2))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("offset", [0.0, 1.0, -500.0, 1e5, 1e8])
def test_an_offset_changes_nothing_but_the_constant(form, offset):
    y = 2 * X - 3 * np.cos(9 * X) + offset
    found = FORMS[form](P, y, 4, 1e-4)
    assert {1, 3} <= set(found.chosen.tolist())
    assert found.sse <= 1e-4 * spread(y)
    assert found.err.sum() == pytest.approx(1)  # of the squares about zero, as ever


@pytest.mark.parametrize("value", [1.0, -3.0, 1e-200, 1e200, 0.1 * 3])
@pytest.mark.parametrize("form", FORMS)
def test_the_constant_is_told_by_its_values(form, value):
    wide = P.copy()
    wide[:, 0] = value
    found = FORMS[form](wide, 273.15 + X, 4, 1e-4)  # a temperature in kelvin
    assert found.chosen.tolist()[-1] == 1
    assert found.stop == "tolerance"


@pytest.mark.parametrize(("deviation", "is_constant"), [(2.0**-41, True), (2.0**-39, False)])
def test_a_column_is_constant_if_only_its_last_digits_vary(deviation, is_constant):
    """Its standard deviation is 0.45e-12 or 1.8e-12 of its first value; the limit is 1e-12."""
    column, passes = 1 + deviation * np.array([0.0, 2.0]), []

    def blocks():
        passes.append(1)
        return blocks_of_rows(column[:, None], column)()

    assert np.isinf(standard(blocks).spread).all() == is_constant
    assert len(passes) == 1


@pytest.mark.parametrize("form", FORMS)
def test_without_a_constant_the_squares_about_zero_count(form):
    # a column that hardly varies, and one of zeros, are no constant
    near = np.column_stack([1 + 1e-3 * X, X, np.zeros(len(X))])
    found = FORMS[form](near, 500 + 2 * X, 3, 1e-4)
    assert (found.chosen.tolist(), found.stop) == ([0], "tolerance")


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("target", [np.full(4000, 500.0), 500 * (1 + 1e-14 * np.sin(X))])
def test_a_target_that_is_constant_is_explained_by_one(form, target):
    assert FORMS[form](P, target, 4, 1e-4).chosen.tolist() == [0]


@pytest.mark.parametrize("form", FORMS)
def test_no_tolerance_ends_a_criterion(form):
    exact = FORMS[form](P, 500 + 2 * X - 3 * np.cos(9 * X), 4, 0.5, stop="bic")
    assert (sorted(exact.chosen.tolist()), exact.stop) == ([0, 1, 3], "no_gain")


@pytest.mark.parametrize(("ripple", "once"), [(1.0, True), (1e-3, False)])
def test_the_record_is_read_again_only_where_the_tolerance_may_end_the_choice(ripple, once):
    read = []

    def blocks():
        read.append(1)
        return blocks_of_rows(P, 2 + X + ripple * np.cos(50 * X))()

    frols_streamed(blocks, 2, 1e-4)
    assert (len(read) == 1) == once


def test_inputs_far_from_zero_are_told_where_terms_keep_their_origin():
    x = np.linspace(0, 1, 50)
    x = (x - 0.5) / x.std()
    samples = {"far": -1.01e4 + x, "near": -0.99e4 + x, "alone": 1e6 + x, "still": np.full(50, 3.0)}
    curve = curve_of(samples)
    terms = ("1", "far", "far^2", "near", "near^2", "alone", "still", "still^2")
    names, ones = ("far",), np.ones(1)
    for rule, told in (("none", ["far"]), ("max_abs", ["far"]), ("unit_square", [])):
        scaling = Scaling(rule, "-", names, ones, 0 * ones, 1.0, 0.0)
        piece = SegmentFit("a/a", "a", (), terms, scaling, frols(P, X, 1))
        assert [note.split()[3] for note in far_from_zero([piece], [curve])] == told
