"""Terms that several outputs share: candidate by candidate on paper, and what must not change them.

Billings 2013, section 3.4: the error reduction ratios of a candidate are added over the outputs.
"""

import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from textbook import frols_streamed

from mapmore_cli.domain.declared import Contradiction
from mapmore_cli.modelling.frols import Regression, Weighing, frols_together
from mapmore_cli.modelling.frols.moments import blocks_of_rows
from mapmore_cli.modelling.frols.select import CRITERIA
from mapmore_cli.modelling.selection import Fit, Stop


def on_paper(P, Y, terms):
    """The columns of the highest sum of ERR, each step by a projection of its own, and the
    coefficients of every output.
    """
    chosen = []
    for _ in range(terms):
        sums = {}
        for m in set(range(P.shape[1])) - set(chosen):
            known = P[:, chosen]
            q = P[:, m] - known @ np.linalg.lstsq(known, P[:, m], rcond=None)[0]
            sums[m] = sum((y @ q) ** 2 / (q @ q) / (y @ y) for y in Y.T)
        chosen.append(max(sums, key=sums.get))
    return chosen, np.linalg.lstsq(P[:, chosen], Y, rcond=None)[0]


def together(P, Y, *how, weighings=None, **more):
    weighings = weighings or [Weighing()] * Y.shape[1]
    problems = [
        Regression(blocks_of_rows(P, y), weighing)
        for y, weighing in zip(Y.T, weighings, strict=True)
    ]
    return frols_together(problems, *how, **more)


def by_candidate(selections, M):
    """The coefficients of every output by candidate, (M, m)."""
    table = np.zeros((M, len(selections)))
    for j, one in enumerate(selections):
        table[one.chosen, j] = one.theta
    return table


@pytest.fixture(params=[(60, 8, 2), (9_000, 12, 3)], ids=["small", "tall"])
def data(request):
    """Candidates that go together, and outputs of some of them, in units far apart."""
    n, M, m = request.param
    rng = np.random.default_rng(n)
    P = rng.normal(size=(n, M)) @ (np.eye(M) + 0.3 * rng.normal(size=(M, M)))
    Y = P[:, ::2] @ rng.normal(size=(P[:, ::2].shape[1], m)) + 0.2 * rng.normal(size=(n, m))
    return P, Y * 10.0 ** np.arange(-3, 3 * m - 3, 3)


def test_terms_and_coefficients_are_those_on_paper(data):
    P, Y = data
    chosen, theta = on_paper(P, Y, 4)
    found = together(P, Y, 4)
    expected = np.zeros((P.shape[1], Y.shape[1]))
    expected[chosen] = theta
    np.testing.assert_allclose(by_candidate(found, P.shape[1]), expected, rtol=1e-9)
    assert {one.stop for one in found} == {"max_terms"}


@pytest.mark.parametrize("stop", [rule for rule in CRITERIA if rule != "tolerance"])
@given(st.integers(0, 10_000))
def test_an_output_and_its_double_have_as_many_terms_as_it_has_alone(stop, seed):
    """The second of two terms is as good as what it costs."""
    rng = np.random.default_rng(seed)
    P = rng.normal(size=(40, 2))
    y = P @ [1.0, rng.uniform(0, 0.5)] + rng.normal(size=40)
    found, _ = together(P, np.outer(y, [1, 2]), 2, 1e-3, stop=stop)
    alone = frols_streamed(blocks_of_rows(P, y), 2, 1e-3, stop=stop)
    assert found.chosen.tolist() == alone.chosen.tolist()


def test_a_spec_offers_rules_that_there_are():
    assert {*get_args(Stop)} <= {*CRITERIA, "free_run"}


@pytest.mark.parametrize("key", ["margin", "max_terms", "tolerance", "slack"])
def test_defaults_are_those_on_the_page_of_keys(key):
    page = (Path(__file__).parents[3] / "docs" / "spec.md").read_text(encoding="utf-8")
    given = re.findall(rf"^\| `{key}` \|[^|]*\| `(.*?)` \|", page, re.MULTILINE)
    assert [float(text) for text in given] == [getattr(Fit(), key)]


def test_a_ridge_prunes_three_times_as_many_terms_as_it_keeps_unless_a_number_is_given():
    terms = [Fit(max_terms=4, ridge=1e-9, forward=one).forward_terms for one in (None, 30, 2)]
    assert terms == [12, 30, 4]
    assert (Fit().known_scale, Fit(loss="huber", scale=2.0).known_scale) == (
        None,
        2.0,
    )
    for useless in ({"ridge": 0.9e-9}, {"scale": 2.0}, {"slack": 0.1}, {"beyond": 0.1}):
        with pytest.raises(Contradiction):
            Fit(**useless)


def test_the_unit_of_an_output_changes_its_own_coefficients_alone(data):
    P, Y = data
    unit = 1000.0 ** np.arange(Y.shape[1])
    before, after = (by_candidate(together(P, own, 3), P.shape[1]) for own in (Y, Y * unit))
    np.testing.assert_allclose(after, before * unit, rtol=1e-9)


def test_the_tolerance_waits_for_the_last_output():
    rng = np.random.default_rng(2)
    P = np.column_stack([np.ones(200), rng.normal(size=(200, 4))])
    easy, hard = 300 + P[:, 1], P[:, 1:] @ [1.0, 0.9, 0.8, 0.7]
    first, second = together(P, np.column_stack([easy, hard]), None, 1e-6)
    assert {*second.chosen} >= {1, 2, 3, 4}
    assert second.sse < 1e-6 * second.yy
    assert first.stop == second.stop == "tolerance"
    Y, spread = np.column_stack([easy, hard]), np.sum((hard - hard.mean()) ** 2)
    left = together(P, Y, 2)[1].sse / spread
    for tolerance, count in ((1.01 * left, 2), (0.99 * left, 3)):
        assert len(together(P, Y, None, tolerance)[1].chosen) == count


@pytest.mark.parametrize("loss", ["squares", "huber"])
def test_every_output_has_weights_of_its_own(loss):
    rng = np.random.default_rng(3)
    P, sigma = rng.normal(size=(400, 6)), np.where(np.arange(400) % 4, 1.0, 30.0)
    Y = P[:, :2] @ [[1.0, 2.0], [-3.0, 1.0]] + 0.01 * rng.normal(size=(400, 2))
    Y[:, 1] += sigma * rng.normal(size=400) if loss == "squares" else 500.0 * (sigma > 1)
    known = Weighing(loss=loss), Weighing(sigma if loss == "squares" else None, loss)
    found = together(P, Y, 2, weighings=known)
    assert [sorted(one.chosen) for one in found] == [[0, 1], [0, 1]]
    table = by_candidate(found, 6)
    np.testing.assert_allclose(table[:2, 0], [1, -3], atol=5e-3)
    within = 4 * found[1].theta_error
    assert (np.abs(found[1].theta - np.array([2.0, 1.0])[found[1].chosen]) < within).all()
