"""How expressions look, as text and as LaTeX; trees that cannot be built."""

from __future__ import annotations

import math

import pytest
from expression_cases import texts
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.mathtext import MathTextParser

from mapmore_cli.modelling.expressions import ExpressionError, Name, Number, add, call, multiply, parse, power, to_latex, to_text


@pytest.mark.parametrize("name", ["exp", "two words", "", "1x", "ε", "a-b"])
def test_impossible_names_are_refused(name):
    with pytest.raises(ExpressionError):
        Name(name)


def test_impossible_nodes_are_refused():
    for build in (lambda: Number(math.nan), lambda: Number(math.inf), lambda: power(Name("x"), 20.5), lambda: call("eval", Name("x"))):
        with pytest.raises(ExpressionError):
            build()


def test_names_of_an_expression():
    assert parse("exp(-strain/a)*pressure^2 + 3").names == {"strain", "a", "pressure"}
    assert parse("1 + 2").names == frozenset()


NODES = st.recursive(
    st.one_of(st.sampled_from("xyz").map(Name), st.floats(allow_nan=False, allow_infinity=False).map(Number)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3).map(lambda terms: add(*terms)),
        st.lists(inner, max_size=3).map(lambda factors: multiply(*factors)),
        st.builds(power, inner, st.one_of(st.sampled_from([-1.0, 2.0, -3.0, 0.5]), st.floats(-20, 20))),
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


def test_digits_round_numbers_but_not_whole_exponents():
    assert to_text(parse("1.23456789*x^12 - 0.000012345"), digits=3) == "1.23*x^12 - 1.23e-05"
    assert to_text(parse("x^12"), digits=1) == "x^12"


@pytest.mark.parametrize(
    ("text", "latex"),
    [
        ("strain^2", r"\mathrm{strain}^{2}"),
        ("strain_rate*a1", r"\mathrm{strain\_rate} \, a_{1}"),
        ("-3*x/(2*y)", r"-\frac{3 \, x}{2 \, y}"),
        ("1/x^2", r"\frac{1}{x^{2}}"),
        ("((strain - 0.045)/0.0453)^2", r"\left(\frac{\mathrm{strain} - 0.045}{0.0453}\right)^{2}"),
        ("1.5e-7*x", r"1.5 \times 10^{-7} \, x"),
        ("exp(-x)^2", r"\left(\exp\left(-x\right)\right)^{2}"),
        ("-(x - y)", r"-\left(x - y\right)"),
        ("x*2^3", r"x \cdot 2^{3}"),
    ],
)
def test_latex(text, latex):
    assert to_latex(parse(text)) == latex


@settings(deadline=None, max_examples=40)
@given(texts())
def test_latex_is_typeset_by_matplotlib(text):
    MathTextParser("path").parse(f"${to_latex(parse(text), digits=6)}$")
