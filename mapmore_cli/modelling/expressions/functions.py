"""The functions of one argument that expressions and recursions may call: a further one is a further line."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np


class Function(NamedTuple):
    """A function of one argument: how NumPy computes it, its derivative by x as text, and its LaTeX with `#` for the argument."""

    compute: np.ufunc
    slope: str
    latex: str


FUNCTIONS: Mapping[str, Function] = MappingProxyType(
    {
        "exp": Function(np.exp, "exp(x)", r"\exp\left(#\right)"),
        "log": Function(np.log, "1/x", r"\ln\left(#\right)"),
        "sqrt": Function(np.sqrt, "0.5/sqrt(x)", r"\sqrt{#}"),
        "abs": Function(np.abs, "sign(x)", r"\left|#\right|"),
        "sign": Function(np.sign, "0", r"\operatorname{sign}\left(#\right)"),  # zero at the kink, too
        "sin": Function(np.sin, "cos(x)", r"\sin\left(#\right)"),
        "cos": Function(np.cos, "-sin(x)", r"\cos\left(#\right)"),
        "tan": Function(np.tan, "cos(x)^-2", r"\tan\left(#\right)"),
        "atan": Function(np.arctan, "1/(1 + x^2)", r"\arctan\left(#\right)"),
        "sinh": Function(np.sinh, "cosh(x)", r"\sinh\left(#\right)"),
        "cosh": Function(np.cosh, "sinh(x)", r"\cosh\left(#\right)"),
        "tanh": Function(np.tanh, "cosh(x)^-2", r"\tanh\left(#\right)"),
        "expm1": Function(np.expm1, "exp(x)", r"\left(\exp\left(#\right) - 1\right)"),
        "log1p": Function(np.log1p, "1/(1 + x)", r"\ln\left(1 + #\right)"),
    }
)
