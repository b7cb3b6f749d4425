"""A model as a Python module that needs NumPy alone."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.foreign import docstring, identifiers
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.exporting.c_blocks import indented
from mapmore_cli.exporting.dialect import NUMPY, PYTHON, Dialect, Expressions, identifier, names_of_inputs, renamed
from mapmore_cli.modelling.kinds import OUTSIDE_TOLERANCE
from mapmore_cli.modelling.program.model import program_of
from mapmore_cli.modelling.program.statements import Block, Choose, Function, Keep, Let, Limit, Program, Queue, Recall, Statement, Use
from mapmore_cli.modelling.program.values import INPUT

BEYOND = f'''\
def _beyond(x, low, high):
    """Whether x lies beyond a range; what is within {OUTSIDE_TOLERANCE!r} of it counts as inside."""
    margin = {OUTSIDE_TOLERANCE!r} * np.maximum(high - low, np.maximum(np.abs(low), np.abs(high)))
    return (x < low - margin) | (x > high + margin)
'''


def numpy_module(model: Model) -> tuple[str, str]:
    """Name and text of the module.

    Raises
    ------
    UsageError
        Where the model's name has nothing that a module may be called.
    DataError
        Where a part of the model is no closed expression.
    """
    name = identifier(model.name)
    stem = f"model_{name}" if name in sys.stdlib_module_names else name  # NumPy would import it for Python's own
    return f"{stem}.py", Module(model, program_of(model)).text("import numpy as np", "It needs NumPy alone.")


@dataclass
class Module:
    """The text of a module, from the statements of a model."""

    model: Model
    code: Program
    dialect: Dialect = NUMPY
    numbers: Iterator[int] = field(default_factory=lambda: count(1))

    @property
    def names(self) -> dict[str, str]:
        """What each input is called as a parameter."""
        return names_of_inputs(self.model.inputs, [function.name for function in self.code.functions])

    @property
    def output(self) -> str:
        """What the output is called as a function beside those of the module."""
        taken = [*PYTHON, "State", "step", "evaluate", "outside_range", "derivatives", "reset", "math"]
        return identifiers([self.model.output.name], [*taken, *(function.name for function in self.code.functions)])[0]

    def text(self, imports: str, needs: str, helpers: Sequence[str] = ()) -> str:
        """Return the whole module, after the line that it `imports` by; `needs` says what it needs, `helpers` are functions before."""
        parts = [self._head(imports, needs), *helpers, *(self._function(function) for function in self.code.functions)]
        parts += [self._state(), self._step()] if self.code.step is not None else [self._evaluate()]
        return "\n\n".join([*parts, BEYOND + "\n\n" + self._outside()])

    def derivatives(self) -> str:
        """Return a function of the derivative for every input, of a program that has them behind its output."""
        lines, results = self._block(self.code.body, self._expressions())
        about = docstring(f"Derivatives of {self.model.output.name} for {', '.join(self.names)}.")
        slopes = ", ".join(f"np.where(finite, {one}, np.nan)" for one in results[1:])
        body = [*about, *self._given(), *lines, f"return ({slopes},)" if slopes else "return ()"]
        functions = [self._function(function) for function in self.code.functions]
        return "\n\n".join([*functions, "\n".join([f"def derivatives({', '.join(self.names.values())}):", *indented(body), ""])])

    def _head(self, imports: str, needs: str) -> str:
        model = self.model
        given = ", ".join(map(_unit, model.inputs)) or "nothing"
        about = docstring(f"{model.name}: {_unit(model.output)} from {given}. {needs}", *renamed(self.names))
        names = ", ".join(f'"{name}"' for name in self.names.values())
        return "\n".join([*about, "", imports, "", f"INPUTS = ({names},)", f'OUTPUT = "{model.output.name}"', ""])

    def _expressions(self, kept: bool = False) -> Expressions:
        named: Callable[[str], str] = lambda name: f"s.{name}" if kept and name in self.code.kept.numbers else name  # noqa: E731 - short
        return Expressions(self.dialect, named, lambda stem: f"{stem}{next(self.numbers)}")

    def _function(self, function: Function) -> str:
        lines, results = self._block(function.body, self._expressions())
        note = docstring(f"{function.note[:1].upper()}{function.note[1:]}.") if function.note else []
        return "\n".join(
            [f"def {function.name}({', '.join(function.parameters)}):", *indented([*note, *lines, f"return {', '.join(results)}"]), ""]
        )

    def _block(self, block: Block, expressions: Expressions) -> tuple[list[str], list[str]]:
        """Return the lines of a block and its results; all cases of a choice are worked out for all rows."""
        self._statements(block.statements, expressions)
        results = [expressions.text(result) for result in block.results]
        return expressions.lines, results

    def _statements(self, statements: Sequence[Statement], expressions: Expressions) -> None:
        lines = expressions.lines
        for statement in statements:
            match statement:
                case Let(name, value):
                    text = expressions.text(value)
                    lines.append(f"{name} = {text}")
                case Use(names, function, arguments):
                    given = ", ".join([expressions.text(one) for one in arguments])
                    lines.append(f"{', '.join(names)} = {function}({given})")
                case Choose():
                    self._choose(statement, expressions)
                case Recall(name, queue, steps):
                    lines.append(f"{name} = s.{queue}[-{steps}]")
                case Keep(kept, value):
                    lines.append(f"s.{kept} = {expressions.text(value)}")
                case Queue(queue, value):
                    lines.append(f"s.{queue} = [*s.{queue}[1:], {expressions.text(value)}]")

    def _choose(self, choice: Choose, expressions: Expressions) -> None:
        conditions = [expressions.condition(condition) for condition, _ in choice.cases]
        results = []
        for block in (*(block for _, block in choice.cases), choice.otherwise):
            inner = expressions.inner(own_lines=False)
            results.append(self._block(block, inner)[1])
        for i, name in enumerate(choice.names):
            text = results[-1][i]
            for condition, values in reversed(list(zip(conditions, results, strict=False))):
                text = f"np.where({condition}, {values[i]}, {text})"
            expressions.lines.append(f"{name} = {text}")

    def _given(self) -> list[str]:
        finite = " & ".join(f"np.isfinite({INPUT}{name})" for name in self.names) or "np.True_"
        return [*self._arrays(), f"finite = {finite}"]

    def _arrays(self) -> list[str]:
        return [f"{INPUT}{name} = np.asarray({parameter}, dtype=float)" for name, parameter in self.names.items()]

    def _evaluate(self) -> str:
        names = ", ".join(self.names.values())
        lines, results = self._block(self.code.body, self._expressions())
        about = docstring(f"{_unit(self.model.output)} at any number of samples; NaN where an input is not finite.")
        body = [
            *about,
            *self._given(),
            'with np.errstate(all="ignore"):',
            *indented([*lines, f"return np.where(finite, {results[0]}, np.nan)"]),
        ]
        return "\n".join([f"def evaluate({names}):", *indented(body), ""])

    def _state(self) -> str:
        numbers = [f"self.{name} = {value!r}" for name, value in self.code.kept.numbers.items()]
        queues = [f"self.{name} = [0.0] * {size}" for name, size in self.code.kept.queues.items()]
        reset = ["def reset(self):", *indented(['"""Begin anew."""', *numbers, *queues])]
        measured = [
            line
            for output, queues in self.code.kept.fed_back.items()
            for line in (
                "",
                "def measured(self, value):",
                *indented(
                    [*docstring(f"Tell the measured {output} of the last sample."), *(f"self.{queue}[-1] = value" for queue in queues)]
                ),
            )
        ]
        begin = ["def __init__(self):", *indented(["self.reset()"]), ""]
        about = f'"""What the model keeps from sample to sample, {self.code.step!r} s apart."""'
        return "\n".join(["class State:", *indented([about, "", *begin, *reset, *measured]), ""])

    def _step(self) -> str:
        names = ", ".join(self.names.values())
        lines, results = self._block(self.code.body, self._expressions(kept=True))
        about = docstring(f"{_unit(self.model.output)} at the next sample; NaN before there is history, and once a run has diverged.")
        anew = ["if not finite:", *indented(["s.reset()", "return np.nan"])]
        body = [*self._given(), *anew, 'with np.errstate(all="ignore"):', *indented([*lines, f"return float({results[0]})"])]
        return "\n".join([f"def step(s, {names}):", *indented([*about, *body]), ""])

    def _outside(self) -> str:
        """Return a function of the inputs; limits are of inputs, or of expressions of them."""
        expressions = self._expressions()
        statements = [one for one in self.code.body.statements if isinstance(one, Let) and one.name.startswith("input_")]
        self._statements(statements, expressions)
        checks = [f"_beyond({self._limit(limit, expressions)})" for limit in self.code.limits]
        about = '"""Whether an input lies beyond its training range."""'
        body = [about, *self._arrays(), *expressions.lines, "return " + (" | ".join(checks) or "np.False_")]
        return "\n".join([f"def outside_range({', '.join(self.names.values())}):", *indented(body), ""])

    def _limit(self, limit: Limit, expressions: Expressions) -> str:
        value = expressions.text(limit.value)
        if limit.at is None or len(limit.levels) == 1:
            return f"{value}, {float(limit.low[0])!r}, {float(limit.high[0])!r}"
        at = expressions.text(limit.at)
        ends = [f"np.interp({at}, {_list(limit.levels)}, {_list(values)})" for values in (limit.low, limit.high)]
        return f"{value}, {', '.join(ends)}"


def _list(values: Array) -> str:
    return f"[{', '.join(repr(value) for value in values.tolist())}]"


def _unit(quantity: Quantity) -> str:
    return f"{quantity.name} [{quantity.unit}]"
