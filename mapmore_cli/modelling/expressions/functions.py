"""The functions of one argument that expressions may call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np


@dataclass(frozen=True)
class Function:
    """A function of one argument: how NumPy computes it, and its LaTeX with `#` for the argument."""

    compute: np.ufunc
    latex: str


FUNCTIONS: Mapping[str, Function] = MappingProxyType(
    {
        "exp": Function(np.exp, r"\exp\left(#\right)"),
        "log": Function(np.log, r"\ln\left(#\right)"),
        "sqrt": Function(np.sqrt, r"\sqrt{#}"),
        "abs": Function(np.abs, r"\left|#\right|"),
        "sign": Function(np.sign, r"\operatorname{sign}\left(#\right)"),
        "sin": Function(np.sin, r"\sin\left(#\right)"),
        "cos": Function(np.cos, r"\cos\left(#\right)"),
        "tan": Function(np.tan, r"\tan\left(#\right)"),
        "atan": Function(np.arctan, r"\arctan\left(#\right)"),
        "sinh": Function(np.sinh, r"\sinh\left(#\right)"),
        "cosh": Function(np.cosh, r"\cosh\left(#\right)"),
        "tanh": Function(np.tanh, r"\tanh\left(#\right)"),
        "expm1": Function(np.expm1, r"\left(\exp\left(#\right) - 1\right)"),
        "log1p": Function(np.log1p, r"\ln\left(1 + #\right)"),
    }
)
