"""The families of terms, and how expressions look."""

from __future__ import annotations

import math

import pytest
from expression_cases import texts
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.mathtext import MathTextParser

from mapmore_cli.modelling.expressions import ExpressionError, Name, Number, add, call, multiply, parse, power, to_latex, to_text
from mapmore_cli.modelling.expressions.families import products


@settings(deadline=None)
@given(st.integers(1, 4), st.integers(0, 5), st.booleans())
def test_number_and_degrees_of_monomials(count: int, order: int, constant: bool) -> None:
    names = ["strain", "pressure", "strain_rate", "pressure_rate"][:count]
    found = [to_text(term) for term in products(names, order, constant=constant)]
    assert len(found) == math.comb(count + order, order) - (not constant)
    assert len(set(found)) == len(found)
    degrees = [sum(int(factor.partition("^")[2] or factor != "1") for factor in text.split("*")) for text in found]
    assert degrees == sorted(degrees)


def test_monomials_are_written_as_a_person_would() -> None:
    found = [to_text(term) for term in products(["strain", "pressure"], 3)]
    assert found[:6] == ["1", "strain", "pressure", "strain^2", "pressure*strain", "pressure^2"]
    assert found[6:] == ["strain^3", "pressure*strain^2", "pressure^2*strain", "pressure^3"]
    assert set(products(["strain", "pressure"], 3)) == set(products(["pressure", "strain"], 3))


@pytest.mark.parametrize("arguments", [(["x"], -1), (["x"], 21), (["x", "x"], 2)])
def test_impossible_families_are_refused(arguments: tuple[list[str], int]) -> None:
    with pytest.raises(ValueError, match=r"order|twice"):
        products(*arguments)


@pytest.mark.parametrize("name", ["exp", "two words", "", "1x", "ε", "a-b"])
def test_impossible_names_are_refused(name: str) -> None:
    with pytest.raises(ExpressionError):
        Name(name)


def test_impossible_nodes_are_refused() -> None:
    for build in (lambda: Number(math.nan), lambda: Number(math.inf), lambda: power(Name("x"), 20.5), lambda: call("eval", Name("x"))):
        with pytest.raises(ExpressionError):
            build()


def test_names_of_an_expression() -> None:
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
def test_every_tree_that_can_be_built_survives_as_text(expression) -> None:
    assert parse(to_text(expression)) == expression


@given(texts(), st.integers(1, 8))
def test_rounded_text_still_parses(text: str, digits: int) -> None:
    assert parse(to_text(parse(text), digits)).names <= parse(text).names


def test_digits_round_numbers_but_not_whole_exponents() -> None:
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
def test_latex(text: str, latex: str) -> None:
    assert to_latex(parse(text)) == latex


@settings(deadline=None, max_examples=40)
@given(texts())
def test_latex_is_typeset_by_matplotlib(text: str) -> None:
    MathTextParser("path").parse(f"${to_latex(parse(text), digits=6)}$")
