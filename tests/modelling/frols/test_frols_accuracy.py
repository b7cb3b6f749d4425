"""Ill-conditioned dictionaries against arithmetic of 120 digits: a right order is no proof of
accuracy, so ERR is compared as well.

`x^0..x^9` has the condition number 6e8 on [0.5, 1.5], 4e12 on [2, 4] and 2e23 on [10, 11]. On the
first two, double precision can do it all (the last ERR, of a column of which one part in 3e8 is
left, to 1e-5). On [10, 11] it can give the order of eight terms, and six of them with an ERR to
1e-6; of the last two columns less than 1e-12 is left, which is rounding error: they must be called
dependent. From 0 on, the first sample of every chosen column but one is zero, where one package
reports a total ERR of 1.77.
"""

import mpmath
import numpy as np
import pytest
from textbook import frols_streamed

from mapmore_cli.modelling.frols import engine, frols, reads_once, remainders
from mapmore_cli.modelling.frols.moments import blocks_of_rows


def exact_frols(P, y, k):
    """Indices in the order of selection and their ERR, of exactly the doubles in `P` and `y`.

    Elimination on the exact Gram matrix: with this many digits its squared condition number does no
    harm.
    """
    with mpmath.workdps(120):
        columns = [[mpmath.mpf(float(v)) for v in column] for column in (*P.T, y)]
        G = [[mpmath.fdot(a, b) for b in columns] for a in columns]
        M, yy = P.shape[1], G[-1][-1]
        chosen, errs = [], []
        for _ in range(k):
            err = {m: G[m][-1] ** 2 / G[m][m] / yy for m in range(M) if m not in chosen}
            pick = max(err, key=err.get)
            chosen.append(pick)
            errs.append(float(err[pick]))
            row = list(G[pick])
            for line in G:
                factor = line[pick] / row[pick]
                for j in range(M + 1):
                    line[j] -= factor * row[j]
    return chosen, errs


TARGETS = {
    "sine": lambda x: np.sin(5 * x) + 2,
    "decay": lambda x: np.exp(-x),
    "kink": lambda x: np.abs(x - x.mean()),
    "noisy": lambda x: np.sin(3 * x) + 0.05 * np.random.default_rng(3).standard_normal(len(x)),
}


def powers(low, high, n=60):
    x = np.linspace(low, high, n)
    return x, np.column_stack([x**i for i in range(10)])


def in_memory(P, y):
    return frols(P, y, 10)


def streamed(P, y):
    return frols_streamed(blocks_of_rows(P, y), 10)


@pytest.fixture(params=["in memory", "streamed", "streamed and large"])
def fit(request, monkeypatch):
    """The three ways to explicit remainders: of the dictionary, of the blocks put together, of the
    triangular factor.
    """
    if request.param == "streamed and large":
        for module in (engine, remainders):
            monkeypatch.setattr(module, "SMALL", 0)
    return in_memory if request.param == "in memory" else streamed


def keeps_digits(P, y, fit):
    chosen, err = exact_frols(P, y, 10)
    ours = fit(P, y)
    assert ours.chosen.tolist() == chosen
    np.testing.assert_allclose(ours.err[:9], err[:9], rtol=1e-6, atol=1e-24)
    np.testing.assert_allclose(ours.err[9], err[9], rtol=1e-4)
    assert ours.err.sum() <= 1 + 1e-12


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("low", "high"), [(0, 1), (0.5, 1.5), (2, 4)])
def test_powers_keep_their_digits(low, high, target, fit):
    x, P = powers(low, high)
    keeps_digits(P, TARGETS[target](x), fit)


@pytest.mark.parametrize("target", TARGETS)
def test_powers_far_from_zero_keep_what_digits_there_are(target, fit):
    x, P = powers(10, 11)
    y = TARGETS[target](x)
    chosen, err = exact_frols(P, y, 8)
    ours = fit(P, y)
    assert ours.chosen[:8].tolist() == chosen
    np.testing.assert_allclose(ours.err[:6], err[:6], rtol=1e-6)
    np.testing.assert_allclose(ours.err[:8], err, rtol=1e-2)
    assert ours.stop == "rank"
    assert ours.err.sum() <= 1 + 1e-12


@pytest.mark.parametrize(("low", "high"), [(0.5, 1.5), (2, 4)])
def test_long_records_of_powers_keep_their_digits(low, high):
    """So long that the normal equations are formed first, and given up for the triangular
    factor.
    """
    x, P = powers(low, high, n=7_000)
    assert reads_once(*P.shape, 10)
    keeps_digits(P, TARGETS["noisy"](x), in_memory)


@pytest.mark.parametrize("n", [60, 20_000])
@pytest.mark.parametrize("share", [1e-4, 1e-6, 1e-8])
def test_nearly_dependent_columns_keep_their_digits(n, share):
    """A near duplicate and a near sum, with an output that needs what little they have of their
    own.
    """
    rng = np.random.default_rng(7)
    a, b, c, d = rng.normal(size=(4, n))
    P = np.column_stack([a, a + share * b, 1e3 * (a + c + share * d), 1e-3 * c])
    y = a + 2 * c + 0.5 * b - d + 0.01 * rng.normal(size=n)
    chosen, err = exact_frols(P, y, 4)
    ours = frols(P, y, 4)
    assert ours.chosen.tolist() == chosen
    np.testing.assert_allclose(ours.err, err, rtol=1e-6)


def test_the_residual_keeps_its_digits_in_a_near_perfect_fit():
    """SSE is 1e-14 of y'y here: nothing but rounding error would be left of it in `y'y - sum g^2
    q'q`.
    """
    rng = np.random.default_rng(5)
    n = 20_000
    P = rng.normal(size=(n, 6)) + 3
    noise = 1e-7 * rng.normal(size=n)
    y = P @ [1, -2, 0, 0.5, 0, 1] + noise
    ours = frols(P, y, 5)
    assert P.size > engine.SMALL
    theta, *_ = np.linalg.lstsq(P[:, ours.chosen], noise, rcond=None)
    truth = noise - P[:, ours.chosen] @ theta
    assert ours.sse == pytest.approx(truth @ truth, rel=1e-6)
