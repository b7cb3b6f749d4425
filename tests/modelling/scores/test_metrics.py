"""Metrics against arithmetic by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mapmore_cli.modelling.validation.metrics import extent, max_abs, score


def test_a_row_by_hand():
    measured = np.array([0.0, 10, -20, 30])
    row = score("m", "static", "validate", "all", measured, np.array([1.0, 9, -17, 29]), max_abs(measured, "force", "validate"))
    assert row.rmse == pytest.approx(math.sqrt(12 / 4))
    assert row.nrmse == pytest.approx(row.rmse / 30)
    assert (row.normaliser, row.normaliser_name) == (30, "max|force| over validate")
    assert row.max_abs_error == 3
    assert row.max_abs_error_fs == pytest.approx(0.1)
    assert row.r2 == pytest.approx(1 - 12 / 1300)
    assert row.n == 4


def test_errors_by_the_range_do_not_depend_on_where_zero_lies():
    measured = np.array([110.0, 112, 130])
    scale = extent(measured, "displacement", "validate")
    row = score("m", "displacement", "validate", "all", measured, measured + 2, scale)
    assert (row.nrmse, row.normaliser_name) == (pytest.approx(0.1), "range of displacement over validate")
    assert extent(measured - 1000, "displacement", "validate") == scale


def test_a_constant_has_no_r2_and_zeros_no_nrmse():
    row = score("m", "static", "train", "all", np.zeros(3), np.ones(3), max_abs(np.zeros(3), "force", "train"))
    assert math.isnan(row.r2)
    assert math.isnan(row.nrmse)
    assert row.rmse == 1


def test_the_smallest_and_the_largest_forces_have_scores_too():
    """Their squares vanish or overflow; times a power of two, nothing but the exponent changes."""
    measured, predicted = np.array([1.25, 10, -20, 30.1]), np.array([1.0, 9.3, -17, 29])
    for exponent in (0, -1000, 1000, -700, 500):
        factor = 2.0**exponent
        y = measured * factor
        row = score("m", "static", "validate", "all", y, predicted * factor, max_abs(y, "force", "validate"), one_step=predicted * factor)
        plain = score("m", "static", "validate", "all", measured, predicted, max_abs(measured, "force", "validate"), one_step=predicted)
        assert row.rmse == plain.rmse * factor
        assert (row.nrmse, row.r2, row.rrse, row.rrse_one_step) == (plain.nrmse, plain.r2, plain.rrse, plain.rrse_one_step)
        assert row.r_uncentred == plain.r_uncentred
    e = predicted - measured
    assert plain.rmse == np.sqrt(np.mean(e**2))
    assert plain.rrse == np.sqrt(np.sum(e**2) / np.sum((measured - measured.mean()) ** 2))
