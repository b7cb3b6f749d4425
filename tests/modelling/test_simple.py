"""Competitors that need no muscle, against independent sums."""

import numpy as np
import pytest
from common import dataset_of
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.modelling import simple


@given(st.integers(1, 3), st.integers(1, 3), st.integers(0, 10_000))
def test_a_polynomial_is_found_exactly(degree, inputs, seed):
    """Any scale of the inputs; held-out samples are never looked at."""
    rng = np.random.default_rng(seed)
    names = [f"u{i}" for i in range(inputs)]
    columns = {
        name: rng.uniform(-1, 1, 80) * 10 ** rng.uniform(-3, 3) + rng.uniform(-1, 1)
        for name in names
    }
    x = np.column_stack([columns[name] / np.abs(columns[name]).max() for name in names])
    truth = np.sum(x, axis=1) ** degree + 3.0
    held_out = np.arange(80) >= 60
    columns["y"] = np.where(held_out, 1e6, truth)
    (found,) = simple.polynomial_fit(degree, dataset_of(columns, held_out=held_out), names) or []
    np.testing.assert_allclose(found, truth, rtol=1e-7, atol=1e-7)


def test_too_few_samples_make_no_polynomial():
    assert (
        simple.polynomial_fit(3, dataset_of({"u": np.arange(3.0), "y": np.arange(3.0)}), ["u"])
        is None
    )
    assert simple.polynomial_fit(1, dataset_of({"y": np.arange(3.0)}), []) is None


@pytest.mark.parametrize("names", [["u"], []])
def test_the_free_run_is_the_recursion(names):
    """By a plain loop: y[k] = c + 1.2 y[k-1] - 0.5 y[k-2] + 0.3 u[k-1], at rest at y[0] before the
    record.
    """
    rng = np.random.default_rng(2)
    u = rng.normal(size=400) if names else np.zeros(400)
    theta = np.array([0.1, 1.2, -0.5, *([0.0, 0.3, 0.0] if names else [])])
    y = np.full(400, 0.7)
    expected = np.empty(400)
    for k in range(400):
        before = [expected[k - 1] if k > 0 else y[0], expected[k - 2] if k > 1 else y[0]]
        expected[k] = 0.1 + 1.2 * before[0] - 0.5 * before[1] + 0.3 * u[max(k - 1, 0)] * bool(names)
    curve = dataset_of({"u": u, "y": y}).curves[0]
    np.testing.assert_allclose(simple._run(curve, "y", names, 2, theta), expected, rtol=1e-9)


def test_an_arx_is_found():
    rng = np.random.default_rng(3)
    u, y = rng.normal(size=600), np.zeros(600)
    for k in range(2, 600):
        y[k] = 1.2 * y[k - 1] - 0.5 * y[k - 2] + 0.3 * u[k - 1]
    (found,) = simple.arx(dataset_of({"u": u, "y": y}, held_out=np.arange(600) >= 300), ["u"]) or []
    np.testing.assert_allclose(found[80:], y[80:], atol=1e-8)  # what it starts from is forgotten


def test_a_run_that_diverges_has_no_prediction():
    curve = dataset_of({"u": np.ones(200), "y": np.ones(200)}).curves[0]
    found = simple._run(curve, "y", ["u"], 1, np.array([0.0, 1.5, 1.0, 0.0]))
    assert np.isfinite(found[:10]).all()
    assert np.isnan(found[-100:]).all()
