"""Write programs: fresh names, and shapes that occur again and again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count

from mapmore_cli.modelling.program.statements import Block, Choose, Function, Kept, Let, Limit, Statement, Use
from mapmore_cli.modelling.terms import Expression, Name, Number, add, call, substitute
from mapmore_cli.modelling.terms.syntax import Condition, Operand, Product, Sum, expression, negate

Side = Operand | Callable[[], Operand]
"""A value, or a function that writes the statements of one."""


class Names:
    """Names that were not given before, within one model."""

    def __init__(self) -> None:
        self.numbers = count(1)

    def fresh(self, stem: str) -> str:
        """`stem` with a number behind it."""
        return f"{stem}_{next(self.numbers)}"


class Lines:
    """Statements in the making."""

    def __init__(self, names: Names) -> None:
        self.names = names
        self.statements: list[Statement] = []

    def let(self, stem: str, value: Expression) -> Expression:
        """A new name for a value; itself where it is a name or a number."""
        if isinstance(value, Name | Number):
            return value
        name = self.names.fresh(stem)
        self.statements.append(Let(name, value))
        return Name(name)

    def use(self, stem: str, function: str, arguments: Sequence[Expression]) -> Expression:
        """The one result of a function."""
        name = self.names.fresh(stem)
        self.statements.append(Use((name,), function, tuple(arguments)))
        return Name(name)

    def choose(self, stem: str, cases: Iterable[tuple[Condition, Block | Expression]], otherwise: Block | Expression) -> Expression:
        """The one result of the first case whose condition holds."""
        found = tuple((condition, block_of(block)) for condition, block in cases)
        if not found and isinstance(otherwise, Expression):
            return otherwise
        name = self.names.fresh(stem)
        self.statements.append(Choose((name,), found, block_of(otherwise)))
        return Name(name)

    def where(self, condition: Condition, then: Side, otherwise: Side) -> Expression:
        """Return `then` where the condition holds, else `otherwise`: values, or functions that write the statements of that side."""
        return self.choose("side", [(condition, self.side(then))], self.side(otherwise))

    def clip(self, x: Operand, low: Operand | None, high: Operand | None, stem: str = "clipped") -> Expression:
        """Return x, held at the ends that are given."""
        held = self.let(stem, expression(x))
        ends = [(Condition(held, sign, expression(end)), expression(end)) for sign, end in (("<", low), (">", high)) if end is not None]
        return self.choose(stem, ends, held)

    def call(self, function: str, x: Operand) -> Expression:
        """Return a function's value."""
        return call(function, expression(x))

    def side(self, value: Side) -> Block:
        """Return the statements of one side of a branch."""
        if not callable(value):
            return Block((), (expression(value),))
        outer, self.statements = self.statements, []
        try:
            result = expression(value())
            return self.block(result)
        finally:
            self.statements = outer

    def block(self, *results: Expression) -> Block:
        """All so far."""
        return Block(tuple(self.statements), results)


@dataclass(frozen=True)
class Writer:
    """A model in the making: its main statements, and all that goes with them."""

    lines: Lines
    kept: Kept = field(default_factory=Kept)
    functions: list[Function] = field(default_factory=list)
    limits: list[Limit] = field(default_factory=list)


def kept_number(kept: Kept, lines: Lines, stem: str) -> Name:
    """A new number that is kept, zero after a reset."""
    name = lines.names.fresh(f"kept_{stem}")
    kept.numbers[name] = 0.0
    return Name(name)


def block_of(value: Block | Expression) -> Block:
    """A value alone as a block."""
    return value if isinstance(value, Block) else Block((), (value,))


def total(terms: Sequence[Expression]) -> Expression:
    """The sum from left to right, as it stands: `add` would take it apart and let numbers swap places."""
    return terms[0] if len(terms) == 1 else Sum(tuple(terms))


def times(*factors: Expression) -> Expression:
    """The product from left to right, as it stands."""
    kept = tuple(factor for factor in factors if factor != Number(1.0))
    return Product(kept) if len(kept) > 1 else kept[0] if kept else Number(1.0)


def less(left: Expression, right: Expression) -> Expression:
    """`left - right`."""
    return add(left, negate(right))


def combination(lines: Lines, factors: Sequence[float], terms: Sequence[Expression], constant: float) -> Expression:
    """`constant + sum_k factor_k term_k`, in this order, so that it rounds as a prediction does."""
    values = [lines.let("term", term) for term in terms]
    products = [Product((Number(float(factor)), value)) for factor, value in zip(factors, values, strict=True)]
    return total([Number(float(constant)), *products])


def renamed_all(terms: Iterable[Expression], names: Mapping[str, Expression]) -> list[Expression]:
    """Expressions of other names."""
    return [substitute(term, names) for term in terms]
