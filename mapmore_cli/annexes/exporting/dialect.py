"""What C and Python have in common: numbers, functions, expressions and statements."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from itertools import count

from mapmore_cli.annexes.exporting.templates import Code, code, word
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
    Keep,
    Let,
    Program,
    Queue,
    Recall,
    Statement,
    Use,
)
from mapmore_cli.modelling.program.values import COMPARE


def texts_of(part: object) -> Iterator[str]:
    """Yield every text within a part of a program, all but notes and the functions of expressions,
    which are known ones.
    """
    if isinstance(part, str):
        yield part
    elif isinstance(part, Expression):
        yield from part.names
    elif isinstance(part, tuple | Mapping):
        for one in part:
            yield from texts_of(one)
    elif is_dataclass(part):
        for one in fields(part):
            yield from texts_of(getattr(part, one.name)) if one.name != "note" else ()


@dataclass(frozen=True)
class Dialect:
    """What differs between languages.

    - `number`: a finite number as text.
    - `functions`: text of every function by its name in expressions; `pow` is a general power.
    - `constant`: the line that gives a name to what is not assigned again, given both.
    - `nothing`: the value where there is none.
    - `quotient`: the text of a quotient, given dividend and divisor.
    """

    number: Callable[[float], Code]
    functions: Mapping[str, str]
    constant: Callable[[str, str], str]
    nothing: str
    quotient: Callable[[str, str], str] = lambda dividend, divisor: f"{dividend} / {divisor}"


C_FUNCTIONS = {
    "exp": "exp",
    "log": "log",
    "sqrt": "sqrt",
    "sin": "sin",
    "cos": "cos",
    "tan": "tan",
    "atan": "atan",
    "sinh": "sinh",
    "cosh": "cosh",
    "tanh": "tanh",
    "expm1": "expm1",
    "log1p": "log1p",
    "pow": "pow",
    "abs": "fabs",
    "sign": "sign_of",
}
LARGEST, SMALLEST = 3.4028234e38, 1e-37
"""Of a single-precision number; what lies beyond is held at the one, and is zero below the other.
"""

DOUBLE = Dialect(
    lambda value: Code(repr(float(value))),
    C_FUNCTIONS,
    lambda name, text: f"const double {name} = {text};",
    "NAN",
)
SINGLE = Dialect(
    number=lambda value: code(
        "{!r}f", 0.0 if abs(value) < SMALLEST else min(max(float(value), -LARGEST), LARGEST)
    ),
    functions={
        name: text if text == "sign_of" else f"{text}f" for name, text in C_FUNCTIONS.items()
    },
    constant=lambda name, text: f"const float {name} = {text};",
    nothing="NAN",
)
NUMPY = Dialect(
    number=DOUBLE.number,
    functions={
        **{name: f"np.{name}" for name in C_FUNCTIONS},
        "atan": "np.arctan",
        "pow": "np.power",
    },
    constant=lambda name, text: f"{name} = {text}",
    nothing="np.nan",
)
SCALAR = replace(NUMPY, quotient=lambda dividend, divisor: f"np.divide({dividend}, {divisor})")
"""Of single numbers without NumPy, where Python raises for a quotient by zero."""


@dataclass
class Expressions:
    """Writes expressions, and the lines that they need before them: powers and function values that
    occur again get a name.

    They are computed in the same order as `terms.compiled` computes them, so that all languages
    round alike.
    """

    dialect: Dialect
    names: Callable[[str], str]
    """How a name of the program is written."""
    fresh: Callable[[str], str]
    """A new name that begins so."""
    lines: list[str] = field(default_factory=list)
    known: dict[Expression, str] = field(default_factory=dict)

    def inner(self, own_lines: bool = True) -> Expressions:
        """For a block within: it knows what is known here, and keeps to itself what it finds."""
        return Expressions(
            self.dialect, self.names, self.fresh, [] if own_lines else self.lines, dict(self.known)
        )

    def condition(self, condition: Condition) -> str:
        """Return a comparison."""
        return f"{self.text(condition.left)} {condition.comparison} {self.text(condition.right)}"

    def text(self, expression: Expression) -> str:
        """Return the expression as a whole."""
        match expression:
            case Sum((first, *others)):
                text = self.text(first)
                for term in others:
                    written = self.text(term)
                    text += f" - {written[1:]}" if written.startswith("-") else f" + {written}"
                return text
            case Product((first, *others)):
                text = "-" if first == Number(-1.0) else self._atom(first, front=True)
                for factor in others:
                    if isinstance(factor, Power) and factor.exponent < 0:
                        text = self.dialect.quotient(
                            "-1.0" if text == "-" else text,
                            self._power(factor.base, -factor.exponent),
                        )
                    else:
                        text += ("" if text == "-" else " * ") + self._atom(factor)
                return text
        return self._atom(expression, front=True)

    def _atom(self, expression: Expression, front: bool = False) -> str:
        """Return the expression as a factor."""
        match expression:
            case Number(value):
                number = self.dialect.number(value)
                return number if front or not number.startswith("-") else f"({number})"
            case Name(name):
                return self.dialect.nothing if expression == NOTHING else self.names(name)
            case Power() | Call():
                if expression not in self.known:
                    stem, text = self._computed(expression)
                    name = self.fresh(stem)
                    self.lines.append(self.dialect.constant(name, text))
                    self.known[expression] = name
                return self.known[expression]
        return f"({self.text(expression)})"

    def _computed(self, expression: Power | Call) -> tuple[str, str]:
        match expression:
            case Call(function, argument):
                return function, f"{self.dialect.functions[function]}({self.text(argument)})"
            case Power(base, exponent) if exponent < 0:
                return "inverse", self.dialect.quotient(
                    self.dialect.number(1.0), self._power(base, -exponent)
                )
            case Power(base, exponent) if exponent.is_integer():
                half = exponent // 2
                return "power", f"{self._power(base, half)} * {self._power(base, exponent - half)}"
            case Power(base, exponent):
                return (
                    "power",
                    f"{self.dialect.functions['pow']}({self.text(base)}, "
                    f"{self.dialect.number(exponent)})",
                )

    def _power(self, base: Expression, exponent: float) -> str:
        return self._atom(base if exponent == 1.0 else Power(base, exponent))


@dataclass
class Statements(ABC):
    """Writes the statements of a program; `end` stands behind an assignment."""

    end = ";"

    program: Program
    dialect: Dialect
    state: str
    """How a name begins that is kept in the state `s`."""
    places: dict[str, str] = field(default_factory=dict)
    """Where results lie that have no name of their own."""

    def __post_init__(self) -> None:
        """Raise DataError where a name of the program is no identifier."""
        own, kept = self.program, self.program.kept
        limits = tuple((limit.value, limit.at) for limit in own.limits)
        for text in {*texts_of((own.functions, own.body, limits, kept.numbers, kept.queues))} - {
            *COMPARE
        }:
            word(text)

    def expressions(self) -> Expressions:
        """Return how the expressions of a function are written."""
        numbers = count(1)
        return Expressions(self.dialect, self._name, lambda stem: f"{stem}{next(numbers)}")

    def _name(self, name: str) -> str:
        return (
            f"{self.state}{name}"
            if name in self.program.kept.numbers
            else self.places.get(name, name)
        )

    def block(self, block: Block, expressions: Expressions) -> tuple[list[str], list[str]]:
        """Return the lines of a block, behind those that `expressions` has, and its results."""
        self.write(block.statements, expressions)
        results = [expressions.text(result) for result in block.results]
        return expressions.lines, results

    def branches(
        self,
        choice: Choose,
        expressions: Expressions,
        form: Callable[[str], str],
        words: tuple[str, str, str],
    ) -> list[str]:
        """Return a choice of which one side is computed: `form` writes a condition, `words` stand
        before other conditions, before what is left, and at the end.
        """
        conditions = [form(expressions.condition(condition)) for condition, _ in choice.cases]
        other, otherwise, end = words
        lines = []
        openings = (conditions[0], *(f"{other}{one}" for one in conditions[1:]), otherwise)
        for opening, block in zip(openings, choice.blocks, strict=True):
            own, results = self.block(block, expressions.inner())
            values = zip(choice.names, results, strict=True)
            lines += [opening, *indented([*own, *(f"{name} = {x};" for name, x in values)])]
        return [*lines, end]

    def write(self, statements: Sequence[Statement], expressions: Expressions) -> None:
        """Write statements behind the lines that `expressions` has."""
        lines = expressions.lines
        for statement in statements:
            match statement:
                case Let(name, value):
                    lines.append(self.dialect.constant(name, expressions.text(value)))
                case Use(names, function, arguments):
                    lines.extend(
                        self._used(names, function, [expressions.text(one) for one in arguments])
                    )
                case Choose():
                    self._chosen(statement, expressions)
                case Recall(name, queue, steps):
                    lines.append(self.dialect.constant(name, self._recalled(queue, steps)))
                case Keep(kept, value):
                    lines.append(f"{self.state}{kept} = {expressions.text(value)}{self.end}")
                case Queue(queue, value):
                    size = self.program.kept.queues[queue]
                    lines.extend(
                        self._queued(f"{self.state}{queue}", expressions.text(value), size)
                    )

    @abstractmethod
    def _used(self, names: Sequence[str], function: str, arguments: Sequence[str]) -> list[str]: ...

    @abstractmethod
    def _chosen(self, choice: Choose, expressions: Expressions) -> None: ...

    @abstractmethod
    def _recalled(self, queue: str, steps: int) -> str: ...

    @abstractmethod
    def _queued(self, queue: str, text: str, size: int) -> list[str]: ...


def indented(lines: Sequence[str]) -> list[str]:
    """Lines one step to the right."""
    return [f"    {line}" if line else line for line in lines]
