"""What rows of a score table and tests of residuals decide, and how those of several outputs are
joined.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from mapmore_cli.domain.compared import Compared, Normaliser, SampleBlock, ratio
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.results import FitResult, Forecast, OutputsFit, ResidualTest, Validation
from mapmore_cli.domain.scores import (
    MEASURES,
    Limit,
    Published,
    Score,
    ScoreTable,
    deciding,
)


def row(target="force", split="validate", curve="all", nrmse=0.1, **more):
    return Score(
        "mapmore", target, split, curve, 9, 2.0, nrmse, 20.0, "max", 5.0, 0.25, 0.9, **more
    )


@pytest.mark.parametrize(
    ("metric", "kept"),
    [("rmse", (True, True, False)), ("r2", (False, True, True)), ("n", (False, True, True))],
)
def test_a_limit_is_kept_at_its_value_and_never_by_nothing(metric, kept):
    limits = [Limit(metric, "mapmore", "validate", value, 2.0) for value in (1.9, 2.0, 2.1)]
    assert tuple(limit.kept for limit in limits) == kept
    assert not Limit(metric, "mapmore", "validate", math.nan, 2.0).kept
    assert limits[0].sentence == (
        f"{metric} of mapmore on the validate rows is 1.9; the limit is 2"
    )


@pytest.mark.parametrize(
    ("ahead", "free", "shown"),
    [(math.nan, 0.5, False), (0.5, 0.5, False), (0.1, 0.5, True), (0.1, math.nan, True)],
)
def test_a_run_is_free_if_its_error_is_not_that_of_one_step(ahead, free, shown):
    assert row(rrse=free, rrse_one_step=ahead).runs_free == shown
    assert MEASURES["rrse"].shown(row(rrse=free, rrse_one_step=ahead)) == shown


def test_a_target_is_far_from_zero_if_its_range_is_less_than_a_third_of_the_scale():
    assert [row(nrmse_range=share).far for share in (0.29, 0.31, math.nan)] == [False, True, False]
    assert not row(nrmse=0.25, nrmse_range=0.75).far


def test_the_correlation_without_means_is_a_cosine():
    """Of the angle between (1, 2) and (2, 1), in any size."""
    measured, predicted = np.array([1.0, 2.0]), np.array([20.0, 10.0])
    none = np.full(2, math.nan)
    block = SampleBlock(measured, measured, predicted, none, none, none)
    assert Compared(lambda: [block], Normaliser("", 1.0)).correlation == pytest.approx(0.8)


def test_numbers_of_all_blocks_are_taken_together():
    """Of errors 1, -2, nothing, and 6, whose uncertainties are 1, 2, 1 and 3."""
    parts = np.array([1.0, -2.0]), np.array([math.nan, 6.0])
    sigmas = np.array([1.0, 2.0]), np.array([1.0, 3.0])
    zero = np.zeros(2)
    blocks = [
        SampleBlock(zero, zero, error, zero, zero, sigma)
        for error, sigma in zip(parts, sigmas, strict=True)
    ]
    compared = Compared(lambda: blocks, Normaliser("", 1.0))
    assert compared.median(lambda block: block.error) == 1
    assert Compared(lambda: blocks[:1], Normaliser("", 1.0)).chi2 == 2
    assert math.isnan(compared.median(lambda block: math.nan * block.sigma))


def test_each_output_has_its_own_fit():
    one, other = FitResult(None), FitResult(None)
    assert FitResult(OutputsFit({"x": one, "y": other})).each == (one, other)
    assert one.each == (one,)


def test_an_error_is_no_fraction_of_nothing():
    assert ratio(1.0, 0.5) == 2
    assert math.isnan(ratio(1.0, 0.0))
    assert Normaliser("", 2.0).fraction(1.0) == 0.5
    assert math.isnan(Normaliser("", 0.0).fraction(1.0))


def test_a_table_of_several_targets_has_one_of_each():
    rows = row(), row("strain"), row("force", "train")
    whole = ScoreTable(rows, {"force": "N", "strain": "1"}, ("a",), ("b",), {"strain": "bent"})
    force, strain = whole.each
    assert (force.scores, strain.scores) == (rows[::2], rows[1:2])
    assert (force.units, strain.units) == ({"force": "N"}, {"strain": "1"})
    assert (force.alert, strain.alert, whole.alert) == ("", "bent", "bent")
    assert (strain.failed, strain.warnings, force.each) == (("a",), ("b",), (force,))


def test_rows_of_held_out_data_decide_if_there_are_any():
    train, part, held = row(split="train"), row(curve="a"), row()
    assert deciding([train, part, held]) == [held]
    assert deciding([train, part]) == [train]


def test_an_error_that_was_printed_as_a_bound_is_marked():
    printed = Published("a paper", rmse={"a": 1.5, "b": 2.0}, rmse_at_least={"b": 1.2345})
    assert [printed.shown_rmse(name) for name in "abc"] == [1.5, ">= 1.23", None]


@pytest.mark.parametrize("name", ["autocorrelation", "strain"])
@pytest.mark.parametrize("count", [1, 7, 26])
def test_more_values_outside_than_noise_explains_fail_a_test(name, count):
    """By the binomial distribution; the correlation of a residual with itself is not tested."""
    own = int(name == "autocorrelation")
    for beyond in range(count + 1):
        values = np.where(np.arange(count + own) < beyond + own, -2.0, 1.0)
        found = ResidualTest(name, np.arange(count + own), values, np.full(count + own, 1.5))
        assert (found.tested, found.beyond) == (count, beyond)
        assert found.fails == (stats.binom.sf(beyond - 1, count, 0.05) < 0.01)
        words = "lags" if own else "checks of strain"
        assert found.words == f"{beyond} of {count} {words}"
    at_bound = ResidualTest(name, np.arange(3), np.full(3, -1.5), np.full(3, 1.5))
    assert at_bound.beyond == 0


def test_a_run_diverges_at_the_first_row_of_each_stretch_that_it_loses():
    values = np.array([np.nan, 1.0, np.nan, np.nan, 2.0, np.nan])
    run = Forecast(values, np.arange(6) > 0, values)
    assert run.diverged == (2, 5)
    assert Forecast(values, np.ones(6, dtype=bool)).diverged == ()
    assert Forecast(values, np.ones(6, dtype=bool), values).diverged == (0, 2, 5)
    assert Forecast.of(values).ready.all()


def test_validations_of_outputs_are_joined_in_one_table():
    def fit(status):
        return FormulaFit("a", {}, {}, status, "-", 0, 1.0, 0.0, 9)

    x = np.arange(20.0)
    bent, noise = (ResidualTest("x", x, values, np.full(20, 5.0)) for values in (x, 0 * x))
    formulas = {"a": fit("failed"), "b": fit("at_bound")}
    other = Validation(
        {}, {"a": fit("failed")}, (row("strain"),), {"strain": "1"}, warnings=("v", "w")
    )
    whole = Validation(
        {}, formulas, (row(),), {"force": "N"}, warnings=("w",), residual_tests=(bent, noise),
        others=(other,),
    )  # fmt: skip
    table = whole.table
    assert [score.target for score in table.scores] == ["force", "strain"]
    assert (table.units, table.failed) == ({"force": "N", "strain": "1"}, ("a",))
    assert table.warnings == ("w", "v")
    said = "the errors are not noise alone (14 of 20 checks of x are outside)"
    assert (table.alerts, whole.alert, other.alert) == ({"force": said}, said, "")
    assert whole.each == (replace(whole, others=()), other)
