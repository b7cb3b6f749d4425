"""Metrics, their parts and bands; residual tests against definitions written down here, and against
errors whose cause is known.
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from common import curve_of, dataset_of
from error_parts import error_parts
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain import arrays
from mapmore_cli.domain.arrays import extremes
from mapmore_cli.domain.results import Forecast
from mapmore_cli.domain.scores import MEASURES, OF_TARGET
from mapmore_cli.modelling.validation import metrics
from mapmore_cli.modelling.validation.metrics import bands, ends_of, normaliser


def score(measured, predicted, scale=None, **more):
    """The row of some samples, all of them ready if nothing is said."""
    dataset = dataset_of({"force": measured}, output="force")
    more = {"ready": np.ones(len(measured), dtype=bool), **more}
    scale = scale or normaliser("max", extremes(measured), "force", "train")
    forecast = Forecast(predicted, **more)
    return next(metrics.score_rows("m", "static", [forecast], dataset, scale))


@given(st.integers(0, 10**6))
def test_numbers_of_long_recordings_are_those_of_whole_arrays(seed):
    """With every formula of the table by hand, and read block by block."""
    random = np.random.default_rng(seed)
    y, p, one, half, sigma = random.normal([[3], [3], [2], [1], [4]], 1, (5, 50))
    half, sigma, ready = np.abs(half), np.abs(sigma), random.random(50) < 0.7
    curve = curve_of({"force": y, "force_uncertainty": sigma})
    dataset = replace(dataset_of({"force": y}, output="force"), curves=(curve,))
    scale = normaliser("max", extremes(y), "force", "train")
    forecast = Forecast(p, ready, one, half)
    with pytest.MonkeyPatch.context() as patch:
        whole, *_ = metrics.score_rows("m", "force", [forecast], dataset, scale, free=3)
        patch.setattr(metrics, "HELD", 10)
        patch.setattr(metrics, "row_blocks", partial(arrays.row_blocks, rows=7))
        parts, *_ = metrics.score_rows("m", "force", [forecast], dataset, scale, free=3)
    spread = np.sum((y - y.mean()) ** 2)
    e, known, weight = (p - y)[ready], y[ready], sigma[ready] ** -2
    one_step = np.sqrt(np.sum((one - y)[ready] ** 2) / spread)
    by_hand = {
        "n": ready.sum(),
        "rmse": np.sqrt(np.mean(e**2)),
        "nrmse": np.sqrt(np.mean(e**2)) / scale.value,
        "normaliser": np.abs(y).max(),
        "max_abs_error": np.abs(e).max(),
        "max_abs_error_fs": np.abs(e).max() / scale.value,
        "r2": 1 - np.sum(e**2) / np.sum((known - known.mean()) ** 2),
        "rrse": np.sqrt(np.sum(e**2) / spread),
        "rrse_one_step": one_step,
        "r_uncentred": known @ p[ready] / np.sqrt(known @ known * (p[ready] @ p[ready])),
        "interval_coverage": np.mean(np.abs(e) <= half[ready]),
        "interval_half_width": np.median(half[ready]),
        "nrmse_range": np.sqrt(np.mean(e**2)) / np.ptp(y),
        "rmse_weighted": np.sqrt(np.sum(weight * e**2) / np.sum(weight)),
        "chi2_dof": np.sum(weight * e**2) / (ready.sum() - 3),
    }
    assert by_hand.keys() == MEASURES.keys(), "a number of the table is tested nowhere"
    for row in (whole, parts):
        assert {name: getattr(row, name) for name in by_hand} == pytest.approx(by_hand, rel=1e-12)


def test_headings_name_the_unit_and_a_limit_is_on_the_better_side():
    headings = {name: measure.heading for name, measure in MEASURES.items() if measure.heading}
    assert {name for name in headings if "UNIT" in headings[name]} == OF_TARGET & headings.keys()
    random = np.random.default_rng(1)
    y, error = random.normal(9, 1, 50), random.normal(0, 1, 50)
    near, far = (
        score(y, y + size * error, one_step=y + size * error, half=np.ones(50)) for size in (0.1, 2)
    )
    larger = {name for name in MEASURES if getattr(near, name) > getattr(far, name)}
    smaller = {name for name in MEASURES if getattr(near, name) < getattr(far, name)}
    assert len(larger | smaller) > 8
    assert larger == {name for name in larger | smaller if MEASURES[name].at_least}


def test_rows_are_of_splits_curves_directions_and_groups():
    """Numbers that were fitted count in the row of all training samples alone."""
    ways = np.array([1.0, 1, -1, -1, 1, -1])
    first = {"force": np.arange(6.0), "direction": ways, "day": np.array([1.0, 2, 1, 2, 1, 2])}
    first["force_uncertainty"] = np.ones(6)
    second = {name: x[:3] for name, x in first.items()}
    curves = (curve_of(first, np.arange(6) == 5, "b"), curve_of(second))
    given = replace(forces(np.zeros(1)), curves=curves)
    ready = np.arange(6) > 0
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
    partly = [replace(said[0], half=np.full(6, 2.0)), said[1]]
    whole, *each = metrics.score_rows("m", "t", partly, given, scale)
    assert {row.interval_half_width for row in each if row.curve == "b"} == {2.0}
    assert whole.interval_half_width == 2.0, "the widths are known for a part of the samples"
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


def test_the_ends_of_columns_are_those_of_all_chosen_rows_together():
    columns = [np.array([3.0, 1.0, 99.0]), np.array([5.0, -2.0, 4.0]), np.array([-9.0])]
    masks = [np.array([True, True, False]), np.ones(3, dtype=bool), np.zeros(1, dtype=bool)]
    assert ends_of(columns, masks) == ends_of(columns[::-1], masks[::-1]) == (-2.0, 5.0)


def test_a_constant_has_no_r2_and_zeros_no_nrmse():
    row = score(np.zeros(3), np.ones(3))
    assert math.isnan(row.r2)
    assert math.isnan(row.nrmse)
    assert math.isnan(row.r_uncentred)
    assert row.rmse == 1


CYCLES, LONG = 8, 200
X = np.tile(1 - np.cos(np.linspace(0, 2 * np.pi, LONG, endpoint=False)), CYCLES)
CYCLE = np.repeat(np.arange(CYCLES), LONG)
PLACE = np.linspace(0, 2 * np.pi * CYCLES, len(X), endpoint=False)


def of(error, held=CYCLE >= CYCLES // 2, parts=(slice(None),)):
    curves = [
        curve_of({"x": X[rows], "y": np.zeros(len(X[rows]))}, held[rows], f"r{n}")
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
