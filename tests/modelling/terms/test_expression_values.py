"""Values, derivatives and substitutions against Python's own arithmetic."""

import math
import pickle
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
from common import rows_of
from expression_cases import NAMES, analytic_texts, by_numpy, by_python, texts
from hypothesis import assume, given
from hypothesis import strategies as st

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions import (
    Name,
    NotFinite,
    affine,
    derivative,
    dictionary_matrix,
    evaluate,
    parse,
    substitute,
    to_mathml,
    to_text,
)
from mapmore_cli.modelling.expressions.calculus import exponents
from mapmore_cli.modelling.expressions.evaluation import folded

POINTS = st.fixed_dictionaries(
    {name: st.floats(-3, 3).map(lambda v: round(v, 3)) for name in NAMES}
)


def value_at(expression, point):
    return float(
        evaluate(expression, {name: np.array([value]) for name, value in point.items()}, 1)[0]
    )


def oracle(text, point):
    """Python's value; the example is dropped where there is none, or where rounding decides about
    it.
    """
    try:
        value = by_python(text, point)
        nearby = by_python(text, point, nudge=1e-9)
    except (ArithmeticError, ValueError):
        assume(False)
    assume(math.isfinite(abs(value)) and abs(value - nearby) <= 1e-4 * abs(value) + 1e-9)
    return value


@given(texts(), POINTS)
def test_value_is_pythons_and_folding_loses_none(text, point):
    """Where NumPy's plain evaluation of the text is finite, so is ours. A root of a negative number
    is complex for Python, NaN here.
    """
    expected, plain, found = (
        oracle(text, point),
        by_numpy(text, point),
        value_at(parse(text), point),
    )
    if math.isfinite(plain):
        assert found == pytest.approx(plain, rel=1e-7, abs=1e-7)
    if math.isfinite(found) and abs(expected.imag) <= 1e-6 * abs(expected):
        assert found == pytest.approx(expected.real, rel=1e-7, abs=1e-7)


def read(node):
    """The expression that a person reads in MathML."""
    inner = [read(part) for part in node]
    match node.tag:
        case "mfrac" | "msup":
            return f"({inner[0]}){'/' if node.tag == 'mfrac' else '^'}({inner[1]})"
        case "msqrt":
            return f"sqrt({''.join(inner)})"
        case "mspace":
            return "*"
    return "".join(inner) or {"−": "-", "·": "*"}.get(node.text, node.text)


@given(texts(("exp", "log", "sqrt", "sin")), POINTS)
def test_mathml_reads_as_the_expression(text, point):
    oracle(text, point)
    expected = value_at(parse(text), point)
    assume(math.isfinite(expected))
    markup = fromstring(f"<math>{''.join(to_mathml(parse(text)))}</math>")
    assert by_numpy(read(markup).replace("−", "-"), point) == pytest.approx(
        expected, rel=1e-7, abs=1e-7
    )
    (names,) = to_mathml(parse("a1*y_1*slow(p, 0.3)*force[k-2]"))
    assert read(fromstring(names)) == "a1*y_1*slow0.3(p)*force[k−2]"
    assert "<mn>−6</mn>" in to_mathml(parse("2e-6*x"))[0]


@given(analytic_texts(), POINTS)
def test_derivative_is_the_complex_step(text, point):
    """d/dx = Im f(x + ih)/h, without any difference of close numbers."""
    value, step = oracle(text, point), 1e-30
    assume(abs(value.imag) == 0.0)
    expected = oracle_slope(text, point, step)
    slope = derivative(parse(text), "x")
    found = value_at(slope, point)
    assume(math.isfinite(found) and abs(expected) < 1e12)
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-6)


def oracle_slope(text, point, step):
    """The complex step, agreed upon by a central difference (else a branch cut lies near)."""
    try:
        exact = by_python(text, {**point, "x": complex(point["x"], step)}).imag / step
        ahead, behind = (by_python(text, {**point, "x": point["x"] + h}) for h in (1e-6, -1e-6))
    except (ArithmeticError, ValueError):
        assume(False)
    assume(abs((ahead - behind) / 2e-6 - exact) <= 1e-3 * abs(exact) + 1e-3)
    return exact


@pytest.mark.parametrize(
    ("text", "slope"),
    rows_of("""
x^3           3*x^2
2*x^3*y       6*x^2*y
x             1
y             0
exp(-x/0.02)  -exp(-x/0.02)/0.02
x^-20         -20/x^20/x
x^-19         -19/x^20
log(x)        1/x
abs(x)        sign(x)
"""),
)
def test_derivative_reads_as_a_person_would_write_it(text, slope):
    assert to_text(derivative(parse(text), "x")) == slope


@given(texts(max_leaves=6), texts(max_leaves=4), POINTS)
def test_substitution_is_evaluation_in_two_steps(outer, inner, point):
    put = value_at(parse(inner), point)
    assume(math.isfinite(put))
    expected = value_at(parse(outer), {**point, "x": put})
    assume(math.isfinite(expected))
    oracle(outer, {**point, "x": put})
    assert value_at(substitute(parse(outer), {"x": parse(inner)}), point) == pytest.approx(
        expected, rel=1e-7, abs=1e-7
    )
    # all at once
    assert to_text(substitute(parse("x - 2*y"), {"x": Name("y"), "y": Name("x")})) == "y - 2*x"


@pytest.mark.parametrize(
    ("slope", "intercept", "text"),
    [
        (2.0, -1.0, "(x - 0.5)/0.5"),
        (-2.0, 1.0, "(0.5 - x)/0.5"),
        (4.0, 0.0, "x/0.25"),
        (1.0, 0.0, "x"),
        (-1.0, 0.0, "-x"),
        (0.0, 3.0, "3"),
    ],
)
def test_affine_prints_centre_and_width(slope, intercept, text):
    assert to_text(affine(Name("x"), slope, intercept)) == text


def test_constants_fill_every_row_and_arrays_are_new():
    x = np.arange(3.0)
    np.testing.assert_array_equal(evaluate(parse("2"), {"x": x}), [2.0, 2.0, 2.0])
    np.testing.assert_array_equal(evaluate(parse("2"), {}, 4), np.full(4, 2.0))
    np.testing.assert_array_equal(evaluate(parse("a*x"), {"x": x, "a": np.array(3.0)}), 3 * x)
    copy = evaluate(parse("x"), {"x": x})
    copy[0] = 9.0
    assert x[0] == 0.0


def test_absent_and_misshapen_columns_are_data_errors():
    with pytest.raises(DataError, match="no column `strain`"):
        evaluate(parse("strain"), {"pressure": np.zeros(3)})
    with pytest.raises(DataError, match="shape"):
        evaluate(parse("strain"), {"strain": np.zeros(3)}, 4)
    with pytest.raises(DataError, match="number of rows"):
        evaluate(parse("1"), {})
    with pytest.raises(DataError, match="no column `b`"):  # the first in alphabetical order
        evaluate(parse("h*g*f*e*d*c*b*a"), {"a": np.zeros(3)})


def test_parts_without_variables_become_numbers_but_a_divisor_remains():
    assert to_text(folded(parse("exp(0)*x/620 + 2^3"))) == "x/620 + 8"
    assert exponents(parse("p*strain^2/x")) == {"p": 1, "strain": 2, "x": -1}
    assert exponents(parse("2*x")) is exponents(parse("x + p")) is None


@given(st.lists(texts(max_leaves=6), max_size=6), st.integers(1, 4))
def test_dictionary_matrix_is_evaluate_column_by_column(terms, n):
    rng = np.random.default_rng(n)
    columns = {name: rng.uniform(0.5, 2.0, n) for name in NAMES}
    expressions = [parse(text) for text in terms]
    expected = [evaluate(expression, columns, n) for expression in expressions]
    if not all(np.isfinite(column).all() for column in expected):
        with pytest.raises(NotFinite):
            dictionary_matrix(expressions, columns, n)
        return
    matrix = dictionary_matrix(expressions, columns, n)
    assert matrix.shape == (n, len(terms))
    assert matrix.flags.f_contiguous
    for column, reference in zip(matrix.T, expected, strict=True):
        np.testing.assert_array_equal(column, reference)


@pytest.mark.parametrize("row", [0, 8191, 8192, 19_999])
def test_a_term_that_is_not_finite_is_named_with_its_first_row(row):
    x = np.full(20_000, 0.5)
    x[row:] = -1.0
    with pytest.raises(
        NotFinite, match=rf"`log\(x\)` is not finite in row {row} \(x = -1\)"
    ) as caught:
        dictionary_matrix([parse("x"), parse("log(x)"), parse("sqrt(x)")], {"x": x}, len(x))
    assert (caught.value.term, caught.value.row) == ("log(x)", row)
    columns = {name: np.full(3, place) for place, name in enumerate("abcde", -4)}
    with pytest.raises(NotFinite, match="a = -4, b = -3, c = -2, d = -1, e = 0"):
        dictionary_matrix([parse("log(e + d + c + b + a)")], columns, 3)
    assert isinstance(caught.value, ValueError)


def test_a_tree_keeps_its_hash_but_does_not_take_it_along():
    """Hashes of text differ from process to process."""
    tree, same = (
        substitute(parse("2*strain*pressure + exp(strain)"), {"strain": Name("x")})
        for _ in range(2)
    )
    assert hash(tree) == hash(same) == hash(tree)
    carried = pickle.loads(pickle.dumps(tree))
    assert "_hash" in vars(tree)
    assert "_hash" not in vars(carried)
    assert carried == tree
    assert hash(carried) == hash(tree)
