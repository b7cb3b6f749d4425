"""Evaluate programs of models without memory over columns of samples.

Each branch is computed for the rows that take it, so a program of many pieces costs about as much
as the pieces that count. A side of a branch is made ready when the first row takes it.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, reduce
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, Value
from mapmore_cli.modelling.expressions.evaluation import Known, Part, Shared, part_of
from mapmore_cli.modelling.expressions.operator import FLOATS
from mapmore_cli.modelling.expressions.syntax import Condition, Name, Number
from mapmore_cli.modelling.program.statements import (
    Block,
    Choose,
    Function,
    Let,
    Program,
    Statement,
    Use,
)
from mapmore_cli.modelling.program.writing import names_used_in

INPUT = "x_"  # how the names of inputs begin in a program, so that no other name equals them

COMPARE: Mapping[str, Callable[[Value, Value], BoolArray]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
}

Values = dict[str, Value]
Run = Callable[[Values, int], list[Value]]
"""The results of a block, given what is known outside of it and the number of rows n: (n,) each, or
one number for all rows.
"""

Test = Callable[[Values, Shared], BoolArray]
"""A condition: (n,), or one for all rows."""

Step = Callable[[Values, Shared, int], None]
"""A statement: it adds what it computes to the values."""


def evaluator(program: Program) -> Callable[[Columns], list[Array]]:
    """Return a function of the model's inputs by name, (n,) for the first and (n,) or a number for
    each other, for many calls: the results of the program, (n,) each.

    They are NaN where an input is not finite.
    """
    run = _Compiler(program.functions).block(program.body)

    def results(columns: Columns) -> list[Array]:
        given: Values = {
            f"{INPUT}{name}": np.asarray(columns[name], dtype=np.float64) for name in program.inputs
        }
        n = len(columns[program.inputs[0]])
        finite = reduce(np.logical_and, map(np.isfinite, given.values()))
        with np.errstate(all="ignore"):
            return [np.where(finite, value, np.nan) for value in run(given, n)]

    return results


def ready_for_columns(block: Block, functions: Iterable[Function]) -> Run:
    """Return a block, ready to be run along columns of samples."""
    return _Compiler(functions).block(block)


def ready_for_one_sample(block: Block, rules: Mapping[str, Callable[..., Any]]) -> Run:
    """Return a block whose functions are operators, ready to be run many times for one sample
    each.
    """
    return _SampleCompiler(rules).block(block)


class _Compiler:
    """Makes blocks and functions ready to run."""

    def __init__(self, functions: Iterable[Function]) -> None:
        self.functions = {function.name: function for function in functions}
        self.ready = cache(lambda name: self.block(self.functions[name].body))

    def block(self, block: Block) -> Run:
        known: Known = {}
        steps = [self._step(statement, known) for statement in block.statements]
        results = [part_of(result, known) for result in block.results]
        slots = len(known)

        def run(values: Values, n: int) -> list[Value]:
            shared: Shared = [None] * slots
            for step in steps:
                step(values, shared, n)
            return [result(values, shared) for result in results]

        return run

    def _step(self, statement: Statement, known: Known) -> Step:
        match statement:
            case Let(name, value):
                part = part_of(value, known)
                return lambda values, shared, _n: values.update({name: part(values, shared)})
            case Use(names, function, arguments):
                return self._use(
                    names, function, [part_of(argument, known) for argument in arguments]
                )
            case Choose():
                return self._choice(statement, known)
        raise TypeError(f"not a statement of a model without memory: {statement!r}")

    def _choice(self, choice: Choose, known: Known) -> Step:
        conditions = [_ready_condition(condition, known) for condition, _ in choice.cases]
        if all(
            not one.statements and all(isinstance(result, Name | Number) for result in one.results)
            for one in choice.blocks
        ):
            sides = [[part_of(result, known) for result in one.results] for one in choice.blocks]
            return _values_where(choice.names, conditions, sides)
        return self._branches(choice.names, conditions, choice.blocks)

    def _use(self, names: Sequence[str], function: str, arguments: Sequence[Part]) -> Step:
        parameters = self.functions[function].parameters

        def step(values: Values, shared: Shared, n: int) -> None:
            given = {
                name: argument(values, shared)
                for name, argument in zip(parameters, arguments, strict=True)
            }
            values.update(zip(names, self.ready(function)(given, n), strict=True))

        return step

    def _branches(
        self, names: Sequence[str], conditions: Sequence[Test], blocks: Sequence[Block]
    ) -> Step:
        needed = [names_used_in(block) for block in blocks]
        side = cache(lambda number: self.block(blocks[number]))

        def step(values: Values, shared: Shared, n: int) -> None:
            found = [np.empty(n) for _ in names]
            left = np.ones(n, dtype=np.bool_)
            for number in range(len(blocks)):
                mask = (
                    left & conditions[number](values, shared) if number < len(conditions) else left
                )
                rows = np.flatnonzero(mask)
                if len(rows) == n:
                    values.update(zip(names, side(number)(values, n), strict=True))
                    return
                if len(rows):
                    left = left ^ mask
                    own = {
                        name: x.take(rows) if (x := values[name]).ndim else x
                        for name in needed[number]
                        if name in values
                    }
                    for whole, part in zip(found, side(number)(own, len(rows)), strict=True):
                        whole[rows] = part
            values.update(zip(names, found, strict=True))

        return step


class _SampleCompiler(_Compiler):
    """One sample at a time: only the side that counts is computed, and operators are called."""

    def __init__(self, rules: Mapping[str, Callable[..., Any]]) -> None:
        super().__init__(())
        self.rules = rules

    def _use(self, names: Sequence[str], function: str, arguments: Sequence[Part]) -> Step:
        (name,), following = names, self.rules[function]

        def step(values: Values, shared: Shared, _n: int) -> None:
            values[name] = following(FLOATS, *[one(values, shared) for one in arguments])

        return step

    def _choice(self, choice: Choose, known: Known) -> Step:
        conditions = [_ready_condition(condition, known) for condition, _ in choice.cases]
        *sides, otherwise = map(self.block, choice.blocks)
        cases, names = list(zip(conditions, sides, strict=True)), choice.names

        def step(values: Values, shared: Shared, n: int) -> None:
            chosen = otherwise
            for condition, side in cases:
                if condition(values, shared):
                    chosen = side
                    break
            values.update(zip(names, chosen(values, n), strict=True))

        return step


def _ready_condition(condition: Condition, known: Known) -> Test:
    compare, left, right = (
        COMPARE[condition.comparison],
        part_of(condition.left, known),
        part_of(condition.right, known),
    )
    return lambda values, shared: compare(left(values, shared), right(values, shared))


def _values_where(
    names: Sequence[str], conditions: Sequence[Test], sides: Sequence[Sequence[Part]]
) -> Step:
    """Return a choice between values that are there already: no rows are sorted."""

    def step(values: Values, shared: Shared, _n: int) -> None:
        held = [condition(values, shared) for condition in conditions]
        for place, name in enumerate(names):
            value = sides[-1][place](values, shared)
            for condition, side in zip(reversed(held), reversed(sides[:-1]), strict=True):
                value = np.where(condition, side[place](values, shared), value)
            values[name] = value

    return step
