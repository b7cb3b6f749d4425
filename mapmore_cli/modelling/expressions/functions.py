"""Define the functions of one argument that expressions and recursions may call.

One row of the table `FUNCTIONS` defines everything about a function: how NumPy computes it, its
derivative, and its text in every language to which models are exported. All other modules treat all
functions alike.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

LIBRARY: Mapping[str, str] = {
    "numpy": "np.{}",
    "python": "np._safe(math.{}, x)",
    "c": "{}",
    "matlab": "{}",
    "javascript": "Math.{}",
    "latex": r"\{}\left(#\right)",
    "mathml": "<mi>{}</mi><mrow><mo>(</mo>#<mo>)</mo></mrow>",
}
"""For each language, the pattern that turns a function's usual name into its name in the language's
library.

The text of code is a name in the library, or an expression of one number `x`. `np._safe` belongs to
the exported code: it returns infinity or NaN if Python would raise an error. In markup, `#` stands
for the argument.
"""

NAME = re.compile(r"[\w.]+")
HELPER = "{}_of"


class ScalarFunction(NamedTuple):
    """A function of one argument.

    - `compute`: function that computes the values for columns or for one number; for NaN, it must
      return NaN.
    - `slope`: derivative with respect to x, as the text of an expression.
    - `texts`: for each language of `LIBRARY`, the name of the function in the language's library,
      or an expression of x that computes the function.
    """

    compute: Callable[[Any], Any]
    slope: str
    texts: Mapping[str, str]

    def is_in_library(self, language: str) -> bool:
        """Return True if the library of the language has the function. Otherwise, exported code
        must define the function, under a name such as `log_of`.
        """
        return NAME.fullmatch(self.texts[language]) is not None


def function(
    name: str, compute: Callable[[Any], Any], slope: str, **texts: str
) -> tuple[str, ScalarFunction]:
    """Return a row of `FUNCTIONS`. `texts` is needed only for languages whose library gives the
    function another name, or does not have the function.
    """
    if unknown := texts.keys() - LIBRARY.keys():
        raise ValueError(
            f"function `{name}`: models are not exported to {', '.join(unknown)}, "
            f"only to {', '.join(LIBRARY)}; correct the name of the language"
        )
    usual = {language: text.format(name) for language, text in LIBRARY.items()}
    return name, ScalarFunction(compute, slope, usual | texts)


FUNCTIONS: Mapping[str, ScalarFunction] = dict(
    (
        function("exp", np.exp, "exp(x)"),
        function(
            "log",
            np.log,
            "1/x",
            python="-math.inf if x == 0 else np._safe(math.log, x)",
            matlab="log(abs(x)) + 0 / (x >= 0)",  # MATLAB's `log` is complex for negative numbers
            latex=r"\ln\left(#\right)",
        ),
        function(
            "sqrt",
            np.sqrt,
            "0.5/sqrt(x)",
            matlab="sqrt(abs(x)) + 0 / (x >= 0)",
            latex=r"\sqrt{#}",
            mathml="<msqrt>#</msqrt>",
        ),
        function(
            "abs",
            np.abs,
            "sign(x)",
            python="abs(x)",
            c="fabs",
            latex=r"\left|#\right|",
            mathml="<mo>|</mo>#<mo>|</mo>",
        ),
        function(
            "sign",
            np.sign,
            "0",  # the derivative at the jump is defined as zero
            python="(x > 0) - (x < 0) if x == x else x",
            c="x != x ? x : (x > 0) - (x < 0)",
            latex=r"\operatorname{sign}\left(#\right)",
        ),
        function("sin", np.sin, "cos(x)"),
        function("cos", np.cos, "-sin(x)"),
        function("tan", np.tan, "cos(x)^-2"),
        function(
            "atan",
            np.arctan,
            "1/(1 + x^2)",
            numpy="np.arctan",
            latex=r"\arctan\left(#\right)",
        ),
        function(
            "sinh",
            np.sinh,
            "cosh(x)",
            python="math.copysign(np._safe(math.sinh, abs(x)), x)",
        ),
        function("cosh", np.cosh, "sinh(x)"),
        function("tanh", np.tanh, "cosh(x)^-2"),
        function(
            "expm1",
            np.expm1,
            "exp(x)",
            latex=r"\left(\exp\left(#\right) - 1\right)",
        ),
        function(
            "log1p",
            np.log1p,
            "1/(1 + x)",
            python="-math.inf if x == -1 else np._safe(math.log1p, x)",
            matlab="log1p(max(x, -1)) + 0 / (x >= -1)",
            latex=r"\ln\left(1 + #\right)",
        ),
    )
)
"""Functions by name. To add a function, add a row."""
