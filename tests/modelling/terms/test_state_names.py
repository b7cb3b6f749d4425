"""States with memory as names: read anywhere in an expression, written one way; products of them."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.mathtext import MathTextParser

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions import ExpressionError, Name, families, parse, state, to_latex, to_text
from mapmore_cli.modelling.expressions.families import count_products, delays, lags, operated, products
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.operators.play import spread_widths
from mapmore_cli.modelling.expressions.operators.slow import spread_times
from mapmore_cli.modelling.expressions.states import Lagged, Measured, Operated


@pytest.mark.parametrize(
    ("text", "canonical"),
    [
        ("force[k-1]", "force[k-1]"),
        ("force [ k - 12 ] ^2", "force[k-12]^2"),
        ("pressure*slow( pressure ,.50)", "pressure*slow(pressure, 0.5)"),
        ("slow(play(pressure,0.16),3e-1)", "slow(play(pressure, 0.16), 0.3)"),
        ("play(force[k-2], 0.5)[k-3]", "play(force[k-2], 0.5)[k-3]"),
        ("-resonance(p)/2 + resonance_velocity(p, 4.50, .1)", "-resonance(p)/2 + resonance_velocity(p, 4.5, 0.1)"),
        ("exp(-saturate(x)/3)", "exp(-saturate(x)/3)"),
        ("slow + play*k", "slow + play*k"),  # quantities may be called like operators
    ],
)
def test_canonical_text(text: str, canonical: str) -> None:
    assert to_text(parse(text)) == canonical


def test_a_state_is_one_name() -> None:
    assert parse("force[k-1]*play(pressure, 0.16)^2 + strain").names == {"force[k-1]", "play(pressure, 0.16)", "strain"}
    assert state("slow(play(force[k-2], 0.16), 0.3)").quantity == "force"


@pytest.mark.parametrize(
    ("text", "position", "message"),
    [
        ("x[0]", 1, "a delay is written"),
        ("x[k-0]", 1, "a delay is written"),
        ("x[k+1]", 1, "a delay is written"),
        ("x[k-1", 1, "a delay is written"),
        ("x[k-99999999]", 1, "a delay is written"),
        ("x[k-1][k-2]", 6, "unexpected character"),
        ("slow(x, 1, 2)", 12, "takes 0 or 1 number"),
        ("resonance(x, 1)", 14, "takes 0 or 2"),
        ("resonance(x, 1, 1.5)", 19, "between 0 and 1"),
        ("play(x, -1)", 10, "between 0 and 1"),
        ("play(x, 0)", 9, "between 0 and 1"),
        ("play(x, 1e999)", 8, "expected a number"),
        ("play(x + y, 1)", 7, "expected `,` or `\\)`"),
        ("play(2, 1)", 5, "name of a quantity"),
        ("slow(exp(x), 1)", 5, "name of a quantity"),
        ("slow(slwo(x, 1), 1)", 5, "no operator with memory"),
        ("slow(x, 1", 9, "expected `,` or `\\)`"),
        ("slow(" * 20 + "x", 45, "inside each other"),
    ],
)
def test_malformed_states_are_refused_at_their_place(text: str, position: int, message: str) -> None:
    with pytest.raises(ExpressionError, match=message) as caught:
        parse(text)
    assert caught.value.position == position


@pytest.mark.parametrize("name", ["slow(x,1)", "x[k - 1]", "slow(x, 1.0)", "slow(x, 1)^2", "slow(x, 1) ", "x[k-01]"])
def test_a_name_is_refused_where_it_is_not_canonical(name: str) -> None:
    with pytest.raises(ExpressionError):
        Name(name)


NUMBERS = st.floats(1e-9, 0.999, allow_subnormal=False)
STATES = st.recursive(
    st.sampled_from(["x", "pressure", "slow", "k"]).map(Measured),
    lambda inner: st.one_of(
        st.builds(Lagged, inner.filter(lambda found: not isinstance(found, Lagged)), st.integers(1, 1_000_000)),
        st.sampled_from(sorted(OPERATORS)).flatmap(
            lambda name: st.builds(
                Operated,
                st.just(name),
                inner,
                st.sampled_from(OPERATORS[name].counts).flatmap(lambda count: st.tuples(*[NUMBERS] * count)),
            )
        ),
    ),
    max_leaves=5,
)


@settings(deadline=None, max_examples=40)
@given(STATES)
def test_every_state_survives_as_text_and_is_typeset(found) -> None:
    assert state(found.name) == found
    term = parse(f"2*{found.name}^2 + 1")
    assert term.names == {found.name}
    assert parse(to_text(term)) == term
    MathTextParser("path").parse(f"${to_latex(term)}$")


@given(st.text(alphabet="xk()[],-.0123456789slowplay ", max_size=40))
def test_any_text_is_a_state_or_refused_within_it(text: str) -> None:
    position = None
    try:
        assert state(state(text).name) == state(text)
    except ExpressionError as error:
        position = error.position
    assert position is None or 0 <= position <= len(text)


def test_names_are_written_as_a_person_would():
    assert lags(["force", "pressure"], [0, 1, 2]) == ("force", "pressure", "force[k-1]", "pressure[k-1]", "force[k-2]", "pressure[k-2]")
    assert delays(["p"], [0, 0.011, 0.012, 0.04], 0.01) == ("p", "p[k-1]", "p[k-4]")
    assert operated("play", ["p"], [0.16, 0.4]) == ("play(p, 0.16)", "play(p, 0.4)")
    assert operated("slow", operated("play", ["p"], [0.16]), [0.3]) == ("slow(play(p, 0.16), 0.3)",)
    assert operated("saturate", ["p"]) == ("saturate(p)",)
    assert operated("resonance", ["p"]) == ("resonance(p)", "resonance_velocity(p)")


@pytest.mark.parametrize(("operator", "numbers"), [("play", [0.0]), ("saturate", [1.0]), ("play", [1.0]), ("resonance", [4.0])])
def test_impossible_operators_are_refused(operator, numbers):
    with pytest.raises(ValueError, match=r"number|between"):
        operated(operator, ["p"], numbers)


def test_spread_numbers_cover_the_training_range():
    assert spread_widths(4) == (0.1, 0.2, 0.3, 0.4)
    assert spread_times(3, 0.01, 40.0) == (0.1, 1.0, 10.0)
    assert spread_times(3, 0.01, 0.1) == (0.1,)  # too short for more


@given(st.integers(1, 5), st.integers(0, 4), st.integers(0, 5), st.booleans())
def test_products_are_those_monomials_that_have_few_states_beside_the_partners(count, order, partners, constant):
    names = ["p", "q[k-1]", "slow(p, 1)", "play(q, 0.5)", "r"][:count]
    free = set(names[:partners])
    found = products(names, order, partners=names[:partners], constant=constant)
    assert found == tuple(term for term in products(names, order, constant=constant) if len(term.names - free) <= 1)
    assert len(found) == count_products(count, order, len(free)) - (not constant)


def test_all_states_all_squares_and_one_partner_times_every_state():
    found = [to_text(term) for term in products(["p", "a", "b"], 2, partners=["p"], constant=False)]
    assert sorted(found) == ["a", "a*p", "a^2", "b", "b*p", "b^2", "p", "p^2"]


@pytest.mark.parametrize(("of", "order", "partners"), [(["p", "p"], 2, None), (["p"], 21, None), (["p"], -1, None), (["p"], 2, ["q"])])
def test_impossible_products_are_refused(of, order, partners):
    with pytest.raises(ValueError, match=r"order|twice|none of the states"):
        products(of, order, partners)


def test_more_products_than_memory_allows_are_refused_with_numbers_before_they_are_built(monkeypatch):
    names = [f"x[k-{i}]" for i in range(1, 61)]
    count = count_products(60, 8, 60)
    with pytest.raises(DataError, match=rf"a dictionary of {count} candidates needs .* GB of memory .* may be used"):
        products(names, 8)
    monkeypatch.setattr(families, "usable_memory", lambda: families.products_bytes(10))
    assert len(products(["p", "q", "r"], 2)) == 10
    with pytest.raises(DataError, match=r"a dictionary of 15 candidates needs 0\.00614 MB of memory .* 0\.0029 MB may be used"):
        products(["p", "q", "r", "s"], 2)


def test_bytes_are_those_of_the_arrays():
    assert families.dictionary_bytes(1000, 50) == 1000 * 50 * 8
    assert families.products_bytes(99) == 3 * 100 * 100 * 8
    assert families.usable_memory() > 1e8
