"""Write programs: add statements, create new names, and build branches."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import replace
from itertools import count

import numpy as np

from mapmore_cli.domain.recording import CurveRange
from mapmore_cli.modelling.expressions import Expression, Name, Number, call, substitute
from mapmore_cli.modelling.expressions.syntax import (
    ONE,
    ZERO,
    Condition,
    Operand,
    Product,
    Sum,
    expression,
    names_in,
)
from mapmore_cli.modelling.program.statements import (
    Block,
    Choose,
    Function,
    InputLimit,
    KeptState,
    Let,
    Program,
    Queue,
    Recall,
    Statement,
    Store,
    Use,
)
from mapmore_cli.modelling.ranges import limits

Side = Operand | Callable[[], Operand]
"""A value, or a function that writes the statements of a value. These statements run only if the
branch is taken.
"""

Inputs = Mapping[str, Expression]
"""Expressions of the inputs by name, in the order of the model."""


class Writer:
    """Writer of a program. A new statement is added to the branch or function that is being
    written.

    - `kept`: what the model keeps from sample to sample.
    - `functions`: functions by name, in the order in which they are written.
    - `limits`: training ranges of the inputs.
    - `knots`: for each input, the places at which the program changes to another branch.
    """

    def __init__(self) -> None:
        self.statements: list[Statement] = []
        self.kept = KeptState()
        self.functions: dict[str, Function] = {}
        self.limits: list[InputLimit] = []
        self.knots: dict[str, set[float]] = {}
        self._numbers = count(1)

    def fresh(self, stem: str) -> str:
        """Return a new name: `stem` followed by a number."""
        return f"{stem}_{next(self._numbers)}"

    def let(self, stem: str, value: Operand) -> Expression:
        """Assign a value to a new name, and return the name. A value that is a name or a number
        already is returned unchanged.
        """
        value = expression(value)
        if isinstance(value, Name | Number):
            return value
        name = self.fresh(stem)
        self.statements.append(Let(name, value))
        return Name(name)

    def choose(
        self, stem: str, cases: Iterable[tuple[Condition, Side]], otherwise: Side
    ) -> Expression:
        """Write a branch statement, and return the name of its result. The result is the value of
        the first case whose condition holds, or `otherwise` if no condition holds.
        """
        branches = tuple((condition, self.side(side)) for condition, side in cases)
        if not branches:
            return self.let(stem, otherwise() if callable(otherwise) else otherwise)
        name = self.fresh(stem)
        self.statements.append(Choose((name,), branches, self.side(otherwise)))
        return Name(name)

    def where(self, condition: Condition, then: Side, otherwise: Side) -> Expression:
        """Write a branch, and return its result: `then` if the condition holds, and `otherwise` if
        it does not.
        """
        return self.choose("side", [(condition, then)], otherwise)

    def clip(
        self, x: Operand, low: Operand | None, high: Operand | None, stem: str = "clipped"
    ) -> Expression:
        """Write statements that limit x to the interval from `low` to `high`, and return the
        result. If `low` or `high` is None, x is not limited on this side.
        """
        held = self.let(stem, x)
        ends = [
            (Condition(held, sign, expression(end)), expression(end))
            for sign, end in (("<", low), (">", high))
            if end is not None
        ]
        return self.choose(stem, ends, held)

    def call(self, function: str, x: Operand) -> Expression:
        """Return `function(x)`, a call of one of `FUNCTIONS`."""
        return call(function, expression(x))

    def side(self, value: Side) -> Block:
        """Return the block of a branch or of a function. If `value` is a function, it is called,
        and the statements that it writes are the statements of the block. Otherwise, the block has
        the result `value` and no statements.
        """
        if not callable(value):
            return Block((), (expression(value),))
        outer, self.statements = self.statements, []
        try:
            result = expression(value())
            return Block(tuple(self.statements), (result,))
        finally:
            self.statements = outer

    def function(
        self, name: str, parameters: Sequence[str], body: Callable[[], Operand], note: str
    ) -> str:
        """Add a function to the program, and return its name."""
        self.functions[name] = Function(name, tuple(parameters), self.side(body), note)
        return name

    def use(self, stem: str, function: str, arguments: Iterable[Operand]) -> Expression:
        """Write a statement that calls a function of the program, and return the name to which its
        result is assigned.
        """
        name = self.fresh(stem)
        self.statements.append(Use((name,), function, tuple(map(expression, arguments))))
        return Name(name)

    def number(self, stem: str) -> Name:
        """Create a number that the model keeps from one sample to the next, and return its name.
        After a reset, the number is zero.
        """
        name = self.fresh(f"kept_{stem}")
        self.kept.numbers[name] = 0.0
        return Name(name)

    def keep(self, name: Expression, value: Operand) -> None:
        """Write a statement that stores a value under a name for the next sample."""
        assert isinstance(name, Name)
        self.statements.append(Store(name.name, expression(value)))

    def program(self, inputs: Sequence[str], *values: Expression) -> Program:
        """Return the program with the named inputs and the given outputs. Statements that no output
        needs are left out.
        """
        knots = {name: tuple(sorted(places)) for name, places in self.knots.items()}
        body = Block(tuple(self.statements), values)
        return pruned(
            Program(
                tuple(inputs),
                tuple(self.functions.values()),
                body,
                tuple(self.limits),
                self.kept,
                knots,
            )
        )

    def knot(self, name: str, *places: float) -> None:
        """Record places along an input at which the program changes to another branch."""
        self.knots.setdefault(name, set()).update(places)


def total(terms: Sequence[Expression]) -> Expression:
    """Return the sum of the terms in the given order, from left to right. `expressions.add` is not
    used, because it changes the order of the terms, and therefore the rounding.
    """
    return terms[0] if len(terms) == 1 else Sum(tuple(terms))


def product_as_written(*factors: Expression) -> Expression:
    """Return the product of the factors in the given order, from left to right."""
    kept = tuple(factor for factor in factors if factor != ONE) or (ONE,)
    return Product(kept) if len(kept) > 1 else kept[0]


def renamed_all(terms: Iterable[Expression], names: Mapping[str, Expression]) -> list[Expression]:
    """Return the expressions, in which each name in `names` is replaced by its expression."""
    return [substitute(term, names) for term in terms]


def limit(m: Writer, ranges: Sequence[CurveRange], level: str | None, inputs: Inputs) -> None:
    """Add the training ranges of the inputs to the program, and record their ends as knots."""
    for input_range in limits(ranges, level):
        if input_range.name in inputs:
            at = None if input_range.at is None else inputs[input_range.at]
            m.limits.append(
                InputLimit(
                    frozenset({input_range.name}),
                    inputs[input_range.name],
                    at,
                    input_range.levels,
                    input_range.low,
                    input_range.high,
                )
            )
            m.knot(
                input_range.name,
                *(
                    input_range.levels
                    if input_range.name == level
                    else np.concatenate([input_range.low, input_range.high])
                ).tolist(),
            )


def pruned(model: Program) -> Program:
    """Return the program without the statements on which neither its results nor its memory
    depend.
    """
    asked = names_in(side for limit in model.limits for side in (limit.value, limit.at or ZERO))
    body, used = pruned_block(model.body, asked)
    functions = list[Function]()
    for function in reversed(model.functions):  # functions only call earlier functions
        if function.name in used:
            kept, names = pruned_block(function.body)
            functions.append(replace(function, body=kept))
            used |= names
    return replace(model, functions=tuple(reversed(functions)), body=body)


def pruned_block(block: Block, also: Set[str] = frozenset()) -> tuple[Block, set[str]]:
    """Return the block with only the statements on which its results, its memory or the names in
    `also` depend. Also return the names that these statements use.
    """
    used, kept = {*names_in(block.results), *also}, list[Statement]()
    for statement in reversed(block.statements):
        needed = _pruned_statement(statement, used)
        if needed is not None:
            kept.append(needed[0])
            used |= needed[1]
    return Block(tuple(reversed(kept)), block.results), used


def _pruned_statement(statement: Statement, used: Set[str]) -> tuple[Statement, Set[str]] | None:
    """Return the part of a statement that computes the results in `used`, and the names that this
    part uses. Return None if no result of the statement is in `used`.
    """
    match statement:
        case Let(name) | Recall(name) if name not in used:
            return None
        case Use(names) if used.isdisjoint(names):
            return None
        case Choose(names, cases):
            places = [place for place, name in enumerate(names) if name in used]
            if not places:
                return None
            sides, names_of_sides = zip(
                *(
                    pruned_block(Block(block.statements, tuple(block.results[i] for i in places)))
                    for block in statement.blocks
                ),
                strict=True,
            )
            chosen = Choose(
                tuple(names[i] for i in places),
                tuple(zip((condition for condition, _ in cases), sides, strict=False)),
                sides[-1],
            )
            return chosen, _names_of_conditions(statement).union(*names_of_sides)
    return statement, names_used_by(statement)


def names_used_by(statement: Statement) -> Set[str]:
    """Return every name that a statement uses, including names of functions."""
    match statement:
        case Let(_, value) | Store(_, value) | Queue(_, value):
            return value.names
        case Use(_, function, arguments):
            return {function, *names_in(arguments)}
        case Choose():
            return _names_of_conditions(statement).union(*map(names_used_in, statement.blocks))
    return frozenset()


def _names_of_conditions(choice: Choose) -> frozenset[str]:
    return names_in(
        side for condition, _ in choice.cases for side in (condition.left, condition.right)
    )


def names_used_in(block: Block) -> Set[str]:
    """Return every name that occurs in a block, even if the results of the block do not depend on
    it.
    """
    return names_in(block.results).union(*map(names_used_by, block.statements))
