"""Extend a program by the derivatives of its results. After every statement, statements for its
derivatives are added, by the chain rule on the syntax trees.

At a boundary between two cases of a branch, the derivative is that of the case whose condition is
true at the boundary. A case whose condition is true at a single point only (`==`) has no derivative
and is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions import Expression, Name, add, derivative, multiply
from mapmore_cli.modelling.expressions.syntax import ONE, ZERO
from mapmore_cli.modelling.program.statements import (
    Block,
    Choose,
    Function,
    Let,
    Program,
    Statement,
    Use,
)
from mapmore_cli.modelling.program.values import INPUT
from mapmore_cli.modelling.program.writing import pruned, pruned_block

Slopes = tuple[Expression, ...]  # derivatives of one value with respect to each variable
FUNCTION = "{}_slopes"  # name of the function that returns the value of `{}` and its derivatives


def with_slopes(model: Program) -> Program:
    """Return the program with further outputs: the derivatives of its output with respect to every
    input.

    Raises DataError for a model with memory, because its output depends on earlier samples.
    """
    if model.step is not None:
        raise DataError(
            "a model with memory has no derivative at a point, because it depends on the past",
            "differentiate its output along a simulated run",
        )
    body = _with_slopes(model.body, [f"{INPUT}{name}" for name in model.inputs])
    return pruned(replace(model, functions=functions_with_slopes(model.functions), body=body))


def functions_with_slopes(functions: Sequence[Function]) -> tuple[Function, ...]:
    """Return each function with more results: the original value is followed by its derivatives
    with respect to all parameters of the function.
    """
    return tuple(
        Function(
            FUNCTION.format(function.name),
            function.parameters,
            _with_slopes(function.body, function.parameters),
            f"{function.note}, and its slopes" if function.note else "",
        )
        for function in functions
    )


def with_slopes_by(block: Block, names: Sequence[str]) -> Block:
    """Return a block whose results are the derivatives of the original results with respect to
    `names`.
    """
    whole = _with_slopes(block, names)
    return pruned_block(Block(whole.statements, whole.results[len(block.results) :]))[0]


def _with_slopes(block: Block, names: Sequence[str]) -> Block:
    """Return a block whose results are the original results, followed by their derivatives with
    respect to `names`.
    """
    return _block_with_slopes(
        block,
        {name: tuple(ONE if other == name else ZERO for other in names) for name in names},
        len(names),
    )


def _block_with_slopes(block: Block, slopes: dict[str, Slopes], count: int) -> Block:
    """Return a block whose results are the original results, followed by their derivatives with
    respect to `count` variables. `slopes` holds the derivatives of names that are defined outside
    the block.
    """
    known, statements = dict(slopes), list[Statement]()
    for statement in block.statements:
        match statement:
            case Let(name, value):
                statements.append(statement)
                known[name] = _named_slopes(statements, name, _chained(value, known, count))
            case Use((name,), function, arguments):
                outer = [Name(f"{name}_by{i}") for i in range(len(arguments))]
                statements.append(
                    Use(
                        (name, *(slope.name for slope in outer)),
                        FUNCTION.format(function),
                        arguments,
                    )
                )
                inner = [_chained(argument, known, count) for argument in arguments]
                parts = (
                    add(*(multiply(o, slope[way]) for o, slope in zip(outer, inner, strict=True)))
                    for way in range(count)
                )
                known[name] = _named_slopes(statements, name, tuple(parts))
            case Choose():
                statements.append(_choice_with_slopes(statement, known, count))
            case _:
                raise TypeError(f"a model without memory cannot contain {statement!r}")
    results = [slope for result in block.results for slope in _chained(result, known, count)]
    return Block(tuple(statements), (*block.results, *results))


def _choice_with_slopes(choice: Choose, known: dict[str, Slopes], count: int) -> Choose:
    """Return a branch statement that computes its results and their derivatives. The names of the
    derivatives are added to `known`.
    """
    names = (*choice.names, *(f"{name}_d{way}" for name in choice.names for way in range(count)))
    known.update(
        {name: tuple(Name(f"{name}_d{way}") for way in range(count)) for name in choice.names}
    )
    cases = tuple(
        (condition, _block_with_slopes(block, known, count))
        for condition, block in choice.cases
        if condition.comparison != "=="
    )
    return Choose(names, cases, _block_with_slopes(choice.otherwise, known, count))


def _chained(value: Expression, known: dict[str, Slopes], count: int) -> Slopes:
    """Return the derivatives of an expression by the chain rule, one for each variable of
    differentiation.
    """
    outer = {name: derivative(value, name) for name in sorted(value.names) if name in known}
    return tuple(
        add(*(multiply(slope, known[name][way]) for name, slope in outer.items()))
        for way in range(count)
    )


def _named_slopes(statements: list[Statement], name: str, slopes: Slopes) -> Slopes:
    """Add a statement for each derivative that is neither a name nor a number, and return the names
    of all derivatives.
    """
    known = list(slopes)
    for way, slope in enumerate(slopes):
        if slope.names and not isinstance(slope, Name):
            statements.append(Let(f"{name}_d{way}", slope))
            known[way] = Name(f"{name}_d{way}")
    return tuple(known)
