"""Write the statements and expressions of a program in one of the dialects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from itertools import count
from typing import Any

from mapmore_cli.annexes.exporting.dialect import Dialect
from mapmore_cli.annexes.exporting.templates import Code, word
from mapmore_cli.modelling.expressions.syntax import (
    Call,
    Condition,
    Expression,
    Name,
    Number,
    Power,
    Product,
    Sum,
)
from mapmore_cli.modelling.program.statements import (
    NOTHING,
    Block,
    Choose,
    Function,
    Let,
    Program,
    Queue,
    Recall,
    Statement,
    Store,
    Use,
)
from mapmore_cli.modelling.program.values import COMPARE
from mapmore_cli.modelling.program.writing import names_used_in


def program_words(program: Program, dialect: Dialect, apart: bool = True) -> dict[str, Any]:
    """Return the variables of the templates that describe a program: its `functions`, `lines` and
    `results`, and the `limits` of its inputs. With `apart`, the limits are computed in a separate
    function.

    Raises DataError if a name of the program is no identifier.
    """
    kept = program.kept
    limits = [(limit.value, limit.at) for limit in program.limits]
    parts = program.functions, program.body, tuple(limits), kept.numbers, kept.queues
    for text in {*texts_of(parts)} - {*COMPARE}:
        word(text)
    body = ranges = FunctionBody(program, dialect)
    results = body.block(program.body)
    if apart:
        ranges = FunctionBody(program, dialect)
        inputs = [statement for statement in program.body.statements if isinstance(statement, Let)]
        ranges.write([quantity for quantity in inputs if quantity.name.startswith("input_")])
    checks = [
        {
            "inputs": limit.inputs,
            "value": ranges.text(limit.value),
            "at": limit.at is not None and len(limit.levels) > 1 and ranges.text(limit.at),
            **{
                name: [dialect.number(end) for end in getattr(limit, name).tolist()]
                for name in ("levels", "low", "high")
            },
        }
        for limit in program.limits
    ]
    functions = [_function(program, dialect, function) for function in program.functions]
    lines = [
        *body.lines,
        *ranges.lines,
        *(line for function in functions for line in function["lines"]),
    ]
    return {
        "functions": functions,
        "helpers": dialect.helpers(*lines),
        "power": any("power_of(" in line for line in lines),
        "lines": body.lines,
        "results": results,
        "range_lines": ranges.lines if apart else [],
        "limits": checks,
        "kept": kept,
        "step": program.step,
        "memory": program.step is not None,
    }


def _function(program: Program, dialect: Dialect, function: Function) -> dict[str, Any]:
    body = FunctionBody(program, dialect)
    used = names_used_in(function.body)
    return {
        "name": function.name,
        "note": function.note,
        "parameters": function.parameters,
        "unused": [name for name in function.parameters if name not in used],
        "results": body.block(function.body),
        "lines": body.lines,
    }


def texts_of(part: object) -> Iterator[str]:
    """Yield every text within a part of a program, except two kinds of text: notes, and the names
    of functions in expressions (such as `exp`), because mapmore itself defines these names.
    """
    if isinstance(part, str):
        yield part
    elif isinstance(part, Expression):
        yield from part.names
    elif isinstance(part, tuple | Mapping):
        for element in part:
            yield from texts_of(element)
    elif is_dataclass(part):
        for field in fields(part):
            yield from texts_of(getattr(part, field.name)) if field.name != "note" else ()


@dataclass
class FunctionBody:
    """The body of a function that is being written: its `lines`, and the powers and function values
    that have names, so that they can be used again.

    Everything is computed in the same order as in `expressions.compiled`, so that all languages
    round alike.
    """

    program: Program
    dialect: Dialect
    lines: list[Code] = field(default_factory=list)
    known: dict[Expression, Code] = field(default_factory=dict)
    numbers: Iterator[int] = field(default_factory=lambda: count(1))

    def _line(self, form: str, *parts: str, **named: object) -> None:
        self.lines.append(Code(form.format(*parts, **named)))

    def block(self, block: Block) -> list[Code]:
        """Write the statements of a block, and return its results."""
        self.write(block.statements)
        return [self.text(result) for result in block.results]

    def write(self, statements: Sequence[Statement]) -> None:
        """Write statements, and append them to the lines of the body."""
        dialect, sizes = self.dialect, self.program.kept.queues
        for statement in statements:
            match statement:
                case Let(name, value):
                    self._line(dialect.constant, name, self.text(value))
                case Use(names, function, arguments):
                    self._use(names, function, ", ".join(map(self.text, arguments)))
                case Choose():
                    self._choose(statement)
                case Recall(name, queue, steps):
                    size = sizes[queue]
                    words = {"queue": queue, "steps": steps, "left": size - steps, "size": size}
                    self._line(dialect.constant, name, dialect.recalled.format(**words))
                case Store(kept, value):
                    self._line(dialect.assigned, f"{dialect.state}{kept}", self.text(value))
                case Queue(queue, value):
                    text = self.text(value)
                    for form in dialect.queued:
                        self._line(form, queue=queue, value=text, size=sizes[queue])

    def _use(self, names: Sequence[str], function: str, arguments: str) -> None:
        if len(names) == 1:
            self._line(self.dialect.constant, names[0], f"{function}({arguments})")
            return
        places = ", ".join(f"&{name}" for name in names)
        words = {"function": function, "arguments": arguments, "places": places}
        for form in self.dialect.several:
            self._line(form, names=", ".join(names), **words)

    def _choose(self, choice: Choose) -> None:
        dialect, names = self.dialect, choice.names
        conditions = [self._condition(condition) for condition, _ in choice.cases]
        # a block can use the names of this body, but its own names are valid only within the block
        sides = [
            replace(self, lines=[] if dialect.branches else self.lines, known=dict(self.known))
            for _ in choice.blocks
        ]
        results = [side.block(block) for side, block in zip(sides, choice.blocks, strict=True)]
        if not dialect.branches:
            for i, name in enumerate(names):
                text: str = results[-1][i]
                for condition, values in reversed(list(zip(conditions, results, strict=False))):
                    text = f"np.where({condition}, {values[i]}, {text})"
                self._line(dialect.constant, name, text)
        elif dialect.short and len(names) == 1 and not any(side.lines for side in sides):
            cases = zip(conditions, results, strict=False)
            text = "".join(f"{condition} ? {value} : " for condition, (value,) in cases)
            self._line(dialect.constant, names[0], text + results[-1][0])
        else:
            first, other, otherwise, end = dialect.branches
            heads = [
                (first if i == 0 else other).format(condition)
                for i, condition in enumerate(conditions)
            ]
            if dialect.short:  # names are declared
                self._line(dialect.several[0], names=", ".join(names))
            for head, side, values in zip([*heads, otherwise], sides, results, strict=True):
                for name, value in zip(names, values, strict=True):
                    side._line(dialect.assigned, name, value)
                self.lines += [Code(head), *(Code(f"    {line}") for line in side.lines)]
            self.lines.append(Code(end))

    def _condition(self, condition: Condition) -> str:
        return f"{self.text(condition.left)} {condition.comparison} {self.text(condition.right)}"

    def text(self, expression: Expression) -> Code:
        """Return an expression as text in the language of the dialect."""
        match expression:
            case Sum((first, *others)):
                text: str = self.text(first)
                for term in others:
                    written = self.text(term)
                    text += f" - {written[1:]}" if written.startswith("-") else f" + {written}"
                return Code(text)
            case Product((first, *others)):
                text = "-" if first == Number(-1.0) else self._atom(first, front=True)
                for factor in others:
                    if isinstance(factor, Power) and factor.exponent < 0:
                        text = self.dialect.quotient.format(
                            "-1.0" if text == "-" else text,
                            self._power(factor.base, -factor.exponent),
                        )
                    else:
                        text += ("" if text == "-" else " * ") + self._atom(factor)
                return Code(text)
        return self._atom(expression, front=True)

    def _atom(self, expression: Expression, front: bool = False) -> Code:
        """Return the text of an expression as a factor of a product, in brackets if necessary."""
        match expression:
            case Number(value):
                number = self.dialect.number(value)
                return number if front or not number.startswith("-") else Code(f"({number})")
            case Name(name):
                if expression == NOTHING:
                    return Code(self.dialect.nothing)
                return Code(self.dialect.state * (name in self.program.kept.numbers) + name)
            case Power() | Call():
                if expression not in self.known:
                    stem, text = self._computed(expression)
                    name = f"{stem}{next(self.numbers)}"
                    self._line(self.dialect.constant, name, text)
                    self.known[expression] = Code(name)
                return self.known[expression]
        return Code(f"({self.text(expression)})")

    def _computed(self, expression: Power | Call) -> tuple[str, str]:
        dialect, number = self.dialect, self.dialect.number
        match expression:
            case Call(function, argument):
                return function, f"{dialect.function(function)}({self.text(argument)})"
            case Power(base, exponent) if exponent < 0:
                divisor = self._power(base, -exponent)
                return "inverse", dialect.quotient.format(number(1.0), divisor)
            case Power(base, exponent) if exponent.is_integer():
                half = exponent // 2
                return "power", f"{self._power(base, half)} * {self._power(base, exponent - half)}"
            case Power(base, exponent):
                return "power", dialect.power.format(self.text(base), number(exponent))

    def _power(self, base: Expression, exponent: float) -> Code:
        return self._atom(base if exponent == 1.0 else Power(base, exponent))
