"""Metrics, their parts and bands; residual tests against definitions written down here, and against
errors whose cause is known.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from common import dataset_of
from error_parts import error_parts
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain import arrays
from mapmore_cli.domain.arrays import extremes
from mapmore_cli.domain.recording import Curve
from mapmore_cli.domain.results import Forecast
from mapmore_cli.domain.scores import NUMBERS
from mapmore_cli.modelling.validation import metrics
from mapmore_cli.modelling.validation.metrics import Sums, bands, normaliser
from mapmore_cli.modelling.validation.residuals import (
    PARTS,
    autocorrelation,
    cross_correlation,
    means_over,
)


def score(measured, predicted, scale=None, **more):
    """The row of some samples, all of them ready."""
    found = Forecast(predicted, np.ones(len(measured), dtype=bool), **more)
    return metrics.score(
        "m",
        "static",
        "validate",
        "all",
        Sums.of(measured, found),
        scale or normaliser("max", extremes(measured), "force", "validate"),
    )


def test_a_row_by_hand():
    measured = np.array([0.0, 10, -20, 30])
    row = score(measured, np.array([1.0, 9, -17, 29]))
    assert row.rmse == pytest.approx(math.sqrt(12 / 4))
    assert row.nrmse == pytest.approx(row.rmse / 30)
    assert (row.normaliser, row.normaliser_name) == (30, "max|force| over validate")
    assert row.max_abs_error == 3
    assert row.max_abs_error_fs == pytest.approx(0.1)
    assert row.r2 == pytest.approx(1 - 12 / 1300)
    assert row.n == 4


def test_errors_by_the_range_do_not_depend_on_where_zero_lies():
    measured = np.array([110.0, 112, 130])
    scale = normaliser("range", extremes(measured), "displacement", "validate")
    row = score(measured, measured + 2, scale)
    assert (row.nrmse, row.normaliser_name) == (
        pytest.approx(0.1),
        "range of displacement over validate",
    )
    assert normaliser("range", extremes(measured - 1000), "displacement", "validate") == scale


@given(st.integers(0, 10**6), st.lists(st.integers(0, 50), max_size=4), st.integers(-900, 900))
def test_a_row_is_the_sum_of_its_blocks(seed, cuts, exponent):
    random = np.random.default_rng(seed)
    y, *said = 2.0**exponent * random.normal([[3], [3], [2], [1]], 1, (4, 50))
    said = Forecast(said[0], random.random(50) < 0.7, said[1], np.abs(said[2]))
    edges = [0, *sorted(cuts), 50]
    parts = [Sums.of(y[a:b], said.at(slice(a, b))) for a, b in pairwise(edges)]
    scale = normaliser("max", extremes(y), "force", "validate")
    rows = [
        metrics.score("m", "static", "validate", "all", sums, scale)
        for sums in (Sums.together(parts), Sums.of(y, said))
    ]
    one, whole = ([getattr(row, name) for name in NUMBERS] for row in rows)
    assert one == pytest.approx(whole, rel=1e-11, abs=1e-13, nan_ok=True)


def test_chi_square_is_by_the_uncertainty_and_the_numbers_that_were_fitted():
    y, sigma = np.array([1.0, 2.0, 4.0]), np.array([0.5, 1.0, 2.0])
    sums = Sums.of(y, Forecast.of(y + np.array([1.0, 1.0, -4.0])), sigma=sigma)
    scale = normaliser("max", extremes(y), "force", "train")
    by_free = [metrics.score("m", "t", "train", "all", sums, scale, n) for n in (0, 1, 3)]
    assert [row.chi2_dof for row in by_free] == pytest.approx([9 / 3, 9 / 2, math.nan], nan_ok=True)
    assert by_free[0].rmse_weighted == pytest.approx(math.sqrt(9 / (4 + 1 + 0.25)))


def test_rows_are_of_splits_curves_directions_and_groups():
    """Numbers that were fitted count in the row of all training samples alone."""
    nothing, ways = np.zeros(6, dtype=bool), np.array([1.0, 1, -1, -1, 1, -1])
    first = {"force": np.arange(6.0), "direction": ways, "day": np.array([1.0, 2, 1, 2, 1, 2])}
    first["force_uncertainty"] = np.ones(6)
    second = {name: x[:3] for name, x in first.items()}
    curves = (
        Curve("b", None, first, np.arange(6) == 5, ("b",)),
        Curve("a", None, second, nothing[:3], ("a",)),
    )
    given = replace(forces(np.zeros(1)), curves=curves)
    ready = ~nothing
    ready[0] = False
    errors = np.array([9.0, 1, -2, 3, 4, -5])
    said = [Forecast(first["force"] + errors, ready), Forecast.of(second["force"] + 1)]
    scale = metrics.divisor(given, "max")
    assert (scale.value, scale.name) == (5.0, "max|force| over validate")

    def rows(**more):
        found = metrics.score_rows("m", "t", said, given, scale, **more)
        return {(row.split, row.curve): (row.n, round(row.rmse**2, 9)) for row in found}

    expected = {
        ("train", "all"): (7, round((1 + 4 + 9 + 16 + 3) / 7, 9)),
        ("train", "b"): (4, 7.5),
        ("train", "a"): (3, 1.0),
        ("train", "b;direction=rise"): (2, 8.5),
        ("train", "b;direction=fall"): (2, 6.5),
        ("train", "a;direction=rise"): (2, 1.0),
        ("train", "a;direction=fall"): (1, 1.0),
        ("train", "day=1"): (4, round((4 + 16 + 1 + 1) / 4, 9)),
        ("train", "day=2"): (3, round((1 + 9 + 1) / 3, 9)),
        ("validate", "all"): (1, 25.0),
        ("validate", "b"): (1, 25.0),
        ("validate", "b;direction=fall"): (1, 25.0),
        ("validate", "day=2"): (1, 25.0),
    }
    found = rows(group="day")
    assert (found, list(found)) == (expected, list(expected))
    free = list(metrics.score_rows("m", "t", said, given, scale, free=3))
    assert {row.curve: row.chi2_dof for row in free if row.split == "train"} == {
        "all": (1 + 4 + 9 + 16 + 3) / 4,
        "b": 7.5,
        "a": 1.0,
        "b;direction=rise": 8.5,
        "b;direction=fall": 6.5,
        "a;direction=rise": 1.0,
        "a;direction=fall": 1.0,
    }


def test_information_criteria_and_normalisers_by_hand():
    assert metrics.information_criteria(10, 0.5, 3) == pytest.approx(
        (10 * math.log(0.25) + 6, 10 * math.log(0.25) + 3 * math.log(10))
    )
    assert metrics.information_criteria(10, 0.0, 3) == (-math.inf, -math.inf)
    assert [
        normaliser(kind, (-30.0, 10.0), "force", "train").value for kind in ("max", "range")
    ] == [30.0, 40.0]


def test_a_constant_has_no_r2_and_zeros_no_nrmse():
    row = score(np.zeros(3), np.ones(3))
    assert math.isnan(row.r2)
    assert math.isnan(row.nrmse)
    assert row.rmse == 1


def test_the_smallest_and_the_largest_forces_have_scores_too():
    """Their squares vanish or overflow; times a power of two, nothing but the exponent changes."""
    measured, predicted = np.array([1.25, 10, -20, 30.1]), np.array([1.0, 9.3, -17, 29])
    for exponent in (0, -1000, 1000, -700, 500):
        factor = 2.0**exponent
        y = measured * factor
        row = score(y, predicted * factor, one_step=predicted * factor)
        plain = score(measured, predicted, one_step=predicted)
        assert row.rmse == plain.rmse * factor
        for name in ("nrmse", "r2", "rrse", "rrse_one_step", "r_uncentred"):
            assert getattr(row, name) == getattr(plain, name)
    e = predicted - measured
    assert plain.rmse == np.sqrt(np.mean(e**2))
    assert plain.rrse == np.sqrt(np.sum(e**2) / np.sum((measured - measured.mean()) ** 2))


CYCLES, LONG = 8, 200
X = np.tile(1 - np.cos(np.linspace(0, 2 * np.pi, LONG, endpoint=False)), CYCLES)
CYCLE = np.repeat(np.arange(CYCLES), LONG)
PLACE = np.linspace(0, 2 * np.pi * CYCLES, len(X), endpoint=False)


def of(error, held=CYCLE >= CYCLES // 2, parts=(slice(None),)):
    curves = [
        Curve(f"r{n}", None, {"x": X[rows], "y": np.zeros(len(X[rows]))}, held[rows], (f"r{n}",))
        for n, rows in enumerate(parts)
    ]
    return error_parts(
        curves,
        [error[rows] for rows in parts],
        "y",
        "x",
        {f"r{n}": "log" for n in range(len(parts))},
    )


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("drift", 0.3 * CYCLE),
        ("shape", np.sin(PLACE)),
        ("change", np.where(CYCLE >= CYCLES // 2, 1.0, 1e-3) * np.cos(3 * PLACE)),
        ("rest", np.random.default_rng(1).normal(0, 1, len(X))),
    ],
)
def test_a_planted_part_is_found(name, error):
    for one in of(error)[name == "change" :]:
        assert one.limit == name
        others = [value for part, value in one.rms.items() if part != name]
        assert max(others) < 0.35 * one.rms[name]


def test_without_two_training_cycles_one_tells_nothing():
    assert [one.split for one in of(np.ones(len(X)), held=CYCLE != 0)] == ["validate"]
    assert of(np.where(CYCLE > 1, np.nan, 1.0), held=CYCLE > 0) == ()


def forces(measured, held_out=None):
    return dataset_of({"force": measured}, held_out=held_out, output="force")


def test_each_sample_is_in_the_band_of_its_size():
    measured = np.array([0.0, -5.0, 10.0, -24.0, 30.0, 60.0, -100.0])
    found = bands(forces(measured), {"off": (measured + np.arange(7.0),)})
    assert [(band.low, band.high, band.samples) for band in found] == [
        (0, 10, 3),
        (10, 25, 1),
        (25, 50, 1),
        (50, 100, 2),
    ]
    assert [found[0].rmse["off"], found[1].rmse["off"]] == pytest.approx(
        [np.sqrt((0 + 1 + 4) / 3), 3.0]
    )


def test_held_out_samples_decide_where_there_are_any_and_empty_bands_are_left_out():
    measured = np.array([1.0, 100.0, 2.0, 90.0])
    found = bands(
        forces(measured, np.array([False, False, True, True])), {"off": (measured + 2.0,)}
    )
    assert [(band.samples, band.high) for band in found] == [
        (1, pytest.approx(9.0)),
        (1, pytest.approx(90.0)),
    ]


def test_the_uncentred_correlation_is_about_zero():
    measured, predicted = np.array([10.0, 11.0, 12.0]), np.array([12.0, 11.0, 10.0])
    assert np.corrcoef(measured, predicted)[0, 1] == pytest.approx(-1.0)
    row = score(measured, predicted)
    assert row.r_uncentred == pytest.approx(361 / 365)
    assert np.isnan(score(measured, 0.0 * measured).r_uncentred)


@given(st.integers(0, 10**6), st.integers(40, 120))
def test_one_piece_is_the_textbook_formula(seed, n):
    random = np.random.default_rng(seed)
    e, u = random.normal(2, 1, n), random.normal(-3, 2, n)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(arrays, "ROWS", 7)
        found = autocorrelation([e])
    c, d = e - e.mean(), u - u.mean()
    for lag, value in zip(found.x, found.values, strict=True):
        np.testing.assert_allclose(
            value, sum(c[t] * c[t + int(lag)] for t in range(n - int(lag))) / sum(c**2), atol=1e-12
        )
    crossed = cross_correlation("u", [e], [u])
    for lag, value in zip(crossed.x.astype(int), crossed.values, strict=True):
        pairs = [(t, t + lag) for t in range(n) if 0 <= t + lag < n]
        np.testing.assert_allclose(
            value, sum(d[a] * c[b] for a, b in pairs) / np.sqrt(sum(c**2) * sum(d**2)), atol=1e-12
        )


def test_noise_stays_within_the_bounds_nineteen_times_in_twenty():
    random = np.random.default_rng(11)
    own = [autocorrelation([random.normal(size=150), random.normal(size=250)]) for _ in range(60)]
    crossed = [
        cross_correlation("u", [random.normal(size=400)], [random.normal(size=400)])
        for _ in range(60)
    ]
    parts = [means_over("u", random.normal(size=400), random.uniform(size=400)) for _ in range(60)]
    for tests in (own, crossed, parts):
        assert 0.02 < sum(test.beyond for test in tests) / sum(test.tested for test in tests) < 0.08


def test_pieces_do_not_touch():
    """The end of one piece tells nothing of the beginning of the next."""
    ramp = np.linspace(-1, 1, 40)
    apart, joined = (
        autocorrelation([ramp, -ramp, ramp]),
        autocorrelation([np.concatenate([ramp, -ramp, ramp])]),
    )
    total = 3 * np.sum(ramp**2)
    np.testing.assert_allclose(apart.values[1], 3 * np.sum(ramp[:-1] * ramp[1:]) / total)
    assert joined.values[1] > apart.values[1]  # +1 meets +1 where they were put together


def test_parts_are_values_where_there_are_few_else_as_many_samples_each():
    random = np.random.default_rng(6)
    level = random.choice([80.0, 150.0, 250.0], 300)
    errors = np.where(level == 150, 1.0, 0.0) + random.normal(0, 0.5, 300)
    found = means_over("level", errors - errors.mean(), level)
    assert found.x.tolist() == [80.0, 150.0, 250.0]
    assert found.beyond == 3
    assert found.values[1] == np.mean((errors - errors.mean())[level == 150])
    assert len(means_over("u", errors, random.uniform(size=300)).x) == PARTS
