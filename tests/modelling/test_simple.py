"""Competitors that need no muscle, against independent sums."""

from math import comb

import numpy as np
import pytest
from common import curve_of, dataset_of
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain import arrays
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset, Quantity
from mapmore_cli.modelling import simple
from mapmore_cli.modelling.kinds import equations, predict, simulate


def test_rows_of_a_polynomial_are_known_sorted_and_thinned(monkeypatch):
    """Every second sample that trains, of 100 for 4 times 10; then ten, spread over their order."""
    monkeypatch.setattr(simple, "MOST_ROWS", 10)
    rng = np.random.default_rng(2)
    columns = {name: rng.integers(0, 4, 100) * 1.0 for name in ("u", "v", "y")}
    columns["u"][8], columns["y"][6] = np.nan, np.nan
    held_out = np.arange(100) > 80
    x, y = simple.training_rows(dataset_of(columns, held_out=held_out), ["u", "v"])
    rows = np.column_stack([columns[name][:81:2] for name in ("u", "v", "y")])
    known = [row for row in rows.tolist() if np.isfinite(row).all()]
    rows = sorted(known, key=lambda row: (row[1], row[0], row[2]))
    spread = np.linspace(0, len(rows) - 1, 10).round().astype(int)
    assert np.column_stack([x, y]).tolist() == [rows[place] for place in spread]


@given(st.sampled_from(["plane", "quadratic", "cubic"]), st.integers(1, 3), st.integers(0, 10_000))
def test_a_polynomial_is_found_exactly(name, inputs, seed):
    """Any scale of the inputs; held-out samples are never looked at."""
    rng = np.random.default_rng(seed)
    names = [f"u{i}" for i in range(inputs)]
    columns = {
        name: rng.uniform(-1, 1, 80) * 10 ** rng.uniform(-3, 3) + rng.uniform(-1, 1)
        for name in names
    }
    x = np.column_stack([columns[name] / np.abs(columns[name]).max() for name in names])
    degree = {"plane": 1, "quadratic": 2, "cubic": 3}[name]
    truth = np.sum(x, axis=1) ** degree + 3.0
    held_out = np.arange(80) >= 60
    columns["y"] = np.where(held_out, 1e6, truth)
    dataset = dataset_of(columns, held_out=held_out)
    fitted = simple.polynomial_fit(simple.DEGREES[name], dataset, names)
    assert len(fitted.theta) == comb(inputs + degree, degree)
    (found,) = fitted.of_curves(dataset)
    np.testing.assert_allclose(found, truth, rtol=1e-7, atol=1e-7)
    pieces = fitted.as_pieces()
    quantities = tuple(Quantity(name, "1") for name in names)
    whole = Model("polynomial", Quantity("y", "1"), quantities, pieces)
    np.testing.assert_allclose(predict(whole, columns), found, rtol=1e-9, atol=1e-9)
    for name in names:
        trained = columns[name][:60]
        assert pieces.curves[0].limits[name] == pytest.approx((trained.min(), trained.max()))
    assert pieces.segments[0].scaling.slope == pytest.approx(
        [2 / np.ptp(columns[name][:60]) for name in names]
    )


def test_too_few_samples_make_no_polynomial():
    three = dataset_of({"u": np.arange(3.0), "y": np.arange(3.0)})
    made = [simple.polynomial_fit(degree, three, ["u"]) is not None for degree in (2, 3)]
    assert made == [True, False]
    assert simple.polynomial_fit(1, three, []) is None
    fits = [simple._one_step_fit(dataset_of({"y": np.arange(n)}), [], 1) for n in (2.0, 3.0)]
    assert [theta is not None for theta in fits] == [False, True]


def test_an_input_that_never_changes_has_no_influence_on_a_polynomial():
    u = np.arange(9.0)
    fitted = simple.polynomial_fit(1, dataset_of({"u": u, "v": np.full(9, 5.0), "y": 2 * u}), "uv")
    (found,) = fitted.of_curves(dataset_of({"u": u + 1, "v": np.full(9, 5.0), "y": u}))
    np.testing.assert_allclose(found, 2 * (u + 1))


def test_an_arx_of_uneven_samples_counts_samples():
    uneven = curve_of({"time": np.array([0.0, 1.0, 2.0, 2.4]), "y": np.ones(4)})
    states = simple.Arx("y", (), 1, np.zeros(2)).as_memory([uneven], (0.0, 1.0)).model.states
    assert (states.step, states.ordered) == (1.0, True)


def test_a_record_whose_columns_are_kept_in_files_has_the_same_arx(monkeypatch):
    u = np.random.default_rng(3).normal(size=600)
    dataset = dataset_of({"u": u, "y": np.convolve(u, [0, 0.5, 0.2])[:600]})
    monkeypatch.setattr(simple, "MOST_ROWS", 300)
    _, (in_memory,) = simple.arx(dataset, ["u"])
    monkeypatch.setattr(arrays, "LONG", 100)
    _, (in_files,) = simple.arx(dataset, ["u"])
    np.testing.assert_array_equal(in_files, in_memory)


def run_by_hand(theta, order, y, inputs, begun=0):
    """The free run of an ARX from some measured samples on, or at rest before the first one."""
    values = [*y[:begun]]
    for k in range(begun, len(y)):
        past = [values[k - i] if k >= i else y[0] for i in range(1, order + 1)]
        now = [x[max(k - j, 0)] for x in inputs for j in range(order + 1)]
        values.append(theta @ [1.0, *past, *now])
    return np.array(values)


def fitted_by_hand(order, pieces, masks, most):
    """The coefficients of an ARX by least squares, or None if there are too few samples; of what
    trains, every n-th sample counts, and at most `MOST_ROWS` rows.
    """
    rows = []
    for (y, *inputs), trains in zip(pieces, masks, strict=True):
        for k in [k for k in np.flatnonzero(trains) if k >= order][:: max(1, 200 // (4 * most))]:
            past = [y[k - i] for i in range(1, order + 1)]
            rows.append([1.0, *past, *(x[k - j] for x in inputs for j in range(order + 1)), y[k]])
    known = np.array([row for row in rows if np.isfinite(row).all()])
    P = known[np.linspace(0, len(known) - 1, min(len(known), most)).round().astype(int)]
    return np.linalg.lstsq(P[:, :-1], P[:, -1], rcond=None)[0] if len(P) > 3 * order + 2 else None


@pytest.mark.parametrize(("most", "orders"), [(50_000, {1, 2, 4, 8}), (12, {1, 2})])
def test_an_arx_is_the_best_of_its_orders_in_free_run(most, orders, monkeypatch):
    """By sums written out: two inputs, a curve of two recordings, and gaps in what is known."""
    monkeypatch.setattr(simple, "MOST_ROWS", most)
    rng = np.random.default_rng(5)
    pieces = []
    for n in (70, 50, 80):
        u, v = rng.normal(size=(2, n))
        y = np.zeros(n)
        for k in range(4, n):
            y[k] = 2 + 0.2 * y[k - 1] - 0.8 * y[k - 4] + u[k - 1] - 0.2 * v[k] + 0.1 * rng.normal()
        pieces.append(np.array([y, u, v]))
    origin = np.arange(120) % 2 * (np.arange(120) < 100)  # 70 and 50 samples, mixed
    held_out = rng.random(120) < 0.2
    pieces[0][0, np.flatnonzero(held_out[origin == 0])[2:4]] = np.nan
    mixed = np.empty((3, 120))
    mixed[:, origin == 0], mixed[:, origin == 1], last = pieces
    columns = dict(zip("yuv", mixed, strict=True))
    first = Curve("a", None, columns, held_out, ("p", "q"), origin=origin)
    second = curve_of(dict(zip("yuv", last, strict=True)), np.arange(80) > 60, "b")
    masks = [~held_out[origin == 0], ~held_out[origin == 1], np.arange(80) <= 60]
    found = {}
    for order in (1, 2, 4, 8):
        theta = fitted_by_hand(order, pieces, masks, most)
        if theta is not None:
            runs = [run_by_hand(theta, order, y, inputs) for y, *inputs in pieces]
            left = [
                (run - y)[trains] for run, (y, *_), trains in zip(runs, pieces, masks, strict=True)
            ]
            found[order] = (np.sum(np.concatenate(left) ** 2), theta, runs)
    assert found.keys() == orders
    order = min(found, key=lambda order: found[order][0])
    _, theta, runs = found[order]
    y, u, v = (Quantity(name, "1") for name in "yuv")
    dataset = Dataset("y", None, {"y": y, "u": u, "v": v}, (), (first, second))
    fitted, (mixed_run, run) = simple.arx(dataset, ["u", "v"])
    assert fitted.order == order
    np.testing.assert_allclose(fitted.theta, theta, rtol=1e-8, atol=1e-10)
    for each, expected in zip(
        (mixed_run[origin == 0], mixed_run[origin == 1], run), runs, strict=True
    ):
        np.testing.assert_allclose(each, expected, rtol=1e-6)
    timed = curve_of({"time": 0.1 * np.arange(80), **second.columns})
    memory = Model("arx", y, (u, v), fitted.as_memory([timed], (0.0, 5.0)))
    begun = run_by_hand(theta, order, last[0], last[1:], order)
    values = simulate(memory, timed.columns).values
    np.testing.assert_allclose(values[order:], begun[order:], rtol=1e-6)


def test_an_arx_needs_no_input():
    y = 3 + 0.99 ** np.arange(600)
    _, (found,) = simple.arx(dataset_of({"y": y}, held_out=np.arange(600) >= 300), [])
    assert simple.arx(dataset_of({"y": np.zeros(40)}), [])[0].order == 1  # of equal ones
    # what it starts from is forgotten
    np.testing.assert_allclose(found[80:], y[80:], rtol=0, atol=5e-3)


def test_a_run_has_diverged_beyond_a_thousand_times_the_largest_output_of_all_blocks():
    y = np.ones(40_000)
    y[30_000] = -8.192
    doubling = simple.Arx("y", (), 1, np.array([0.0, 2.0]))
    found = simple._run(curve_of({"y": y}), doubling)
    assert found[:13].tolist() == (2.0 ** np.arange(1, 14)).tolist()  # 2^13 is 1000 times 8.192
    assert np.isnan(found[13:]).all()


def test_a_cubic_of_many_quantities_has_an_equation():
    """It has 969 terms of sixteen quantities, more than a text of an expression may have."""
    names = [f"x_{number}" for number in range(16)]
    cubic = simple.Polynomial(names, 3, np.zeros(16), np.ones(16), np.linspace(1, 2, 969))
    output, *inputs = (Quantity(name, "1") for name in ("y", *names))
    assert "x_15" in equations(Model("cubic", output, tuple(inputs), cubic.as_pieces()))[0].text
