"""The families of terms: products, names of states, and how much memory a dictionary needs."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions import families, to_text
from mapmore_cli.modelling.expressions.families import (
    count_products,
    fits_whole,
    lags,
    operated,
    products,
    products_bytes,
    usable_memory,
)
from mapmore_cli.modelling.expressions.operators.lags import spread_times
from mapmore_cli.modelling.expressions.operators.play import spread_widths
from mapmore_cli.modelling.expressions.states import state


def test_monomials_are_written_as_a_person_would():
    found = [to_text(term) for term in products(["strain", "pressure"], 3)]
    assert found[:6] == ["1", "strain", "pressure", "strain^2", "pressure*strain", "pressure^2"]
    assert found[6:] == ["strain^3", "pressure*strain^2", "pressure^2*strain", "pressure^3"]
    assert set(products(["strain", "pressure"], 3)) == set(products(["pressure", "strain"], 3))


def test_names_are_written_as_a_person_would():
    assert lags(["force", "pressure"], [0, 1, 2]) == (
        "force",
        "pressure",
        "force[k-1]",
        "pressure[k-1]",
        "force[k-2]",
        "pressure[k-2]",
    )
    assert operated("play", ["p"], [(0.16,), (0.4,)]) == ("play(p, 0.16)", "play(p, 0.4)")
    assert operated("slow", ["play(p, 0.16)"], [(0.3,)]) == ("slow(play(p, 0.16), 0.3)",)
    assert operated("wen_stiffening", ["p"], [(-4.0, 8.0)]) == ("wen_stiffening(p, -4, 8)",)
    assert operated("resonance", ["p"]) == ("resonance(p)", "resonance_velocity(p)")


@pytest.mark.parametrize(
    ("operator", "numbers"),
    [
        *(("play", [(0.0,)]), ("play", [(1.0,)]), ("resonance", [(4.0,)])),
        *(("resonance", [(4.0, 1.0)]), ("wen", [(-64.0, 80.0)]), ("dahl", [(-1.0,)])),
    ],
)
def test_impossible_operators_are_refused(operator, numbers):
    with pytest.raises(ValueError, match=r"number|between"):
        operated(operator, ["p"], numbers)


@pytest.mark.parametrize(("operator", "numbers"), [("wen", (-63.0, 0.0)), ("dahl", (0.0,))])
def test_hysteresis_may_have_rates_of_zero_and_below(operator, numbers):
    assert state(*operated(operator, ["p"], [numbers])).numbers == numbers


@pytest.mark.parametrize(("room", "text"), [(2e8, "0.2 GB may"), (5e7, "50 MB may")])
def test_too_many_products_are_refused_with_the_size_of_the_memory(room, text, monkeypatch):
    monkeypatch.setattr(families, "usable_memory", lambda: room)
    with pytest.raises(DataError, match=text):
        products([f"x{i}" for i in range(60)], 3)


def test_spread_numbers_cover_the_training_range():
    assert spread_widths(4) == (0.1, 0.2, 0.3, 0.4)
    assert spread_times(3, 0.01, 40.0) == (0.1, 1.0, 10.0)
    assert spread_times(3, 0.01, 0.1) == (0.1,)  # too short for more


@given(st.integers(1, 5), st.integers(0, 4), st.integers(0, 5), st.booleans())
def test_products_are_those_monomials_that_have_few_states_beside_the_partners(
    count, order, partners, constant
):
    names = ["p", "q[k-1]", "slow(p, 1)", "play(q, 0.5)", "r"][:count]
    free = set(names[:partners])
    found = products(names, order, partners=names[:partners], constant=constant)
    assert found == tuple(
        term for term in products(names, order, constant=constant) if len(term.names - free) <= 1
    )
    assert len(found) == count_products(count, order, len(free)) - (not constant)


@pytest.mark.parametrize(
    ("of", "order", "partners"),
    [(["p", "p"], 2, None), (["p"], 21, None), (["p"], -1, None), (["p"], 2, ["q"])],
)
def test_impossible_products_are_refused(of, order, partners):
    with pytest.raises(ValueError, match=r"order|twice|which is not in `of`"):
        products(of, order, partners)


@pytest.mark.parametrize(("pages", "usable"), [(1000, 2_048_000), (None, 2_000_000_000)])
def test_a_fit_may_use_half_of_the_memory(pages, usable, monkeypatch):
    """Of four gigabytes, if the system does not say how much there is."""
    known = {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": pages} if pages else {"SC_PAGE_SIZE": ""}
    monkeypatch.setattr("os.sysconf", lambda name: int(known[name]))
    assert usable_memory() == usable
    assert [fits_whole(usable // 8 + more, 1) for more in (0, 1)] == [True, False]
    assert products_bytes(9) == 3 * 8 * 100
