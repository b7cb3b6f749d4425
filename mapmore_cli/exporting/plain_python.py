"""A model as one Python file that needs nothing: the module of NumPy with the few functions of it that the model uses written out.

For controllers and simulators that call Python sample by sample (SOFA, PyElastica, callbacks of MuJoCo); for whole arrays the module of
NumPy is many times faster.
"""

from __future__ import annotations

import sys

from mapmore_cli.domain.foreign import docstring
from mapmore_cli.domain.models import Model
from mapmore_cli.exporting.c_blocks import indented
from mapmore_cli.exporting.dialect import SCALAR, identifier
from mapmore_cli.exporting.numpy_module import Module
from mapmore_cli.modelling.program.model import program_of, with_slopes

FUNCTIONS = '''\
class np:
    """The functions of NumPy that the model uses, of single numbers; where Python would raise, infinite or not a number."""

    nan, True_, False_ = math.nan, True, False
    abs, isfinite, maximum, asarray = abs, math.isfinite, max, lambda x, dtype: float(x)

    class errstate:
        def __init__(self, all):
            pass

        def __enter__(self):
            pass

        def __exit__(self, *_):
            pass

    def where(condition, yes, no):
        return yes if condition else no

    def divide(a, b):
        return a / b if b else math.nan if a == 0 or a != a else math.copysign(math.inf, a) * math.copysign(1.0, b)

    def sign(x):
        return (x > 0) - (x < 0) if x == x else x

    def interp(x, places, values):
        if not x > places[0]:
            return values[0]
        for i in range(1, len(places)):
            if x < places[i]:
                return values[i - 1] + (values[i] - values[i - 1]) / (places[i] - places[i - 1]) * (x - places[i - 1])
        return values[-1]

    def power(x, n):
        return np._safe(math.pow, x, n)

    def _safe(function, *numbers):
        try:
            return function(*numbers)
        except OverflowError:
            return math.inf
        except ValueError:
            return math.nan

    def exp(x):
        return np._safe(math.exp, x)

    def expm1(x):
        return np._safe(math.expm1, x)

    def log(x):
        return -math.inf if x == 0 else np._safe(math.log, x)

    def log1p(x):
        return -math.inf if x == -1 else np._safe(math.log1p, x)

    def sqrt(x):
        return np._safe(math.sqrt, x)

    def sin(x):
        return np._safe(math.sin, x)

    def cos(x):
        return np._safe(math.cos, x)

    def tan(x):
        return np._safe(math.tan, x)

    def arctan(x):
        return math.atan(x)

    def sinh(x):
        return np._safe(math.sinh, x) if x > -700 else -np._safe(math.sinh, -x)

    def cosh(x):
        return np._safe(math.cosh, x)

    def tanh(x):
        return math.tanh(x)
'''


def plain_module(model: Model) -> tuple[str, str]:
    """Name and text of the file.

    It has `evaluate(inputs)` (with memory: `State` and `step(state, inputs)`), the same by the name of the output, `outside_range`, for
    a model without memory `derivatives`, and `reset`, which makes a new state. Raises as `numpy_module`.
    """
    name = identifier(model.name)
    stem = f"model_{name}" if name in sys.stdlib_module_names else name
    code = program_of(model)
    written = Module(model, code, SCALAR)
    parts = [written.text("import math", "It needs nothing but Python.", [FUNCTIONS]), *_callers(written, model)]
    if code.step is None:
        parts.append(Module(model, with_slopes(code), SCALAR).derivatives())
    return f"{stem}.py", "\n\n".join(parts)


def _callers(written: Module, model: Model) -> list[str]:
    """Return the model by the name of its output, `force(pressure, strain, state=None)`; and `reset`."""
    names = ", ".join(written.names.values())
    given = f"{names}, " if names else ""
    memory = written.code.step is not None
    call = f"step(state, {names})" if memory else f"evaluate({names})"
    about = docstring(
        f"{model.output.name} [{model.output.unit}]; `state` comes from `reset`" + ("." if memory else ", and may be left out.")
    )
    head = f"def {written.output}({given}state):" if memory else f"def {written.output}({given}state=None):"
    fresh = ["def reset():", *indented(['"""A new state: the model begins anew."""', "return State()" if memory else "return None"]), ""]
    return ["\n".join([head, *indented([*about, f"return {call}"]), ""]), "\n".join(fresh)]
