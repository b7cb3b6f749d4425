"""Random expressions, each as text for us and as a computation of Python's own."""

import ast
import cmath
import math
import operator

import numpy as np
from hypothesis import strategies as st

from mapmore_cli.modelling.expressions.functions import FUNCTIONS

NAMES = ("x", "y", "z")
_NUMBERS = st.one_of(
    st.integers(0, 9).map(str),
    st.floats(1e-3, 1e3).map(repr),
    st.sampled_from(["0.0", "1.0", "1e-05", "2.5e+16", ".5", "3."]),
)
_ANALYTIC = (
    "exp",
    "log",
    "sqrt",
    "sin",
    "cos",
    "tan",
    "atan",
    "sinh",
    "cosh",
    "tanh",
    "expm1",
    "log1p",
)
_OPERATIONS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}


def _grown(inner, functions):
    exponents = st.sampled_from(["2", "3", "5", "-1", "-2", "0.5", "(1/3)", "1", "0", "20"])
    return st.one_of(
        st.builds("{} {} {}".format, inner, st.sampled_from("+-*/"), inner),
        st.builds("({})".format, inner),
        st.builds("-{}".format, inner),
        st.builds("({}){}{}".format, inner, st.sampled_from(["^", "**"]), exponents),
        st.builds("{}({})".format, st.sampled_from(functions), inner),
    )


def texts(functions=(*_ANALYTIC, "abs", "sign"), max_leaves=12):
    """Well-formed expressions of x, y and z."""
    return st.recursive(
        st.one_of(st.sampled_from(NAMES), _NUMBERS),
        lambda inner: _grown(inner, functions),
        max_leaves=max_leaves,
    )


def analytic_texts():
    """Expressions that have a complex derivative where they are finite."""
    return texts(_ANALYTIC, max_leaves=8)


def by_python(text, values, nudge=0.0):
    """Value of `text` by Python's parser and complex arithmetic; raises ArithmeticError or
    ValueError where it has none.

    `nudge` changes every number and name a little, each occurrence differently, to tell where
    rounding decides.
    """
    functions = {name: getattr(cmath, name) for name in _ANALYTIC if hasattr(cmath, name)}
    functions |= {
        "expm1": lambda z: complex(np.expm1(complex(z))) if abs(z) < 1 else cmath.exp(z) - 1,
        "log1p": lambda z: complex(np.log1p(complex(z))) if abs(z) < 0.5 else cmath.log(1 + z),
        "abs": lambda z: complex(abs(z.real)),
        "sign": lambda z: complex((z.real > 0) - (z.real < 0)),
    }
    return _walk(
        _body(text),
        values,
        functions,
        lambda value, place: complex(value) * (1 + nudge * math.sin(place + 1)),
    )


def by_numpy(text, values):
    """Value of `text` by Python's parser and NumPy's real numbers, without any simplification; NaN
    or infinite where it has none.
    """
    functions = {name: function.compute for name, function in FUNCTIONS.items()}
    with np.errstate(all="ignore"):
        return float(_walk(_body(text), values, functions, lambda value, _: np.float64(value)))


def _body(text):
    return ast.parse(text.replace("^", "**"), mode="eval").body


def _walk(node, values, functions, number):
    match node:
        case ast.Constant(value):
            return number(value, node.col_offset)
        case ast.Name(name):
            return number(values[name], node.col_offset)
        case ast.UnaryOp(op, operand):
            return _OPERATIONS[type(op)](_walk(operand, values, functions, number))
        case ast.BinOp(base, ast.Pow(), exponent):
            return _walk(base, values, functions, number) ** float(
                _walk(exponent, {}, {}, lambda value, _: np.float64(value))
            )
        case ast.BinOp(left, op, right):
            return _OPERATIONS[type(op)](
                _walk(left, values, functions, number), _walk(right, values, functions, number)
            )
        case ast.Call(ast.Name(function), [argument]):
            return functions[function](_walk(argument, values, functions, number))
    raise TypeError(ast.dump(node))
