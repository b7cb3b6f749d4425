"""Write a model as a Python module: with NumPy for whole arrays, or in plain Python for one sample
at a time.

The second form differs from the first in that the few NumPy functions that the model uses are
written out in plain Python. The second form is for controllers and simulators that call Python
sample by sample (SOFA, PyElastica, callbacks of MuJoCo). For whole arrays, NumPy is many times
faster.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mapmore_cli.annexes.exporting.dialect import NUMPY, SCALAR, Dialect
from mapmore_cli.annexes.exporting.program_text import program_words
from mapmore_cli.annexes.exporting.templates import (
    Wanted,
    identifier,
    name_of_output,
    names_of_inputs,
    notes_of,
    rendered_template,
)
from mapmore_cli.annexes.exporting.verifying import verify_module
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.program.slopes import with_slopes
from mapmore_cli.modelling.programs import program_of
from mapmore_cli.modelling.ranges import OUTSIDE_TOLERANCE


def module_file(model: Model, wanted: Wanted, plain: bool = False) -> dict[str, str]:
    """Return a module with NumPy, or in `plain` Python, after comparing it with `predict`."""
    name, text = python_module(model, plain)
    if wanted.verify:
        verify_module(model, text, each=plain)
    return {name: text}


def python_module(model: Model, plain: bool) -> tuple[str, str]:
    """Return name and text of a module that uses NumPy, or of a module in `plain` Python.

    For a model without memory, the module has the function `evaluate` of all inputs. For a model
    with memory, it has the class `State` and the function `step` of a state and the inputs. Every
    module has `outside_range`. A plain module has three more functions: `evaluate` or `step` under
    the name of the output, `reset`, which makes a new state, and `derivatives` for a model without
    memory.

    Raises UsageError if the model's name has no character that a module name may have; DataError if
    a part of the model has no closed expression.
    """
    name, program, dialect = identifier(model.name), program_of(model), SCALAR if plain else NUMPY
    functions = [function.name for function in program.functions]
    words = words_of_module(model, dialect, names_of_inputs(model.inputs, functions))
    if plain and program.step is None:
        words["slopes"] = program_words(with_slopes(program), dialect)
        words["helpers"] |= words["slopes"]["helpers"]
    return f"{name}.py", rendered_template("module.py", **words, plain=plain)


def words_of_module(model: Model, dialect: Dialect, names: Mapping[str, str]) -> dict[str, Any]:
    """Return the variables of the templates of a module or a function; `names` are the names of the
    inputs in code.
    """
    return {
        **program_words(program_of(model), dialect),
        "model": model,
        "names": names,
        "notes": notes_of(model, names),
        "tolerance": OUTSIDE_TOLERANCE,
        "output": name_of_output(model, names.values()),
    }
