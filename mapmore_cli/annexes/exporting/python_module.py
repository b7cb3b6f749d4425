"""A model as a Python module: of NumPy for whole arrays, or of nothing but Python for one sample at
a time.

The second is the first with the few functions of NumPy that the model uses written out. It is for
controllers and simulators that call Python sample by sample (SOFA, PyElastica, callbacks of
MuJoCo); for whole arrays NumPy is many times faster.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mapmore_cli.annexes.exporting.dialect import NUMPY, SCALAR, Dialect, program_words
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
    """Return a module of NumPy or of `plain` Python, compared with `predict`."""
    name, text = python_module(model, plain)
    if wanted.verify:
        verify_module(model, text, each=plain)
    return {name: text}


def python_module(model: Model, plain: bool = False) -> tuple[str, str]:
    """Return name and text of the module, of NumPy or of `plain` Python.

    It has `evaluate` of all inputs, with memory `State` and `step` of a state and the inputs, and
    `outside_range`. Plain ones have the same by the name of the output as well, without memory
    `derivatives`, and `reset`, which makes a new state.

    Raises UsageError where the model's name has nothing that a module may be called; DataError
    where a part of the model is no closed expression.
    """
    name, program, dialect = identifier(model.name), program_of(model), SCALAR if plain else NUMPY
    functions = [function.name for function in program.functions]
    words = words_of_module(model, dialect, names_of_inputs(model.inputs, functions))
    if plain and program.step is None:
        words["slopes"] = program_words(with_slopes(program), dialect)
        words["helpers"] |= words["slopes"]["helpers"]
    return f"{name}.py", rendered_template("module.py", **words, plain=plain)


def words_of_module(model: Model, dialect: Dialect, names: Mapping[str, str]) -> dict[str, Any]:
    """Return what the templates of a module or a function know; `names` are those of the inputs in
    code.
    """
    return {
        **program_words(program_of(model), dialect),
        "model": model,
        "names": names,
        "notes": notes_of(model, names),
        "tolerance": OUTSIDE_TOLERANCE,
        "output": name_of_output(model, names.values()),
    }
