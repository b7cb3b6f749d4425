"""Competitors that need no muscle, against independent sums."""

import numpy as np
from common import curve_of, dataset_of
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain import arrays
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling import simple
from mapmore_cli.modelling.kinds import equations


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
    dataset = dataset_of(columns, held_out=held_out)
    fitted = simple.polynomial_fit(degree, dataset, names)
    (found,) = fitted.of_curves(dataset)
    np.testing.assert_allclose(found, truth, rtol=1e-7, atol=1e-7)


def test_too_few_samples_make_no_polynomial():
    assert (
        simple.polynomial_fit(3, dataset_of({"u": np.arange(3.0), "y": np.arange(3.0)}), ["u"])
        is None
    )
    assert simple.polynomial_fit(1, dataset_of({"y": np.arange(3.0)}), []) is None


def test_a_record_whose_columns_are_kept_in_files_has_the_same_arx(monkeypatch):
    u = np.random.default_rng(3).normal(size=600)
    dataset = dataset_of({"u": u, "y": np.convolve(u, [0, 0.5, 0.2])[:600]})
    monkeypatch.setattr(simple, "MOST_ROWS", 300)
    _, (in_memory,) = simple.arx(dataset, ["u"])
    monkeypatch.setattr(arrays, "LONG", 100)
    _, (in_files,) = simple.arx(dataset, ["u"])
    np.testing.assert_array_equal(in_files, in_memory)


def test_an_arx_is_found():
    """With an input, from what a plain loop makes, and without one."""
    u, y = np.random.default_rng(3).normal(size=600), np.zeros(600)
    for k in range(2, 600):
        y[k] = 0.1 + 1.2 * y[k - 1] - 0.5 * y[k - 2] + 0.3 * u[k - 1]
    for names, output, most in ((["u"], y, 1e-8), ([], 3 + 0.99 ** np.arange(600), 5e-3)):
        data = dataset_of({"u": u, "y": output}, held_out=np.arange(600) >= 300)
        _, (found,) = simple.arx(data, names)
        # what it starts from is forgotten
        np.testing.assert_allclose(found[80:], output[80:], rtol=0, atol=most)


def test_a_run_that_diverges_has_no_prediction():
    """What doubles while it trains goes on to do so."""
    y = np.where(np.arange(400) < 40, 2.0 ** np.arange(400.0), 1.0)
    data = dataset_of({"u": np.ones(400), "y": y}, held_out=np.arange(400) >= 40)
    _, (found,) = simple.arx(data, ["u"])
    assert np.isfinite(found[:10]).all()
    assert np.isnan(found[-100:]).all()


def test_a_run_has_diverged_at_a_thousand_times_the_largest_output_of_all_blocks():
    y = np.ones(40_000)
    y[30_000] = -8.0
    doubling = simple.Arx("y", (), 1, np.array([0.0, 2.0]))
    found = simple._run(curve_of({"y": y}), doubling)
    assert found[:12].tolist() == (2.0 ** np.arange(1, 13)).tolist()
    assert np.isnan(found[12:]).all()  # 2^13 is larger than 8000


def test_a_cubic_of_many_quantities_has_an_equation():
    """It has 969 terms of sixteen quantities, more than a text of an expression may have."""
    names = [f"x_{number}" for number in range(16)]
    cubic = simple.Polynomial(names, 3, np.zeros(16), np.ones(16), np.linspace(1, 2, 969))
    output, *inputs = (Quantity(name, "1") for name in ("y", *names))
    assert "x_15" in equations(Model("cubic", output, tuple(inputs), cubic.as_pieces()))[0].text
