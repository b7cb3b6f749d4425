"""The statements of a program in C."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mapmore_cli.annexes.exporting.dialect import Expressions, Statements, indented
from mapmore_cli.domain.foreign import c_comment
from mapmore_cli.modelling.program.statements import Choose, Function
from mapmore_cli.modelling.program.writing import names_used_in


@dataclass
class CStatements(Statements):
    """Writes statements in C; `real` is the type of numbers."""

    real: str = "double"

    def function(self, function: Function) -> list[str]:
        """Return a function that no other file sees; several results are written where the last
        argument points.
        """
        several = len(function.body.results) > 1
        parameters = [f"{self.real} {name}" for name in function.parameters] + [
            f"{self.real} *results"
        ] * several
        lines, results = self.block(function.body, self.expressions())
        used = names_used_in(function.body)
        ignored = [f"(void){name};" for name in function.parameters if name not in used]
        ends = (
            [f"results[{i}] = {text};" for i, text in enumerate(results)]
            if several
            else [f"return {results[0]};"]
        )
        head = f"static {'void' if several else self.real} {function.name}({', '.join(parameters)})"
        note = c_comment(function.note) if function.note else []
        return [*note, head, "{", *indented([*ignored, *lines, *ends]), "}", ""]

    def _used(self, names: Sequence[str], function: str, arguments: Sequence[str]) -> list[str]:
        if len(names) == 1:
            return [self.dialect.constant(names[0], f"{function}({', '.join(arguments)})")]
        results = f"{names[0]}_all"
        self.places.update({name: f"{results}[{i}]" for i, name in enumerate(names)})
        return [
            f"{self.real} {results}[{len(names)}];",
            f"{function}({', '.join([*arguments, results])});",
        ]

    def _chosen(self, choice: Choose, expressions: Expressions) -> None:
        if len(choice.names) == 1 and not any(block.statements for block in choice.blocks):
            inner = [expressions.inner() for _ in choice.blocks]
            *values, last = (
                own.text(block.results[0]) for own, block in zip(inner, choice.blocks, strict=True)
            )
            if not any(own.lines for own in inner):
                conditions = (expressions.condition(condition) for condition, _ in choice.cases)
                cases = zip(conditions, values, strict=True)
                text = "".join(f"{condition} ? {value} : " for condition, value in cases) + last
                expressions.lines.append(self.dialect.constant(choice.names[0], text))
                return
        words = ("} else ", "} else {", "}")
        lines = self.branches(choice, expressions, "if ({}) {{".format, words)
        expressions.lines.extend([*(f"{self.real} {name};" for name in choice.names), *lines])

    def _recalled(self, queue: str, steps: int) -> str:
        size = self.program.kept.queues[queue]
        return f"s->{queue}[(s->{queue}_at + {size - steps}) % {size}]"

    def _queued(self, queue: str, text: str, size: int) -> list[str]:
        return [f"{queue}[{queue}_at] = {text};", f"{queue}_at = ({queue}_at + 1) % {size};"]
