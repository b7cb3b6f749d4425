"""Residual tests against sums that are written out, over gaps and over pieces of many blocks."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling.validation.residuals import (
    autocorrelation,
    cross_correlation,
    means_over,
    residual_tests,
)


def pieces_of(seed, sizes, missing):
    rng = np.random.default_rng(seed)
    pieces = [rng.normal(3.0, 2.0, (2, size)).cumsum(axis=1) for size in sizes]
    for piece in pieces:
        piece[rng.random(piece.shape) < missing] = np.nan
    return [list(columns) for columns in zip(*pieces, strict=True)]


def by_hand(residuals, inputs, most):
    """`sum u_t e_(t+k) / sqrt(sum u^2 sum e^2)`, a pair counts if all four values are known."""
    gap = np.full((2, most), np.nan)  # no pair reaches from one piece into the next
    pairs = [part for piece in zip(residuals, inputs, strict=True) for part in (piece, gap)]
    known = np.concatenate(pairs, axis=1)
    known[:, np.isnan(known).any(axis=0)] = np.nan
    e, u = known - np.nanmean(known, axis=1, keepdims=True)
    sums = [np.nansum(np.roll(u, lag) * e) for lag in range(-most, most + 1)]
    return sums / np.sqrt(np.nansum(e**2) * np.nansum(u**2)), np.isfinite(e).sum()


@pytest.mark.parametrize(
    ("sizes", "missing", "most"),
    [((24, 7), 0.0, 6), ((24, 31), 0.2, 7), ((120, 5), 0.1, 25), ((40_000, 400), 0.01, 25)],
)
def test_correlations_are_sums_over_all_pairs(sizes, missing, most):
    residuals, inputs = pieces_of(7, sizes, missing)
    found = cross_correlation("u", residuals, inputs)
    values, count = by_hand(residuals, inputs, most)
    assert found.x.tolist() == list(range(-most, most + 1))
    np.testing.assert_allclose(found.values, values, atol=1e-9)
    np.testing.assert_allclose(found.bounds, 1.959964 / np.sqrt(count), rtol=1e-6)
    own = autocorrelation(residuals)
    values, count = by_hand(residuals, residuals, most)
    assert own.x.tolist() == list(range(most + 1))
    np.testing.assert_allclose(own.values, values[most:], atol=1e-9)
    np.testing.assert_allclose(own.bounds, 1.959964 / np.sqrt(count), rtol=1e-6)


@given(st.integers(2, 14), st.integers(0, 99))
def test_means_over_values_or_over_tenths_of_the_samples(distinct, seed):
    rng = np.random.default_rng(seed)
    x = rng.permutation(np.append(np.arange(distinct), rng.integers(0, distinct, 60))) * 1.5
    e = rng.normal(size=len(x)) + x
    e[3], x[5] = np.nan, np.nan
    known = np.isfinite(e + x)
    order = np.flatnonzero(known)[np.argsort(x[known], kind="stable")]
    values = np.unique(x[known])
    parts = (
        [np.flatnonzero(known & (x == value)) for value in values]
        if len(values) <= 10
        else np.array_split(order, 10)
    )
    found = means_over("x", e, x)
    np.testing.assert_allclose(found.x, [x[part].mean() for part in parts])
    np.testing.assert_allclose(found.values, [e[part].mean() for part in parts])
    width = 1.959964 * e[known].std() / np.sqrt([len(part) for part in parts])
    np.testing.assert_allclose(found.bounds, width, rtol=1e-6)


def named_tests(columns, predicted, order_by, **curve):
    """The tests of one curve at a level of 2, whose samples are all judged."""
    judged = np.zeros(len(predicted), dtype=bool)
    one = Curve("a", 2.0, columns, judged, ("a", "b"), **curve)
    model = SimpleNamespace(inputs=[SimpleNamespace(name=name) for name in columns])
    made = residual_tests(model, Dataset("force", "level", {}, (), (one,)), [predicted], order_by)
    return {test.name: test for test in made}


def test_pieces_are_recordings_in_time_and_whole_curves_along_a_quantity():
    """An input that holds still to 1e-9, or is not known for all samples, has no test; a level is
    one value.
    """
    rng = np.random.default_rng(3)
    n = 60
    x = rng.permutation(n) * 1.0
    columns = {
        "strain": x,
        "force": np.zeros(n),
        "still": 5.0 + 4e-9 * (x > 30),
        "barely": -5.0 - 2e-8 * (x > 30),
        "still below": -5.0 - 4e-9 * (x > 30),
        "of recordings": 1.0 + (np.arange(n) >= 25),
        "level": 2.0 + 0.01 * x,
    }
    predicted = rng.normal(size=n)
    origin = np.repeat([0, 1], [25, 35])
    found = named_tests(columns, predicted, None, origin=origin)
    assert set(found) == {"autocorrelation", "strain", "barely", "of recordings"}
    parts = [predicted[:25], predicted[25:]]
    np.testing.assert_allclose(found["autocorrelation"].values, autocorrelation(parts).values)
    crossed = cross_correlation("", parts, [x[:25], x[25:]])
    np.testing.assert_allclose(found["strain"].values, crossed.values)
    whole = named_tests(columns, predicted, None)
    np.testing.assert_allclose(
        whole["strain"].values, cross_correlation("", [predicted], [x]).values
    )
    along = named_tests(columns, predicted, "strain", origin=origin)
    order = np.argsort(x)
    np.testing.assert_allclose(
        along["autocorrelation"].values, autocorrelation([predicted[order]]).values
    )
    np.testing.assert_allclose(along["strain"].x, np.arange(4.5 - 2, 60, 6))
    unknown = np.where(origin == 1, np.nan, predicted)
    short = named_tests(columns, unknown, None, origin=origin)
    of_two = named_tests(columns, predicted, None, origin=np.repeat([0, 1], [50, 10]))
    assert of_two["autocorrelation"].x[-1] == 50 // 4  # one long enough recording suffices
    assert short["autocorrelation"].x[-1] == 25 // 4  # the recording without predictions is longer
