"""A model as one function file of MATLAB, which Octave runs too: numbers or columns in, a column
out.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace

from mapmore_cli.annexes.exporting.dialect import C_FUNCTIONS, NUMPY, Expressions, indented
from mapmore_cli.annexes.exporting.python_module import PythonStatements, words_of
from mapmore_cli.annexes.exporting.templates import (
    Code,
    Wanted,
    identifier,
    lines_of_code,
    names_of_inputs,
    rendered_template,
    word,
)
from mapmore_cli.annexes.exporting.verifying import CompilerMissing, verify_files
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.kinds import fed_back
from mapmore_cli.modelling.program.model import program_of
from mapmore_cli.modelling.program.statements import Choose, Function

MATLAB = replace(
    NUMPY,
    functions={**{name: name for name in C_FUNCTIONS}, "pow": "power"},
    constant=lambda name, text: f"{name} = {text};",
    nothing="NaN",
)

TAKEN = (
    "end function otherwise catch persistent elseif parfor spmd classdef outside measured s x n j "
    "k given largest shape value one_sample outside_range beyond interpolated begun max min abs "
    "size numel ones false cellfun isnan isempty"
)
"""Words of MATLAB, and names within the function."""


def matlab_file(model: Model, wanted: Wanted) -> dict[str, str]:
    """Return the function file, compared with `predict` where Octave is."""
    name, text = matlab_function(model)
    if wanted.verify:
        try:
            _verify(model, name, text)
        except CompilerMissing as reason:
            wanted.warn(f"{reason}: the function was not compared with `mapmore predict`")
    return {f"{name}.m": text}


def matlab_function(model: Model) -> tuple[Code, str]:
    """Return name and text of the function; raises as `c_source.c_source`."""
    program, name = program_of(model), identifier(model.name)
    taken = [*TAKEN.split(), *(function.name for function in program.functions), name]
    names = {
        one: own if own[0].isalpha() else f"u{own}"  # no name begins with `_`
        for one, own in names_of_inputs(model.inputs, taken).items()
    }
    statements = MatlabStatements(program, MATLAB, "s.")
    words = words_of(model, statements, names, [*taken, *names.values()])
    words["functions"] = [statements.function(one) for one in program.functions]
    return name, rendered_template("function.m", **words, name=name, fed_back=fed_back(model))


class MatlabStatements(PythonStatements):
    """Writes statements in MATLAB, of one sample: of a choice, one side is computed."""

    end = ";"
    beyond, between, nowhere = "beyond", "interpolated", "false"

    def function(self, function: Function) -> list[Code]:
        """Return a local function."""
        lines, results = self.block(function.body, self.expressions())
        names = [f"result{number}" for number in range(1, len(results) + 1)]
        ends = [f"{own} = {text};" for own, text in zip(names, results, strict=True)]
        head = f"function [{', '.join(names)}] = {function.name}({', '.join(function.parameters)})"
        return lines_of_code([head, *indented([*lines, *ends]), "end"])

    def _used(self, names: Sequence[str], function: str, arguments: Sequence[str]) -> list[str]:
        return [f"[{', '.join(names)}] = {function}({', '.join(arguments)});"]

    def _chosen(self, choice: Choose, expressions: Expressions) -> None:
        words = ("else", "else", "end")
        expressions.lines.extend(self.branches(choice, expressions, "if {}".format, words))

    def _recalled(self, queue: str, steps: int) -> str:
        return f"s.{queue}(end - {steps - 1})"

    def _queued(self, queue: str, text: str, size: int) -> list[str]:  # noqa: ARG002
        return [f"{queue} = [{queue}(2:end), {text}];"]


def _verify(model: Model, name: str, text: str) -> None:
    """Compare the function by Octave; raises CompilerMissing where there is none."""
    octave = next(filter(None, map(shutil.which, ("octave-cli", "octave"))), None)
    if octave is None:
        raise CompilerMissing("there is no Octave here")
    count = len(model.inputs)
    driver = rendered_template("verify.m", name=word(name), count=count + len(fed_back(model)))
    files = {f"{name}.m": text, "verify_model.m": driver}
    call = [octave, "--norc", "--quiet", "--no-gui", "--no-history", "verify_model.m"]
    verify_files(model, files, lambda _folder: call)
