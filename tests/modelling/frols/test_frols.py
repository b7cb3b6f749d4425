"""FROLS against a textbook implementation written independently, and against every case in which
known packages fail.
"""

import numpy as np
import pytest
from textbook import textbook

from mapmore_cli.modelling.frols import frols
from mapmore_cli.modelling.frols.moments import blocks_of_rows
from mapmore_cli.modelling.frols.select import fewest_terms, press


@pytest.mark.parametrize("seed", range(200))
def test_agrees_with_the_textbook(seed):
    rng = np.random.default_rng(seed)
    n, M = int(rng.integers(12, 200)), int(rng.integers(2, 12))
    P = rng.normal(size=(n, M)) * 10.0 ** rng.uniform(-3, 3, M) + rng.normal(size=M)
    y = P @ (rng.normal(size=M) * (rng.random(M) < 0.5)) + rng.normal(size=n) * 10.0 ** rng.uniform(
        -3, 1
    )
    k = int(rng.integers(1, M + 1))
    chosen, g, err, theta, tables = textbook(P, y, k)
    ours = frols(P, y, k)
    assert ours.chosen.tolist() == chosen
    np.testing.assert_allclose(ours.err, err, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(ours.g, g, rtol=1e-7)
    np.testing.assert_allclose(ours.theta, theta, rtol=1e-7)
    np.testing.assert_allclose(ours.err_all, tables, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(ours.a @ ours.theta, ours.g, rtol=1e-9)
    assert ours.condition == pytest.approx(np.linalg.cond(P[:, chosen]), rel=1e-6)
    steps = np.arange(k)
    np.testing.assert_allclose(ours.g_all[steps, chosen], g, rtol=1e-7)
    second = np.argsort(np.nan_to_num(tables, nan=-1))[:, -2]
    there = np.isfinite(tables[steps, second])
    assert ours.runner_up.tolist() == np.where(there, second, -1).tolist()


def test_a_selection_is_shown_as_a_sum_and_predicts_with_its_terms():
    x = np.array([-1.0, 0.0, 1.0, 2.0])
    found = frols(np.column_stack([x**2, np.ones(4), x]), 2 - 3 * x, 2)
    assert "*p1" in repr(found)
    assert " - 3*p2" in repr(found) or "-3*p2" in repr(found)
    other = np.array([[7.0, 1.0, 5.0]])
    assert found.predict(other) == pytest.approx([2 - 3 * 5])


# --- cases in which known packages fail
# -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "dependent",
    [
        pytest.param(lambda P: P[:, 0], id="duplicate"),
        pytest.param(lambda P: np.zeros(len(P)), id="zero"),
        pytest.param(lambda P: -3 * P[:, 1], id="multiple"),
        pytest.param(lambda P: 2 * P[:, 0] - 5 * P[:, 2] + P[:, 1], id="combination"),
    ],
)
def test_dependent_columns_are_skipped_and_never_divided_by(dependent):
    rng = np.random.default_rng(11)
    P = rng.normal(size=(40, 4))
    wide = np.column_stack([P, dependent(P)])
    y = P @ [1, -2, 3, 0.1] + 0.01 * rng.normal(size=40)
    ours = frols(wide, y)
    assert len(ours.chosen) == 4
    assert ours.stop == "rank"
    assert ours.err.sum() <= 1 + 1e-12
    assert np.isfinite(ours.theta).all()
    np.testing.assert_allclose(
        wide[:, ours.chosen] @ ours.theta, P @ np.linalg.lstsq(P, y, rcond=None)[0], atol=1e-10
    )


def test_a_tie_goes_to_the_lower_index_even_when_rounding_favours_the_other():
    x = np.linspace(0.3, 5, 31)
    P = np.column_stack([np.ones_like(x), x * (1 + 1e-13), x])
    ours = frols(P, 3 * x, max_terms=1)
    assert ours.chosen.tolist() == [1]
    assert ours.tied.tolist() == [1]
    assert ours.runner_up.tolist() == [2]


@pytest.mark.parametrize(
    ("own", "left", "terms"),
    [(2e-12, 1.0, 2), (0.7e-12, 1.0, 1), (1.0, 2.2e-14, 2), (1.0, 0.7e-14, 1)],
)
def test_rounding_errors_are_no_second_term(own, left, terms):
    """A column of which 1e-12 is independent of the first, or a residual of 1e-14 of the output."""
    P = np.array([[1.0, 1.0], [0.0, own], [0.0, 0.0]])
    assert len(frols(P, np.array([1.0, left, 0.0])).chosen) == terms


@pytest.mark.parametrize(("unexplained", "terms"), [((3e-30, 1.5e-30), 3), ((1e-30, 1e-32), 2)])
def test_a_criterion_prefers_no_term_that_explains_rounding_errors_only(unexplained, terms):
    assert fewest_terms("bic", np.array([1.0, *unexplained]), 1000, 9) == terms


@pytest.mark.parametrize(("samples", "terms"), [(4, 2), (5, 3)])
def test_aicc_needs_a_degree_of_freedom(samples, terms):
    assert fewest_terms("aicc", np.array([1.0, 1e-3, 1e-20]), samples, 9) == terms


@pytest.mark.parametrize(("rest", "known"), [(5e-8, True), (5e-9, False)])
def test_a_sample_with_full_leverage_has_no_leave_one_out_error(rest, known):
    """`1 - h` of the first of two samples is `rest`."""
    unit = np.sqrt([1 - rest, rest])
    found = press(blocks_of_rows(unit[:, None], np.ones(2)), [0], np.eye(1), np.ones(1))
    residual = 1 - unit
    expected = np.sum((residual / (1 - unit**2)) ** 2) if known else np.inf
    assert found == pytest.approx(expected, rel=1e-6)


def test_nothing_to_explain():
    ours = frols(np.ones((5, 2)), np.zeros(5), max_terms=2)
    assert len(ours.chosen) == 0
    assert ours.stop == "no_gain"
    assert ours.err_all.shape == (0, 2)
    assert ours.condition == 1


@pytest.mark.parametrize("seed", range(12))
def test_a_criterion_keeps_the_number_of_terms_for_which_it_is_least(seed):
    """PRESS is the error of models that are fitted without the sample."""
    rng, k = np.random.default_rng(seed), np.arange(1, 6)
    P = rng.normal(size=(25, 5))
    P[0] *= 100.0  # nearly all of its leverage, but less than one
    y = P @ [3, 0.4, -1, 0, 0.3] + rng.normal(size=25)
    order, press, sse = frols(P, y).chosen, [], []
    for chosen in (order[:one] for one in k):
        left_out = []
        for i in range(25):
            rest = np.arange(25) != i
            theta = np.linalg.lstsq(P[rest][:, chosen], y[rest], rcond=None)[0]
            left_out.append(y[i] - P[i, chosen] @ theta)
        press.append(np.sum(np.square(left_out)))
        sse += np.linalg.lstsq(P[:, chosen], y, rcond=None)[1].tolist()
    likelihood = 25 * np.log(sse)
    criteria = {
        "press": press,
        "bic": likelihood + k * np.log(25),
        "ebic": likelihood + k * np.log(25) + 2 * k * np.log(5),
        "aicc": likelihood + 2 * k + 2 * k * (k + 1) / (24 - k),
    }
    for stop, values in criteria.items():
        best = int(np.argmin(values)) + 1
        found = frols(P, y, 5, 0.5, stop=stop)  # the tolerance ends nothing
        assert (found.chosen.tolist(), found.stop) == (
            order[:best].tolist(),
            stop if best < 5 else "max_terms",
        )


@pytest.mark.parametrize(
    ("P", "y"),
    [(np.ones(5), np.ones(5)), (np.ones((5, 2)), np.ones(4)), (np.empty((0, 2)), np.empty(0))],
)
def test_shapes_that_do_not_fit(P, y):
    with pytest.raises(ValueError, match="must have the shape"):
        frols(P, y)
    with pytest.raises(ValueError, match="max_terms"):
        frols(np.ones((4, 2)), np.ones(4), max_terms=0)


def test_a_selection_says_its_terms():
    """With names: the example of `frols`."""
    P = np.vander(np.linspace(0, 1, 50), 3)
    found = frols(P, 3 * P[:, 0] - 1, max_terms=2)
    assert [row["term"] for row in found.table()] == list(found.names) == ["p0", "p2"]
    assert sum(row["err"] for row in found.table()) == pytest.approx(1)
    assert repr(frols(P, np.zeros(50))) == "Selection(0; ERR none; stop: no_gain)"
    with pytest.raises(ValueError, match="3 candidates need 3 names or none, not 2"):
        frols(P, P[:, 0], names=("a", "b"))
