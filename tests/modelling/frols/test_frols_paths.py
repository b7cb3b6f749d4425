"""Whichever form of the method reads the dictionary, in memory or block by block, the selection is
the same.
"""

from contextlib import nullcontext

import numpy as np
import pytest
from common import peak_memory
from hypothesis import assume, given
from hypothesis import strategies as st
from textbook import frols_streamed

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.frols import engine, frols, reads_once, remainders
from mapmore_cli.modelling.frols.moments import (
    blocks_of_rows,
    divided,
    power_of_two,
    safe_scale,
)
from mapmore_cli.modelling.frols.select import widened

FORMS = ("basis", "gram", "gathered", "triangle", "streamed")


class Record:
    """Blocks of given lengths, and how often they were read."""

    def __init__(self, P, y, lengths):
        self.blocks = list(
            zip(np.split(P, np.cumsum(lengths)), np.split(y, np.cumsum(lengths)), strict=True)
        )
        self.passes = 0

    def __call__(self):
        self.passes += 1
        return iter(self.blocks)


def fit_by(form, P, y, *args, **options):
    """`frols` made to use one form: the basis on P, the Gram matrix as far as it goes, or what
    follows when that has no digits at all.
    """
    if form == "streamed":
        return frols_streamed(
            Record(P, y, np.random.default_rng(len(y)).integers(0, len(y), 3)), *args, **options
        )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "reads_once", lambda *_: form != "basis")
        for module in (engine, remainders):
            patch.setattr(module, "SMALL", 2**16 if form == "gathered" else 0)
        if form in ("gathered", "triangle"):
            patch.setattr(remainders, "PIVOT_TOLERANCE", 2.0)
        return frols(P, y, *args, **options)


def dictionaries(rng, kind, n, M):
    P = rng.normal(size=(n, M))
    if kind == "offset":
        P += 10.0 ** rng.uniform(0, 4)
    elif kind == "powers":
        x = rng.uniform(0, 1, n)
        P = np.column_stack([x**i for i in range(M)])
    elif kind == "integers":
        P = rng.integers(-1, 2, size=(n, M)).astype(float)
    elif kind == "dependent":
        P[:, rng.integers(M)] = P[:, rng.integers(M)] * 4
        P[:, rng.integers(M)] = 0
    elif kind == "units":
        P = P @ rng.normal(size=(M, M)) * 10.0 ** rng.uniform(-120, 120, M)
    return P


@given(
    seed=st.integers(0, 2**32 - 1),
    kind=st.sampled_from(["plain", "offset", "powers", "integers", "dependent", "units"]),
    n=st.integers(2, 60),
    M=st.integers(1, 11),
    noise=st.sampled_from([0.0, 1e-12, 1e-6, 1e-3, 1.0]),
    tolerance=st.sampled_from([0.0, 1e-10, 1e-3]),
    stop=st.sampled_from(["tolerance", "bic", "aicc", "press"]),
)
def test_every_form_makes_the_same_selection(seed, kind, n, M, noise, tolerance, stop):
    # else criteria compare residuals that are rounding error
    assume(stop == "tolerance" or (noise >= 1e-6 and n > M + 2))
    rng = np.random.default_rng(seed)
    P = dictionaries(rng, kind, n, M)
    largest = np.abs(P).max(axis=0)
    y = (P / np.where(largest > 0, largest, 1)) @ (
        rng.normal(size=M) * (rng.random(M) < 0.5)
    ) + noise * rng.normal(size=n)
    k = int(rng.integers(1, M + 1))
    reference = fit_by("basis", P, y, k, tolerance, stop=stop)
    for form in FORMS[1:]:
        ours = fit_by(form, P, y, k, tolerance, stop=stop)
        assert ours.stop == reference.stop, form
        for name in ("chosen", "tied", "runner_up"):
            assert getattr(ours, name).tolist() == getattr(reference, name).tolist(), (form, name)
        assert (np.isnan(ours.err_all) == np.isnan(reference.err_all)).all()
        np.testing.assert_allclose(ours.err, reference.err, rtol=1e-6, atol=1e-20)
        assert (ours.samples, ours.yy) == (n, pytest.approx(reference.yy))
        np.testing.assert_allclose(ours.err_all, reference.err_all, rtol=1e-6, atol=1e-12)
        assert ours.sse == pytest.approx(reference.sse, rel=1e-4, abs=1e-22 * reference.yy)
        assert ours.err.sum() <= 1 + 1e-12


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("factor", [1.0, -3.0, 1e-7])
def test_ties_go_to_the_lower_index_after_several_steps(form, factor):
    """The tied columns come last, when rounding errors of the earlier steps could decide between
    them.
    """
    rng = np.random.default_rng(12)
    P = rng.normal(size=(500, 12)) + 2
    P[:, 9] = factor * P[:, 4]
    y = P @ np.array([5, -4, 3, 0, 0, 0, 0, -2, 0, 1e-4 / factor, 0, 6]) + 1e-5 * rng.normal(
        size=500
    )
    ours = fit_by(form, P, y, 6)
    assert ours.chosen[-1] == 4
    assert ours.tied[-1] == 1
    assert ours.runner_up[-1] == 9


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("scale", [1e-300, 1e-160, 1e140, 1e300])
def test_units_at_the_end_of_the_range_of_doubles(form, scale):
    rng = np.random.default_rng(8)
    P = rng.normal(size=(60, 5))
    y = P @ [1, 2, 0, 0, 3] + 0.1 * rng.normal(size=60)
    units = np.where(np.arange(5) == 1, scale, 1.0)
    plain, extreme = fit_by(form, P, y, 3), fit_by(form, P * units, y, 3)
    assert plain.chosen.tolist() == extreme.chosen.tolist()
    np.testing.assert_allclose(extreme.err, plain.err, rtol=1e-9)
    np.testing.assert_allclose(extreme.theta * units[extreme.chosen], plain.theta, rtol=1e-9)
    small_y = fit_by(form, P, y * 1e-200, 3)
    np.testing.assert_allclose(small_y.theta * 1e200, plain.theta, rtol=1e-9)


def test_columns_are_scaled_only_if_their_squares_cannot_be_multiplied():
    squares = np.array([0.9e-140, 1.1e-140, 1.0, 0.9e140, 1.1e140])
    row = np.sqrt(squares)[None]
    scale = safe_scale(squares, blocks_of_rows(row[:, :-1], row[:, -1]))
    assert (scale == 1).tolist() == [False, True, True, True, False]
    assert power_of_two(np.array([0.0, 0.3, 1.0, 1.5, 2.0])).tolist() == [1, 0.5, 2, 2, 4]
    blocks = blocks_of_rows(row[:, :-1], row[:, -1])
    assert divided(blocks, np.ones(5)) is blocks


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_found_in_any_block(form, bad):
    P = np.ones((9_000, 3))
    P[8_765, 1] = bad
    with pytest.raises(DataError, match="candidate 1 is not finite at row 8765"):
        fit_by(form, P, np.ones(9_000))
    y = np.ones(9_000)
    y[7_000] = bad
    with pytest.raises(DataError, match="y is not finite at row 7000"):
        fit_by(form, np.ones((9_000, 3)), y)


@pytest.mark.parametrize("layout", ["C", "F", "strided"])
def test_memory_order_changes_nothing_and_nothing_is_written_to(layout):
    rng = np.random.default_rng(2)
    P = rng.normal(size=(20_000, 6))
    y = P @ [1, 0, 2, 0, 0, 3] + 0.1 * rng.normal(size=20_000)
    given_P = {"C": P, "F": np.asfortranarray(P), "strided": np.repeat(P, 2, axis=0)[::2]}[layout]
    given_P.flags.writeable = y.flags.writeable = False
    ours, reference = frols(given_P, y, 4), frols(P.copy(), y.copy(), 4)
    assert ours.chosen.tolist() == reference.chosen.tolist()
    np.testing.assert_allclose(ours.theta, reference.theta, rtol=1e-12)


def test_a_wide_dictionary_is_not_copied():
    P = np.random.default_rng(1).normal(size=(300, 3000))
    assert peak_memory(lambda: frols(P, P[:, 5] + P[:, 9], 2)) < 0.5 * P.nbytes


@pytest.mark.parametrize("kind", ["ordinary", "dependent", "nothing left to explain", "overflow"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_a_tall_dictionary_is_never_copied(kind, order):
    rng = np.random.default_rng(1)
    P = np.asarray(rng.normal(size=(400_000, 10)), order=order)
    y = P @ rng.normal(size=10) + rng.normal(size=len(P))
    if kind == "dependent":
        P[:, 3] = P[:, 5]
    elif kind == "nothing left to explain":
        y[:] = P[:, 0]
    elif kind == "overflow":
        P *= 1e200
    assert peak_memory(lambda: frols(P, y, 5)) < 0.1 * P.nbytes


def powers(n):
    rng = np.random.default_rng(n + 4)
    x = rng.uniform(0, 1, n)
    return np.column_stack([x**i for i in range(4)]), np.sin(5 * x) + 2 + 0.1 * rng.normal(size=n)


@pytest.mark.parametrize(
    ("kind", "stop", "passes"),
    [
        ("ordinary", "tolerance", 1),
        ("ordinary", "bic", 1),
        ("dependent", "tolerance", 2),
        ("noise-free", "tolerance", 2),
        ("squares vanish", "tolerance", 3),
    ],
)
def test_the_record_is_read_as_seldom_as_possible(kind, stop, passes):
    P, y = powers(10_000)
    if kind == "dependent":
        P[:, 3] = 2 * P[:, 0]
    elif kind == "noise-free":
        y = 3 * P[:, 1]
    elif kind == "squares vanish":
        P *= 1e-170
    record = Record(P, y, [3_000, 3_000])
    frols_streamed(record, 3, stop=stop)
    assert record.passes == passes


@pytest.mark.parametrize(
    ("own", "noise", "passes"),
    [(5e-6, 0.1, 1), (5e-7, 0.1, 2), (1.0, 5e-9, 1), (1.0, 5e-10, 2)],
)
def test_the_record_is_read_again_only_if_subtraction_loses_too_many_digits(own, noise, passes):
    """The second candidate has the fraction `own` of its square for itself, and the fraction
    `noise` of the square of the output is left after both.
    """
    basis = np.linalg.qr(np.random.default_rng(0).normal(size=(9_000, 3)))[0]
    a, b, rest = basis.T
    P = np.column_stack([a, np.sqrt(1 - own) * a + np.sqrt(own) * b])
    record = Record(P, a + 0.5 * b + np.sqrt(1.25 * noise) * rest, [3_000, 3_000])
    assert len(frols_streamed(record, 2).chosen) == 2
    assert record.passes == passes


@pytest.mark.parametrize(
    ("digits", "others", "clear"),
    [
        (0.5e-9, [1.0], True),  # so few errors that candidates within them are tied
        (2e-9, [1.0], False),
        (2e-9, [1 - 1e-9], False),
        (2e-9, [1 - 4e-9, 0.5], True),
        (0.5e-6, [0.9], True),
        (2e-6, [0.9], False),  # the ERR itself would have too few digits
    ],
)
def test_the_highest_err_counts_only_if_rounding_cannot_have_made_it(digits, others, clear):
    """`digits` is the relative rounding error of the best product of candidate and residual."""
    held = remainders.GramRemainders(np.ones(2 * (3 + len(others),)), None)
    held.sse_of_products = (digits / remainders.ROUNDING) ** 2
    assert held._clear_winner(np.array([np.nan, 1.0, *others])) == clear


@pytest.mark.parametrize(("missing", "noticed"), [(0.5e-12, 0), (2e-12, 1), (-2e-12, 1)])
def test_squares_that_do_not_add_up_show_that_digits_are_lost(missing, noticed):
    """A Gram matrix whose `y'y` differs from that of the rows."""
    P, y = np.array([[1.0], [0.0]]), np.ones(2)
    gram = np.array([[1.0, 1.0], [1.0, 2.0 * (1 + missing)]])
    held = remainders.GramRemainders(gram, blocks_of_rows(P, y))
    held.choose(0)
    with pytest.raises(remainders.DigitsLost) if noticed else nullcontext():
        held._renew()


@pytest.mark.parametrize(("small", "limit"), [(9, 1e-2), (8, 1e-6)])
@pytest.mark.parametrize("factor", [0.5, 5])
def test_a_remainder_is_computed_from_the_columns_if_subtraction_loses_its_digits(
    small, limit, factor, monkeypatch
):
    """`q'q` is `factor * limit` of `p'p`, with another limit if there are more than `small`
    values; the residual of the output has a square of `factor` per cent.
    """
    monkeypatch.setattr(remainders, "SMALL", small)
    own, left = np.sqrt(factor * limit), np.sqrt(factor * 1e-2)
    most, lost = np.sqrt(1 - own**2), factor < 1
    P = np.array([[1, most, most], [0, own, 0], [0, 0, own]])
    held = remainders.BasisRemainders(P, np.array([np.sqrt(1 - left**2), left, 0]), 3)
    held.choose(0)
    assert held.explicit.tolist() == ([1, 2] if lost else [])
    assert held.sse_of_products == (held.sse if lost else held.yy)
    held.choose(1)
    assert held.explicit.tolist() == ([2] if lost else [])


@pytest.mark.parametrize(("small", "rows"), [(12, 4), (11, 3)])
def test_a_dictionary_that_is_not_small_is_replaced_by_its_triangular_factor(
    small, rows, monkeypatch
):
    monkeypatch.setattr(engine, "SMALL", small)
    P = np.arange(8.0).reshape(4, 2) ** 2
    found, y = engine._fewer_rows(blocks_of_rows(P, P[:, 0] ** 2), 4, 3)
    assert (len(found), len(y)) == (rows, rows)
    np.testing.assert_allclose(found.T @ found, P.T @ P)


@pytest.mark.parametrize(
    ("n", "M", "terms", "once"),
    [
        *((4096, 16, 3, False), (4097, 16, 3, True)),  # at most 2^16 values are a small dictionary
        *((257, 257, 20, False), (258, 257, 20, True)),  # wide, and tall
        *((9000, 80, 3, True), (9000, 81, 3, False), (9000, 81, 4, True)),  # 16 columns for a term
    ],
)
def test_a_tall_dictionary_is_read_once(n, M, terms, once):
    assert reads_once(n, M, terms) == once


@pytest.mark.parametrize(
    "blocks", [[], [(np.empty((0, 3)), np.empty(0))], [(np.empty((4, 0)), np.ones(4))]]
)
def test_blocks_without_a_row_or_a_column_are_refused(blocks):
    with pytest.raises(ValueError, match="must have the shape"):
        frols_streamed(lambda: blocks, 2)


def test_unknown_rules_are_refused_before_anything_is_read():
    def unread():
        raise AssertionError("was read")

    with pytest.raises(ValueError, match="unknown stop rule 'aic'"):
        frols_streamed(unread, 2, stop="aic")
    with pytest.raises(ValueError, match="max_terms"):
        frols_streamed(unread, 0)


@pytest.mark.parametrize("form", FORMS)
def test_a_sample_that_alone_decides_a_term_has_no_leave_one_out_error(form):
    """Column 1 is nonzero in one sample only: PRESS is infinite once it is chosen."""
    rng = np.random.default_rng(3)
    P = np.column_stack([np.ones(30), np.arange(30) == 7, rng.normal(size=(30, 2))]).astype(float)
    y = P @ [1, 50, 0.1, 0] + 0.1 * rng.normal(size=30)
    assert fit_by(form, P, y, 4).chosen[0] == 1
    assert len(fit_by(form, P, y, 4, stop="press").chosen) == 1
    y -= 45 * P[:, 1]
    assert fit_by(form, P, y, 4).chosen.tolist()[:2] == [0, 1]
    assert fit_by(form, P, y, 4, stop="press").chosen.tolist() == [0]


def test_a_selection_among_some_candidates_counts_all_of_them():
    """Also the first of them as a runner-up; the tables say nothing of the others."""
    P = np.random.default_rng(4).normal(size=(40, 2))
    found = frols(P, P @ [0.5, 3.0], max_terms=2)
    assert found.chosen.tolist() == [1, 0]
    among = np.array([1, 3])
    wide = widened(found, among, 5)
    assert wide.chosen.tolist() == among[found.chosen].tolist()
    assert found.runner_up.tolist() == [1 - found.chosen[0], -1]
    assert wide.runner_up.tolist() == [among[1 - found.chosen[0]], -1]
    np.testing.assert_array_equal(wide.err_all[:, among], found.err_all)
    assert np.isnan(wide.err_all[:, [0, 2, 4]]).all()
