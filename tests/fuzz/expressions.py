"""Expressions: written by their grammar with states and hostile numbers, some changed; what parses
is printed, differentiated, computed.
"""

import math

import numpy as np
from driver import Fault, Target, changed_text

from mapmore_cli.modelling import expressions as terms
from mapmore_cli.modelling.expressions.functions import FUNCTIONS
from mapmore_cli.modelling.expressions.operators import OPERATORS

NAMES = ("pressure", "strain", "x1", "_", "pi", "exp2", "force", "exponent")
NUMBERS = (
    "0",
    "1",
    "2",
    "0.5",
    "1e-300",
    "1e300",
    "4.9e-324",
    "1e999",
    ".5",
    "3.",
    "1e",
    "007",
    "9" * 400,
    "0x10",
    "1_0",
    "1e-999",
)
EXPONENTS = (
    "2",
    "3",
    "-1",
    "0.5",
    "20",
    "20.5",
    "1e9",
    "-(2)",
    "(1/3)",
    "0",
    "1e-9",
    "pressure",
    "2^2",
    "(1/0)",
    "log(-1)",
)
STATES = (
    "[k-1]",
    "[k-0]",
    "[k-99999999999]",
    "[k]",
    "[k+1]",
    "[k-1",
    "[-1]",
    "[k - 2]",
    "[k-1][k-1]",
)
MARKS = "+-*/^().,[]eE_ 0123456789abcxyz\t\n\x00é×²"
WORDS = (*OPERATORS, *FUNCTIONS)
COLUMNS = {name: np.array([-2.0, 0.0, 1e-3, 1.0, 1e8]) for name in NAMES}


def expression(chance, depth, names=NAMES):
    """An expression of some depth, mostly well formed."""

    def inner():
        return expression(chance, depth - 1, names)

    if depth <= 0:
        leaf = chance.random()
        if leaf < 0.45:
            return chance.choice(names)
        if leaf < 0.96:
            return chance.choice(NUMBERS[:7] if leaf < 0.93 else NUMBERS)
        return chance.choice(names) + chance.choice(STATES)
    match chance.randrange(10):
        case 0 | 1 | 2 | 3:
            return f"{inner()} {chance.choice('+-*/')} {inner()}"
        case 4:
            return f"({inner()})"
        case 5:
            base, sign = inner(), chance.choice(["^", "**"])
            exponents = EXPONENTS[:8] if chance.random() < 0.9 else EXPONENTS
            return f"({base}){sign}{chance.choice(exponents)}"
        case 6:
            return f"{chance.choice('-+')}{inner()}"
        case 7 | 8:
            return f"{chance.choice(tuple(FUNCTIONS))}({inner()})"
        case _:
            numbers = ", ".join(chance.choice(NUMBERS) for _ in range(chance.randrange(3)))
            return (
                f"{chance.choice(WORDS)}({chance.choice(names)}{', ' if numbers else ''}{numbers})"
            )


def text_of(chance):
    """An input: an expression, often changed, seldom much too deep or too long."""
    kind = chance.random()
    if kind < 0.02:
        many = chance.randrange(10, 6000)
        return chance.choice(
            [
                "(" * many + "x1" + ")" * many,
                "-" * many + "x1",
                "+".join(["x1"] * many),
                "exp(" * many,
                "x1^2" * many,
            ]
        )
    text = expression(chance, chance.randrange(6))
    return changed_text(text, chance, MARKS) if kind < 0.2 else text


def attempt(chance, number, folder):
    """Parse, print, parse again, differentiate, compute; refused are `ExpressionError`s alone."""
    text = text_of(chance)
    try:
        found = terms.parse(text)
    except terms.ExpressionError:
        return "refused"
    printed = terms.to_text(found)
    if terms.to_text(terms.parse(printed)) != printed:
        raise Fault(f"{text!r} prints as {printed!r}, which reads otherwise")
    terms.to_latex(found)
    for name in sorted(found.names)[:2]:
        terms.to_text(terms.derivative(found, name))
    if found.names <= {*COLUMNS}:
        with np.errstate(all="ignore"):
            values = terms.evaluate(found, COLUMNS, 5)
        if values.shape != (5,):
            raise Fault(f"{text!r} has values of shape {values.shape}")
        if not found.names and math.isfinite(values[0]) and len({*values}) != 1:
            raise Fault(f"{text!r} is constant and varies")
        return "computed"
    return "printed"


TARGET = Target("expressions", attempt, past=("computed", "printed"))
