"""Differentiate programs: every name is followed by its derivatives, by the chain rule on the syntax trees.

At a boundary the slope is that of the case that holds there; a case that holds at one point alone (`==`) has none, and is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array, Value
from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions import Expression, Name, add, derivative, multiply
from mapmore_cli.modelling.expressions.operator import Recursion
from mapmore_cli.modelling.expressions.syntax import ONE, ZERO
from mapmore_cli.modelling.program.statements import Block, Choose, Function, Let, Program, Statement, Use
from mapmore_cli.modelling.program.values import INPUT, block_values
from mapmore_cli.modelling.program.writing import Writer, pruned

Slopes = tuple[Expression, ...]
"""Derivatives by each direction."""

FUNCTION = "{}_slopes"
"""Name of a function that returns its value and its derivatives."""


def with_slopes(model: Program) -> Program:
    """Return the program with the derivative for every input behind its output.

    Raises DataError for a model with memory: its output depends on what was before.
    """
    if model.step is not None:
        raise DataError("a model with memory has no derivative at a point: its output depends on the past", "differentiate along a run")
    functions = tuple(_function(function) for function in model.functions)
    body = _block(model.body, _seeds([f"{INPUT}{name}" for name in model.inputs]), len(model.inputs))
    return pruned(replace(model, functions=functions, body=body))


def recursion_slopes(rule: Recursion, arguments: Sequence[Array]) -> list[Value]:
    """Return the derivatives of `rule.next` by each of its p + q + 1 arguments, given those, (n,) each; (n,), or one for all samples."""
    if rule.weights is not None:
        return [np.float64(weight) for weight in rule.weights]
    names = [f"argument_{place}" for place in range(len(arguments))]
    m = Writer()
    block = _block(m.side(lambda: rule.next(m, *map(Name, names))), _seeds(names), len(names))
    return block_values(block, dict(zip(names, arguments, strict=True)))[1:]


def _function(function: Function) -> Function:
    body = _block(function.body, _seeds(function.parameters), len(function.parameters))
    return Function(FUNCTION.format(function.name), function.parameters, body, f"{function.note}, and its slopes" * bool(function.note))


def _seeds(names: Sequence[str]) -> dict[str, Slopes]:
    return {name: tuple(ONE if other == name else ZERO for other in names) for name in names}


def _block(block: Block, slopes: dict[str, Slopes], count: int) -> Block:
    """Return the block with the derivatives of its results behind them; `slopes` are those of the names known outside of it."""
    known, statements = dict(slopes), list[Statement]()
    for statement in block.statements:
        match statement:
            case Let(name, value):
                statements.append(statement)
                known[name] = _named(statements, name, _chained(value, known, count))
            case Use((name,), _, arguments):
                statements.append(_used(statement))
                outer = [Name(f"{name}_by{i}") for i in range(len(arguments))]
                inner = [_chained(argument, known, count) for argument in arguments]
                parts = (add(*(multiply(o, slope[way]) for o, slope in zip(outer, inner, strict=True))) for way in range(count))
                known[name] = _named(statements, name, tuple(parts))
            case Choose():
                statements.append(_chosen(statement, known, count))
            case _:
                raise TypeError(f"not a statement of a model without memory: {statement!r}")
    results = [slope for result in block.results for slope in _chained(result, known, count)]
    return Block(tuple(statements), (*block.results, *results))


def _used(statement: Use) -> Use:
    (name,) = statement.names
    names = (name, *(f"{name}_by{i}" for i in range(len(statement.arguments))))
    return Use(names, FUNCTION.format(statement.function), statement.arguments)


def _chosen(choice: Choose, known: dict[str, Slopes], count: int) -> Choose:
    """Return the choice with the derivatives of its results, and add those to `known`."""
    names = (*choice.names, *(f"{name}_d{way}" for name in choice.names for way in range(count)))
    known.update({name: tuple(Name(f"{name}_d{way}") for way in range(count)) for name in choice.names})
    cases = tuple((condition, _block(block, known, count)) for condition, block in choice.cases if condition.comparison != "==")
    return Choose(names, cases, _block(choice.otherwise, known, count))


def _chained(value: Expression, known: dict[str, Slopes], count: int) -> Slopes:
    """Return the derivatives of an expression by every direction (chain rule)."""
    outer = {name: derivative(value, name) for name in sorted(value.names) if name in known}
    return tuple(add(*(multiply(slope, known[name][way]) for name, slope in outer.items())) for way in range(count))


def _named(statements: list[Statement], name: str, slopes: Slopes) -> Slopes:
    """Name each derivative that is neither a name nor a number."""
    found: list[Expression] = []
    for way, slope in enumerate(slopes):
        if slope.names and not isinstance(slope, Name):
            statements.append(Let(f"{name}_d{way}", slope))
            found.append(Name(f"{name}_d{way}"))
        else:
            found.append(slope)
    return tuple(found)
