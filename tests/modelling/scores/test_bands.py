"""Errors by the size of what was measured, and the correlation about zero."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain.recording import Curve, Dataset, Quantity
from mapmore_cli.modelling.validation.metrics import EDGES, bands, max_abs, score, uncentred


def dataset(measured: np.ndarray, held_out: np.ndarray) -> Dataset:
    curve = Curve("a", None, {"force": measured}, held_out, ("a",))
    return Dataset("force", None, {"force": Quantity("force", "N")}, (), (curve,))


def test_each_sample_is_in_the_band_of_its_size() -> None:
    measured = np.array([0.0, -5.0, 10.0, -24.0, 30.0, 60.0, -100.0])
    found = bands(dataset(measured, np.zeros(7, dtype=bool)), {"off": (measured + np.arange(7.0),)})
    assert [(band.low, band.high, band.samples) for band in found] == [(0, 10, 3), (10, 25, 1), (25, 50, 1), (50, 100, 2)]
    assert found[0].rmse["off"] == pytest.approx(np.sqrt((0 + 1 + 4) / 3))
    assert found[1].rmse["off"] == pytest.approx(3.0)


def test_held_out_samples_decide_where_there_are_any_and_empty_bands_are_left_out() -> None:
    measured = np.array([1.0, 100.0, 2.0, 90.0])
    found = bands(dataset(measured, np.array([False, False, True, True])), {"off": (measured + 2.0,)})
    assert [(band.samples, band.high) for band in found] == [(1, pytest.approx(9.0)), (1, pytest.approx(90.0))]


@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=40), st.integers(0, 99))
def test_the_bands_share_out_the_squared_errors(values: list[float], seed: int) -> None:
    measured = np.array(values)
    predicted = measured + np.random.default_rng(seed).standard_normal(len(measured))
    found = bands(dataset(measured, np.zeros(len(values), dtype=bool)), {"noisy": (predicted,)})
    assert sum(band.samples for band in found) == len(values)
    assert sum(band.samples * band.rmse["noisy"] ** 2 for band in found) == pytest.approx(np.sum((predicted - measured) ** 2))
    assert len(found) < len(EDGES)


def test_the_uncentred_correlation_is_about_zero() -> None:
    measured, predicted = np.array([10.0, 11.0, 12.0]), np.array([12.0, 11.0, 10.0])
    assert np.corrcoef(measured, predicted)[0, 1] == pytest.approx(-1.0)
    assert uncentred(measured, predicted) == pytest.approx(361 / 365)
    assert np.isnan(uncentred(measured, 0.0 * measured))
    row = score("m", "force", "train", "all", measured, predicted, max_abs(measured, "force", "train"))
    assert row.r_uncentred == uncentred(measured, predicted)
