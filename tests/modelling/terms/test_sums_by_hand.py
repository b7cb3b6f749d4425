"""Sums, products and powers in canonical form, by hand."""

import sys

import pytest

from mapmore_cli.modelling.expressions.syntax import (
    ONE,
    ZERO,
    Name,
    Number,
    Power,
    Product,
    Sum,
    add,
    expression,
    multiply,
    negate,
    power,
)

X, Y = Name("x"), Name("y")
HUGE, TINY = Number(1e300), Number(1e-300)


def test_numbers_of_a_sum_are_folded_into_the_first():
    assert add(Number(1.0), X, Number(2.0)) == Sum((Number(3.0), X))
    assert add(X, Number(2.0), Sum((Number(1.0), Y))) == Sum((X, Number(3.0), Y))
    assert add(X, Number(2.0), ZERO) == Sum((X, Number(2.0)))
    assert add(X, Number(2.0), Number(-2.0)) == X
    assert add(Number(2.0), Number(-2.0)) == add() == add(ZERO) == ZERO
    most = Number(sys.float_info.max)
    assert add(most, most, X) == Sum((most, most, X))  # their sum would be infinite


def test_numbers_of_a_product_stand_in_front():
    assert multiply(X, Number(2.0), Product((Number(3.0), Y))) == Product((Number(6.0), X, Y))
    assert multiply(X, Number(0.5), Number(2.0)) == X
    assert multiply(X, ZERO, Y) == ZERO
    assert multiply() == multiply(ONE) == ONE
    assert negate(negate(X)) == X
    assert negate(X) == Product((Number(-1.0), X))
    # products beyond the range of numbers are kept apart, with the sign in front
    apart = multiply(HUGE, negate(HUGE), X, ONE)
    assert apart == Product((Number(-1e300), HUGE, X))
    assert multiply(TINY, TINY, X) == Product((TINY, TINY, X))
    assert multiply(negate(X), TINY, TINY) == Product((Number(-1e-300), TINY, X))
    least = sys.float_info.min
    assert multiply(Number(least), ONE, X) == Product((Number(least), X))
    assert multiply(Number(least), Number(0.5)) == Product((Number(least), Number(0.5)))


@pytest.mark.parametrize(
    ("base", "exponent", "made"),
    [
        *((X, 1.0, X), (X, 0.0, ONE), (X, -1.0, Power(X, -1.0)), (X, 2, Power(X, 2.0))),
        *((Power(X, 3.0), -1.0, Power(X, -3.0)), (Power(X, -1.0), -1.0, X)),
        (Power(X, 3.0), 2.0, Power(Power(X, 3.0), 2.0)),
    ],
)
def test_powers(base, exponent, made):
    assert power(base, exponent) == made


def test_numbers_become_expressions():
    assert expression(2) == Number(2.0)
    assert expression(X) is X
