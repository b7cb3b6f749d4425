"""A model as a Python module: of NumPy for whole arrays, or of nothing but Python for one sample at
a time.

The second is the first with the few functions of NumPy that the model uses written out. It is for
controllers and simulators that call Python sample by sample (SOFA, PyElastica, callbacks of
MuJoCo); for whole arrays NumPy is many times faster.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence

from mapmore_cli.annexes.exporting.dialect import NUMPY, SCALAR, Expressions, Statements
from mapmore_cli.annexes.exporting.templates import (
    PYTHON,
    Code,
    Wanted,
    code,
    identifier,
    lines_of_code,
    names_of_inputs,
    notes_of,
    rendered_template,
    word,
)
from mapmore_cli.annexes.exporting.verifying import verify_module
from mapmore_cli.domain.foreign import docstring, identifiers
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.kinds import OUTSIDE_TOLERANCE
from mapmore_cli.modelling.program.model import program_of, with_slopes
from mapmore_cli.modelling.program.statements import Block, Choose, Let, Limit
from mapmore_cli.modelling.program.values import INPUT


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
    # NumPy would import it for Python's own
    stem = f"model_{name}" if name in sys.stdlib_module_names else name
    functions = [function.name for function in program.functions]
    names = names_of_inputs(model.inputs, functions)
    taken = [*PYTHON, "outside_range", "derivatives", "reset", "math", *functions]
    statements = PythonStatements(program, dialect, "s.")
    words = {**words_of(model, statements, names, taken), "plain": plain}
    arrays = [
        code("{}{} = np.asarray({}, dtype=float)", INPUT, name, own) for name, own in names.items()
    ]
    finite = [code("np.isfinite({}{})", INPUT, name) for name in names]
    words |= {"arrays": arrays, "finite": Code(" & ".join(finite) or "np.True_")}
    words["functions"] = statements.functions()
    if plain and program.step is None:
        slopes = PythonStatements(with_slopes(program), dialect, "s.")
        words["slope_functions"] = slopes.functions()
        words["slope_lines"], words["slopes"] = slopes.coded(slopes.program.body)
    return f"{stem}.py", rendered_template("module.py", **words)


def words_of(
    model: Model, statements: PythonStatements, names: Mapping[str, str], taken: Sequence[str]
) -> dict[str, object]:
    """Return what the templates of a module or a function know; `names` are those of the inputs in
    code, `taken` those that the output must not have.
    """
    program = statements.program
    lines, result = statements.coded(program.body)
    range_lines, checks = statements.checks()
    return {
        "model": model,
        "names": names,
        "notes": notes_of(model, names),
        "tolerance": OUTSIDE_TOLERANCE,
        "output": word(identifiers([model.output.name], taken)[0]),
        "kept": program.kept,
        "step": program.step,
        "memory": program.step is not None,
        "lines": lines,
        "result": result,
        "range_lines": range_lines,
        "checks": checks,
    }


class PythonStatements(Statements):
    """Writes statements in Python; all cases of a choice are worked out for all rows."""

    end = ""
    beyond, between, nowhere = "_beyond", "np.interp", "np.False_"

    def coded(self, block: Block) -> tuple[list[Code], list[Code]]:
        """Return the lines of a block and its results."""
        lines, results = self.block(block, self.expressions())
        return lines_of_code(lines), lines_of_code(results)

    def functions(self) -> list[tuple[str, tuple[str, ...], list[Code]]]:
        """Return name, parameters and lines of every function."""
        found = []
        for function in self.program.functions:
            lines, results = self.block(function.body, self.expressions())
            note = (
                docstring(f"{function.note[:1].upper()}{function.note[1:]}.")
                if function.note
                else []
            )
            lines = [*note, *lines, f"return {', '.join(results)}"]
            found.append((function.name, function.parameters, lines_of_code(lines)))
        return found

    def checks(self) -> tuple[list[Code], Code]:
        """Return whether each limit is exceeded, and the lines before; limits are of inputs, or of
        expressions of them.
        """
        expressions = self.expressions()
        self.write(
            [
                one
                for one in self.program.body.statements
                if isinstance(one, Let) and one.name.startswith("input_")
            ],
            expressions,
        )
        checks = [
            f"{self.beyond}({self._limit(limit, expressions)})" for limit in self.program.limits
        ]
        return lines_of_code(expressions.lines), Code(" | ".join(checks) or self.nowhere)

    def _limit(self, limit: Limit, expressions: Expressions) -> str:
        value = expressions.text(limit.value)
        if limit.at is None or len(limit.levels) == 1:
            return f"{value}, {float(limit.low[0])!r}, {float(limit.high[0])!r}"
        at = expressions.text(limit.at)
        ends = [
            f"{self.between}({at}, {limit.levels.tolist()}, {values.tolist()})"
            for values in (limit.low, limit.high)
        ]
        return f"{value}, {', '.join(ends)}"

    def _used(self, names: Sequence[str], function: str, arguments: Sequence[str]) -> list[str]:
        return [f"{', '.join(names)} = {function}({', '.join(arguments)})"]

    def _chosen(self, choice: Choose, expressions: Expressions) -> None:
        conditions = [expressions.condition(condition) for condition, _ in choice.cases]
        results = [
            self.block(block, expressions.inner(own_lines=False))[1] for block in choice.blocks
        ]
        for i, name in enumerate(choice.names):
            text = results[-1][i]
            for condition, values in reversed(list(zip(conditions, results, strict=False))):
                text = f"np.where({condition}, {values[i]}, {text})"
            expressions.lines.append(f"{name} = {text}")

    def _recalled(self, queue: str, steps: int) -> str:
        return f"s.{queue}[-{steps}]"

    def _queued(self, queue: str, text: str, size: int) -> list[str]:  # noqa: ARG002
        return [f"{queue} = [*{queue}[1:], {text}]"]
