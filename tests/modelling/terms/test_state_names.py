"""States with memory as names: read anywhere in an expression, written one way."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.mathtext import MathTextParser

from mapmore_cli.modelling.expressions import OPERATORS, ExpressionError, Lagged, Measured, Name, Operated, parse, state, to_latex, to_text


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
