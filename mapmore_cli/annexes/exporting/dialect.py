"""Define how C, Python, MATLAB and JavaScript differ as languages of exported programs."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

from mapmore_cli.annexes.exporting.templates import Code, code
from mapmore_cli.modelling.expressions.functions import FUNCTIONS, HELPER


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """Differences between the languages of exports.

    - `number`: function that writes a finite number.
    - `language`: language in which functions of expressions are written (`expressions.functions`);
      `library`: pattern for the name of a function of the language's library; `power`: pattern of a
      power with any exponent.
    - `constant`: line that gives a name to a value, which then never changes.
    - `nothing`: text of a missing value (NaN).
    - `quotient`: pattern of a quotient of dividend and divisor.
    - `assigned`: line that assigns a value to a name; `state`: prefix of a name that is kept in the
      state `s`.
    - `recalled`: text of the value that was appended to a queue `steps` samples ago; this value
      stands `left` places after the oldest value. `queued`: lines that append a value to a queue.
    - `several`: lines that call a function with several results, and assign its results to names.
    - `branches`: lines that begin the first case of a choice, a further case and the remaining
      case, and the line that ends the choice. If there are none, all cases of a choice are computed
      for all rows.
    - `short`: True if a choice of one value may be written `condition ? value : other`.
    """

    number: Callable[[float], Code]
    language: str
    library: str = "{}"
    power: str
    constant: str
    nothing: str
    quotient: str = "{} / {}"
    assigned: str
    state: str
    recalled: str
    queued: tuple[str, ...]
    several: tuple[str, ...]
    branches: tuple[str, ...] = ()
    short: bool = False

    def function(self, name: str) -> str:
        """Return the name with which exported code calls a function of expressions. This is its
        name in the library of the language. If the library lacks the function, it is the name of a
        helper function, which the export writes.
        """
        entry = FUNCTIONS[name]
        if entry.is_in_library(self.language):
            return self.library.format(entry.texts[self.language])
        return HELPER.format(name)

    def helpers(self, *lines: str) -> dict[str, Code]:
        """Return helpers for the functions that occur in the lines but not in the library of the
        language: for each name, the expression of x that the export writes as the body of the
        helper.
        """
        called = set(re.findall(r"\w+(?=\()", "\n".join(lines)))
        return {
            helper: Code(entry.texts[self.language])
            for name, entry in FUNCTIONS.items()
            if (helper := HELPER.format(name)) in called and not entry.is_in_library(self.language)
        }


LARGEST, SMALLEST = 3.4028234e38, 1e-37
"""Largest and smallest magnitude of a single-precision number: larger values are limited, and
smaller ones become zero.
"""

DOUBLE = Dialect(
    number=lambda value: Code(repr(float(value))),
    language="c",
    power="pow({}, {})",
    constant="const double {} = {};",
    nothing="NAN",
    assigned="{} = {};",
    state="s->",
    recalled="s->{queue}[(s->{queue}_at + {left}) % {size}]",
    queued=(
        "s->{queue}[s->{queue}_at] = {value};",
        "s->{queue}_at = (s->{queue}_at + 1) % {size};",
    ),
    several=("double {names};", "{function}({arguments}, {places});"),
    branches=("if ({}) {{", "}} else if ({}) {{", "} else {", "}"),
    short=True,
)
SINGLE = replace(
    DOUBLE,
    number=lambda value: code(
        "{!r}f", 0.0 if abs(value) < SMALLEST else min(max(float(value), -LARGEST), LARGEST)
    ),
    library="{}f",
    power="powf({}, {})",
    constant="const float {} = {};",
    several=("float {names};", *DOUBLE.several[1:]),
)
NUMPY = Dialect(
    number=DOUBLE.number,
    language="numpy",
    power="np.power({}, {})",
    constant="{} = {}",
    nothing="np.nan",
    assigned="{} = {}",
    state="s.",
    recalled="s.{queue}[-{steps}]",
    queued=("s.{queue} = [*s.{queue}[1:], {value}]",),
    several=("{names} = {function}({arguments})",),
)
SCALAR = replace(NUMPY, language="python", quotient="np.divide({}, {})")
"""Dialect for single numbers without NumPy, in which Python raises an error for a division by
zero.
"""

MATLAB = Dialect(
    number=DOUBLE.number,
    language="matlab",
    power="power_of({}, {})",
    constant="{} = {};",
    nothing="NaN",
    assigned="{} = {};",
    state="s.",
    recalled="s.{queue}(end + 1 - {steps})",
    queued=("s.{queue} = [s.{queue}(2:end), {value}];",),
    several=("[{names}] = {function}({arguments});",),
    branches=("if {}", "elseif {}", "else", "end"),
)

JAVASCRIPT = replace(
    DOUBLE,
    language="javascript",
    power="Math.pow({}, {})",
    constant="const {} = {};",
    nothing="NaN",
    state="s.",
    recalled="s.{queue}[{left}]",
    queued=("s.{queue}.shift();", "s.{queue}.push({value});"),
    several=("let {names};", "[{names}] = {function}({arguments});"),
)
