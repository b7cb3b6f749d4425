"""Write a model as one function file of MATLAB, which Octave runs too. Inputs are numbers or
columns, the output is a column.
"""

from __future__ import annotations

import shutil

from mapmore_cli.annexes.exporting.dialect import MATLAB
from mapmore_cli.annexes.exporting.python_module import words_of_module
from mapmore_cli.annexes.exporting.templates import (
    OWN,
    Code,
    Wanted,
    identifier,
    names_in_matlab,
    rendered_template,
    word,
)
from mapmore_cli.annexes.exporting.verifying import CompilerMissing, verify_files
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.kinds import fed_back
from mapmore_cli.modelling.programs import program_of


def matlab_file(model: Model, wanted: Wanted) -> dict[str, str]:
    """Return the function file. If Octave is installed, compare its results with `predict`."""
    name, text = matlab_function(model)
    if wanted.verify:
        try:
            _verify(model, name, text)
        except CompilerMissing as reason:
            wanted.warn(f"{reason}: the function was not compared with `mapmore predict`")
    return {f"{name}.m": text}


def matlab_function(model: Model) -> tuple[Code, str]:
    """Return the name and the text of the function. Raises the same errors as
    `c_source.c_source`.
    """
    name, functions = identifier(model.name), program_of(model).functions
    used = [*OWN, *(function.name for function in functions), name]
    names = names_in_matlab(model.inputs, used)
    words = words_of_module(model, MATLAB, names)
    return name, rendered_template("function.m", **words, name=name, fed_back=fed_back(model))


def _verify(model: Model, name: str, text: str) -> None:
    """Compare the function with `predict` in Octave. Raises CompilerMissing if Octave is not
    installed.
    """
    octave = next(filter(None, map(shutil.which, ("octave-cli", "octave"))), None)
    if octave is None:
        raise CompilerMissing("Octave is not installed")
    count = len(model.inputs)
    driver = rendered_template("verify.m", name=word(name), count=count + len(fed_back(model)))
    files = {f"{name}.m": text, "verify_model.m": driver}
    call = [octave, "--norc", "--quiet", "--no-gui", "--no-history", "verify_model.m"]
    verify_files(model, files, call)
