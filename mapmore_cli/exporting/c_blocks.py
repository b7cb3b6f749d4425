"""Blocks of statements in C."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import count

from mapmore_cli.domain.foreign import c_comment
from mapmore_cli.exporting.dialect import Dialect, Expressions
from mapmore_cli.modelling.program.statements import Block, Choose, Function, Keep, Let, Program, Queue, Recall, Statement, Use
from mapmore_cli.modelling.program.writing import names_in

INDENT = "    "


@dataclass(frozen=True)
class CBlocks:
    """Writes the statements of one model; `real` is the type of its numbers."""

    model: Program
    dialect: Dialect
    real: str
    places: dict[str, str] = field(default_factory=dict)
    """Where results lie that have no name of their own."""

    def function(self, function: Function) -> list[str]:
        """Return a function that no other file sees; several results are written where the last argument points."""
        several = len(function.body.results) > 1
        parameters = [f"{self.real} {name}" for name in function.parameters] + [f"{self.real} *results"] * several
        expressions = self._expressions()
        lines = self._statements(function.body.statements, expressions)
        used = names_in(function.body)
        ignored = [f"(void){name};" for name in function.parameters if name not in used]
        results = [expressions.text(result) for result in function.body.results]
        ends = [f"results[{i}] = {text};" for i, text in enumerate(results)] if several else [f"return {results[0]};"]
        head = f"static {'void' if several else self.real} {function.name}({', '.join(parameters)})"
        note = c_comment(function.note) if function.note else []
        return [*note, head, "{", *indented([*ignored, *lines, *ends]), "}", ""]

    def body(self) -> tuple[list[str], Expressions]:
        """Return the lines of the model's main statements, and how expressions are written after them."""
        expressions = self._expressions()
        return self._statements(self.model.body.statements, expressions), expressions

    def _expressions(self) -> Expressions:
        numbers = count(1)
        return Expressions(self.dialect, self._name, lambda stem: f"{stem}{next(numbers)}")

    def _name(self, name: str) -> str:
        return f"s->{name}" if name in self.model.kept.numbers else self.places.get(name, name)

    def _statements(self, statements: Sequence[Statement], expressions: Expressions) -> list[str]:
        """Return the lines of some statements, which `expressions` goes on with."""
        lines = expressions.lines
        for statement in statements:
            match statement:
                case Let(name, value):
                    text = expressions.text(value)
                    lines.append(self.dialect.constant(name, text))
                case Use(names, function, arguments):
                    lines.extend(self._use(names, function, [expressions.text(one) for one in arguments]))
                case Choose():
                    self._choose(statement, expressions)
                case Recall(name, queue, steps):
                    size = self.model.kept.queues[queue]
                    lines.append(self.dialect.constant(name, f"s->{queue}[(s->{queue}_at + {size - steps}) % {size}]"))
                case Keep(kept, value):
                    lines.append(f"s->{kept} = {expressions.text(value)};")
                case Queue(queue, value):
                    lines.append(f"s->{queue}[s->{queue}_at] = {expressions.text(value)};")
                    lines.append(f"s->{queue}_at = (s->{queue}_at + 1) % {self.model.kept.queues[queue]};")
        return lines

    def _use(self, names: Sequence[str], function: str, arguments: Sequence[str]) -> list[str]:
        if len(names) == 1:
            return [self.dialect.constant(names[0], f"{function}({', '.join(arguments)})")]
        results = f"{names[0]}_all"
        self.places.update({name: f"{results}[{i}]" for i, name in enumerate(names)})
        return [f"{self.real} {results}[{len(names)}];", f"{function}({', '.join([*arguments, results])});"]

    def _choose(self, choice: Choose, expressions: Expressions) -> None:
        conditions = [expressions.condition(condition) for condition, _ in choice.cases]
        blocks = [block for _, block in choice.cases] + [choice.otherwise]
        if len(choice.names) == 1 and not any(block.statements for block in blocks):
            inner = [expressions.inner() for _ in blocks]
            values = [own.text(block.results[0]) for own, block in zip(inner, blocks, strict=True)]
            if not any(own.lines for own in inner):
                text = "".join(f"{condition} ? {value} : " for condition, value in zip(conditions, values, strict=False)) + values[-1]
                expressions.lines.append(self.dialect.constant(choice.names[0], text))
                return
        lines = [f"{self.real} {name};" for name in choice.names]
        for i, block in enumerate(blocks):
            opening = f"if ({conditions[i]}) {{" if i < len(conditions) else "{"
            if i == 0:
                lines.append(opening)
            else:
                lines[-1] = f"}} else {opening}"
            lines.extend(indented(self._assigned(choice.names, block, expressions.inner())))
            lines.append("}")
        expressions.lines.extend(lines)

    def _assigned(self, names: Sequence[str], block: Block, expressions: Expressions) -> list[str]:
        lines = self._statements(block.statements, expressions)
        results = [expressions.text(result) for result in block.results]
        return [*lines, *(f"{name} = {text};" for name, text in zip(names, results, strict=True))]


def indented(lines: Sequence[str]) -> list[str]:
    """Lines one step to the right."""
    return [f"{INDENT}{line}" if line else line for line in lines]
