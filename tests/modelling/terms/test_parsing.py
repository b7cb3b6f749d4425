"""Text to syntax tree and back, as text and as LaTeX: what is accepted, what is refused, and where;
states are names, written one way.
"""

import math

import pytest
from common import rows_of
from expression_cases import texts
from hypothesis import example, given, settings
from hypothesis import strategies as st
from matplotlib.mathtext import MathTextParser

from mapmore_cli.modelling.expressions import (
    ExpressionError,
    Name,
    Number,
    add,
    call,
    multiply,
    parse,
    power,
    state,
    to_latex,
    to_mathml,
    to_text,
)
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import Lagged, Measured, Operated
from mapmore_cli.modelling.expressions.syntax import Power


@pytest.mark.parametrize(
    ("text", "canonical"),
    [
        *rows_of("""
strain**2                                          strain^2
2*3*strain                                         6*strain
strain + 0                                         strain
1*strain/1                                         strain/1
2^3^2                                              2^9
x^-2                                               1/x^2
x^(1/2)                                            x^0.5
a + (b + c)                                        a + b + c
- - -x                                             -x
2*- -x                                             2*x
a - -b                                             a + b
1e-3*x                                             0.001*x
.5*_y1                                             0.5*_y1
force [ k - 12 ] ^2                                force[k-12]^2
pressure*slow( pressure ,.50)                      pressure*slow(pressure, 0.5)
slow(play(pressure,0.16),3e-1)                     slow(play(pressure, 0.16), 0.3)
-resonance(p)/2 + resonance_velocity(p, 4.50, .1)  \
    -resonance(p)/2 + resonance_velocity(p, 4.5, 0.1)
-x^2                                               -x^2
(-x)^2                                             (-x)^2
a - (b - c)                                        a - (b - c)
a/b/c                                              a/b/c
a/(b*c)                                            a/(b*c)
(0.083 - length)/0.083                             (0.083 - length)/0.083
force[k-1]                                         force[k-1]
play(force[k-2], 0.5)[k-3]                         play(force[k-2], 0.5)[k-3]
exp(-saturate(x)/3)                                exp(-saturate(x)/3)
slow + play*k                                      slow + play*k
"""),
        (" exp( -strain / 0.02 )\n", "exp(-strain/0.02)"),
    ],
)
def test_canonical_text(text, canonical):
    assert to_text(parse(text)) == canonical


MALFORMED = {
    "ends": {"": 0, "   ": 3, "strain +": 8},
    "stands": {"strain * * 2": 9, "()": 1},
    "operator": {
        "2 strain": 2,
        "2strain": 1,
        "strain)": 6,
        "1e": 1,
        "1.2.3": 3,
        "0x10": 1,
        "a if b else c": 2,
    },
    r"`\)`": {"(strain": 7},
    "at most 20": {"x^21": 2, "x^-20.5": 2, "x^(1/0)": 2, "x^log(-1)": 2},
    "constant": {"x^y": 2},
    "too large": {"1 + 1e999": 4, "9" * 400: 0},
    "is a function": {"exp": 0},
    "did you mean `exp`": {"expp(x)": 0},
    "no function": {"strain(2)": 0, "__import__(os)": 0},
    "unexpected character": {
        **{
            "__import__('os').system('true')": 11,
            "x.real": 1,
            "lambda: 0": 6,
            "x = 1": 2,
            "strain; pressure": 6,
            "exp(x, y)": 5,
        },
        **{"ε + 1": 0, "1 + ٣": 4, "x\u00a0+ 1": 1, "x\x00": 1, "x[k-1][k-2]": 6},
    },
    "a delay is written": {
        "x[0]": 1,
        "x[k-0]": 1,
        "x[k+1]": 1,
        "x[k-1": 1,
        "x[k-00000001]": 1,
        "x[k-1000001]": 1,
    },
    "takes 0 or 1 number": {"slow(x, 1, 2)": 12},
    "takes 0 or 2": {"resonance(x, 1)": 14},
    "between 0 and 1": {"resonance(x, 1, 1.5)": 19, "play(x, -1)": 10, "play(x, 0)": 9},
    "between 0 and inf": {"dahl(x, -1e-10)": 14, "slow(x, 0)": 9},
    "expected a number": {"play(x, 1e999)": 8},
    r"expected `,` or `\)`": {"play(x + y, 1)": 7, "slow(x, 1": 9},
    "name of a quantity": {"play(2, 1)": 5, "slow(exp(x), 1)": 5},
    "no operator with memory": {"slow(slwo(x, 1), 1)": 5},
    "nested": {"slow(" * 20 + "x": 45},
}
"""Texts and the places at which they are refused, by what is said."""


@pytest.mark.parametrize(
    ("message", "text", "position"),
    [(told, *one) for told, where in MALFORMED.items() for one in where.items()],
)
def test_malformed_text_is_refused_at_its_place(message, text, position):
    with pytest.raises(ExpressionError, match=message) as caught:
        parse(text)
    assert caught.value.position == position
    assert caught.value.message == str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "(" * 1_000_000,
        "exp(" * 2000 + "x" + ")" * 2000,
        "x" + "^2" * 4000,
        "x^(" * 3000,
        "x+" * 500_000 + "x",
        "9" * 1_000_000,
        " " * 1_000_000,
    ],
    ids=["brackets", "calls", "powers", "exponents", "sum", "digits", "spaces"],
)
def test_hostile_size_is_an_expression_error(text):
    with pytest.raises(ExpressionError):
        parse(text)


@pytest.mark.parametrize(
    "text_of",
    [
        lambda more: "x" * (10_000 + more),
        lambda more: "x" * (4997 + more) + "+" + "y" * 5000,  # written as 10 000 characters
        lambda more: "(" * (50 + more) + "x" + ")" * (50 + more),
        lambda more: f"x^{20 + more}",
        lambda more: f"x^-{20 + more}",
        lambda more: f"x[k-{1_000_000 + more}]",
        lambda more: "slow(" * (8 + more) + "x" + ", 1)" * (8 + more),
    ],
)
def test_a_text_may_reach_its_limits_but_not_pass_them(text_of):
    assert parse(text_of(0)).names
    with pytest.raises(ExpressionError):
        parse(text_of(1))


@pytest.mark.parametrize("text", ["-" * 9999 + "x", "x" + "+x" * 2499, "x" + "*x" * 4999])
def test_long_but_shallow_text_is_accepted(text):
    assert parse(text).names == {"x"}


def place_of_refusal(text, read, write):
    """Where `read` refuses a text, 0 where it does not; what it reads is written so that it reads
    the same.
    """
    try:
        found = read(text)
    except ExpressionError as error:
        return error.position
    assert read(write(found)) == found
    return 0


@given(st.text(alphabet="xyexpsinlog_()+-*/^.0123456789 \t,=ε'", max_size=40))
@example("x" * 5000 + "(")
def test_any_text_parses_or_is_refused_within_it(text):
    assert 0 <= place_of_refusal(text, parse, to_text) <= len(text)


@given(st.text(alphabet="xk()[],-.0123456789slowplay ", max_size=40))
def test_any_text_is_a_state_or_refused_within_it(text):
    assert 0 <= place_of_refusal(text, state, lambda found: found.name) <= len(text)


def test_names_of_an_expression():
    assert parse("exp(-strain/a)*pressure^2 + 3").names == {"strain", "a", "pressure"}
    assert parse("1 + 2").names == frozenset()
    assert parse("force[k-1]*play(pressure, 0.16)^2 + strain").names == {
        "force[k-1]",
        "play(pressure, 0.16)",
        "strain",
    }
    assert state("slow(play(force[k-2], 0.16), 0.3)").quantity == "force"


@pytest.mark.parametrize(
    "build",
    [
        *(lambda name=name: Name(name) for name in ("exp", "two words", "", "1x", "ε", "a-b")),
        *(
            lambda name=name: Name(name)
            for name in (
                "slow(x,1)",
                "x[k - 1]",
                "slow(x, 1.0)",
                "slow(x, 1)^2",
                "slow(x, 1) ",
                "x[k-01]",
            )
        ),
        lambda: Number(math.nan),
        lambda: Number(math.inf),
        lambda: power(Name("x"), 20.5),
        lambda: power(Name("x"), -20.5),
        lambda: call("eval", Name("x")),
    ],
)
def test_impossible_nodes_are_refused(build):
    with pytest.raises(ExpressionError):
        build()


NUMBERS = st.floats(1e-9, 0.999, allow_subnormal=False)
STATES = st.recursive(
    st.sampled_from(["x", "pressure", "slow", "k"]).map(Measured),
    lambda inner: st.one_of(
        st.builds(
            Lagged,
            inner.filter(lambda found: not isinstance(found, Lagged)),
            st.integers(1, 1_000_000),
        ),
        st.sampled_from(sorted(OPERATORS)).flatmap(
            lambda name: st.builds(
                Operated,
                st.just(name),
                inner,
                st.sampled_from(OPERATORS[name].counts).flatmap(
                    lambda count: st.tuples(*[NUMBERS] * count)
                ),
            )
        ),
    ),
    max_leaves=5,
)


@settings(max_examples=40)
@given(STATES)
def test_every_state_survives_as_text_and_is_typeset(found):
    assert state(found.name) == found
    term = parse(f"2*{found.name}^2 + 1")
    assert term.names == {found.name}
    assert parse(to_text(term)) == term
    MathTextParser("path").parse(f"${to_latex(term)}$")


NODES = st.recursive(
    st.one_of(
        st.sampled_from("xyz").map(Name),
        st.floats(allow_nan=False, allow_infinity=False).map(Number),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3).map(lambda terms: add(*terms)),
        st.lists(inner, max_size=3).map(lambda factors: multiply(*factors)),
        st.builds(
            power, inner, st.one_of(st.sampled_from([-1.0, 2.0, -3.0, 0.5]), st.floats(-20, 20))
        ),
        st.builds(call, st.sampled_from(["exp", "sqrt", "abs"]), inner),
    ),
    max_leaves=10,
)


@given(NODES)
def test_every_tree_that_can_be_built_survives_as_text(expression):
    assert parse(to_text(expression)) == expression


@given(texts(), st.integers(1, 8))
def test_rounded_text_still_parses(text, digits):
    assert parse(to_text(parse(text), digits)).names <= parse(text).names


def test_zero_has_neither_a_sign_nor_brackets():
    zero = Number(0.0)
    assert to_mathml(zero) == ("<mrow><mn>0</mn></mrow>",)
    assert (to_text(Power(zero, 2.0)), to_latex(Power(zero, 2.0))) == ("0^2", "0^{2}")


def test_digits_round_numbers_but_not_whole_exponents():
    assert to_text(parse("1.23456789*x^12 - 0.000012345"), digits=3) == "1.23*x^12 - 1.23e-05"
    assert to_text(parse("x^12"), digits=1) == "x^12"


@pytest.mark.parametrize(
    ("text", "latex"),
    rows_of(r"""
strain^2                     \mathrm{strain}^{2}
strain_rate*a1               \mathrm{strain\_rate} \, a_{1}
-3*x/(2*y)                   -\frac{3 \, x}{2 \, y}
1/x^2                        \frac{1}{x^{2}}
((strain - 0.045)/0.0453)^2  \left(\frac{\mathrm{strain} - 0.045}{0.0453}\right)^{2}
1.5e-7*x                     1.5 \times 10^{-7} \, x
exp(-x)^2                    \left(\exp\left(-x\right)\right)^{2}
-(x - y)                     -\left(x - y\right)
x*2^3                        x \cdot 2^{3}
"""),
)
def test_latex(text, latex):
    assert to_latex(parse(text)) == latex


@settings(max_examples=40)
@given(texts())
def test_latex_is_typeset_by_matplotlib(text):
    MathTextParser("path").parse(f"${to_latex(parse(text), digits=6)}$")
