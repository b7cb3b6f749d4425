"""Text to syntax tree: what is accepted, what is refused, and where."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mapmore_cli.modelling.expressions import ExpressionError, parse, to_text


@pytest.mark.parametrize(
    ("text", "canonical"),
    [
        ("strain**2", "strain^2"),
        ("2*3*strain", "6*strain"),
        ("strain + 0", "strain"),
        ("1*strain/1", "strain/1"),
        ("-x^2", "-x^2"),
        ("(-x)^2", "(-x)^2"),
        ("2^3^2", "2^9"),
        ("x^-2", "1/x^2"),
        ("x^(1/2)", "x^0.5"),
        ("a - (b - c)", "a - (b - c)"),
        ("a + (b + c)", "a + b + c"),
        ("a/b/c", "a/b/c"),
        ("a/(b*c)", "a/(b*c)"),
        ("- - -x", "-x"),
        ("a - -b", "a + b"),
        ("(0.083 - length)/0.083", "(0.083 - length)/0.083"),
        (" exp( -strain / 0.02 )\n", "exp(-strain/0.02)"),
        ("1e-3*x", "0.001*x"),
        (".5*_y1", "0.5*_y1"),
    ],
)
def test_canonical_text(text: str, canonical: str) -> None:
    assert to_text(parse(text)) == canonical


@pytest.mark.parametrize(
    ("text", "position", "message"),
    [
        ("", 0, "ends"),
        ("   ", 3, "ends"),
        ("strain +", 8, "ends"),
        ("strain * * 2", 9, "stands"),
        ("2 strain", 2, "operator"),
        ("2strain", 1, "operator"),
        ("(strain", 7, r"`\)`"),
        ("strain)", 6, "operator"),
        ("()", 1, "stands"),
        ("x^21", 2, "beyond 20"),
        ("x^-20.5", 2, "beyond 20"),
        ("x^y", 2, "constant"),
        ("x^(1/0)", 2, "beyond 20"),
        ("x^log(-1)", 2, "beyond 20"),
        ("1 + 1e999", 4, "too large"),
        ("9" * 400, 0, "too large"),
        ("1e", 1, "operator"),
        ("1.2.3", 3, "operator"),
        ("0x10", 1, "operator"),
        ("exp", 0, "is a function"),
        ("expp(x)", 0, "did you mean `exp`"),
        ("strain(2)", 0, "no function"),
        ("__import__('os').system('true')", 11, "unexpected character"),
        ("__import__(os)", 0, "no function"),
        ("x.real", 1, "unexpected character"),
        ("x[0]", 1, "a delay is written"),
        ("lambda: 0", 6, "unexpected character"),
        ("a if b else c", 2, "operator"),
        ("x = 1", 2, "unexpected character"),
        ("strain; pressure", 6, "unexpected character"),
        ("ε + 1", 0, "unexpected character"),
        ("1 + ٣", 4, "unexpected character"),
        ("x\u00a0+ 1", 1, "unexpected character"),
        ("x\x00", 1, "unexpected character"),
        ("exp(x, y)", 5, "unexpected character"),
    ],
)
def test_malformed_text_is_refused_at_its_place(text: str, position: int, message: str) -> None:
    with pytest.raises(ExpressionError, match=message) as caught:
        parse(text)
    assert caught.value.position == position
    assert caught.value.message == str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "(" * 1_000_000,
        "(" * 4000 + "x" + ")" * 4000,
        "exp(" * 2000 + "x" + ")" * 2000,
        "x" + "^2" * 4000,
        "x^(" * 3000,
        "x+" * 500_000 + "x",
        "9" * 1_000_000,
        "x" * 1_000_000,
        " " * 1_000_000,
    ],
    ids=["brackets", "balanced", "calls", "powers", "exponents", "sum", "digits", "name", "spaces"],
)
def test_hostile_size_is_an_expression_error(text: str) -> None:
    with pytest.raises(ExpressionError):
        parse(text)


@pytest.mark.parametrize("text", ["-" * 9998 + "x", "x" + "+x" * 2499, "x" + "*x" * 4999, "(" * 50 + "x" + ")" * 50])
def test_long_but_shallow_text_is_accepted(text: str) -> None:
    assert parse(text).names == {"x"}


@given(st.text(alphabet="xyexpsinlog_()+-*/^.0123456789 \t,=ε'", max_size=40))
@example("x" * 5000 + "(")
def test_any_text_parses_or_is_refused_within_it(text: str) -> None:
    position = None
    try:
        assert parse(to_text(parse(text))) == parse(text)
    except ExpressionError as error:
        position = error.position
    assert position is None or 0 <= position <= len(text)
