"""Evaluate programs of models without memory over columns of samples.

Each branch is computed only for the rows that take it, so that pieces that no row needs take no
time. A branch is compiled when a row takes it for the first time.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache, reduce
from typing import Any, Literal

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray, Value
from mapmore_cli.modelling.expressions.evaluation import Known, Part, Shared, part_of
from mapmore_cli.modelling.expressions.operator import FLOATS
from mapmore_cli.modelling.expressions.syntax import Condition, Number
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

INPUT = "x_"  # prefix of the names of inputs in a program, so that they differ from all other names

COMPARE: Mapping[str, Callable[[Value, Value], BoolArray]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
}

Values = dict[str, Value]
Run = Callable[[Values, int], list[Value]]
"""Function that runs a block. It takes the values that are defined outside the block and the number
of rows n, and returns the results, each of shape (n,) or one number for all rows.
"""

Places = Callable[[Values, Shared, int], Iterator[tuple[int, IntArray]]]
"""Function that yields, for each case that at least one row takes, the number of the case and the
numbers of these rows, shape (m,). The cases come in ascending order. The last case has no
condition.
"""

Test = Callable[[Values, Shared], BoolArray]
"""Function that evaluates a condition. It returns True or False for each row, shape (n,), or a
single value for all rows.
"""

Step = Callable[[Values, Shared, int], None]
"""Function that runs a statement and adds its results to the values."""


def evaluator(program: Program) -> Callable[[Columns], list[Array]]:
    """Compile a program to a function.

    The argument of the function is a mapping of inputs: the first has the shape (n,), and each of
    the others has this shape or is a number. The function returns the results of the program, shape
    (n,) each. They are NaN in rows in which an input is not finite.
    """
    run = _Compiler(program.functions).block(program.body)

    def results(columns: Columns) -> list[Array]:
        values: Values = {
            f"{INPUT}{name}": np.asarray(columns[name], dtype=np.float64) for name in program.inputs
        }
        n = len(columns[program.inputs[0]])
        finite = reduce(np.logical_and, map(np.isfinite, values.values()))
        with np.errstate(all="ignore"):
            return [np.where(finite, value, np.nan) for value in run(values, n)]

    return results


def ready_for_columns(block: Block, functions: Iterable[Function]) -> Run:
    """Compile a block to a function of columns of samples."""
    return _Compiler(functions).block(block)


def ready_for_one_sample(block: Block, rules: Mapping[str, Callable[..., Any]]) -> Run:
    """Compile a block to a function of one sample.

    Every function that the block calls must be one time step of an operator with memory, such as
    `slow` or `play`. `rules` holds a Python function for each of these operators, by its name.
    """
    return _SampleCompiler(rules).block(block)


class _Compiler:
    """Compiler of blocks and functions for columns of samples."""

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

                def let(values: Values, shared: Shared, _n: int) -> None:
                    values[name] = part(values, shared)

                return let
            case Use(names, function, arguments):
                return self._use(
                    names, function, [part_of(argument, known) for argument in arguments]
                )
            case Choose():
                return self._choice(statement, known)
        raise TypeError(f"a model without memory cannot contain {statement!r}")

    def _choice(self, choice: Choose, known: Known) -> Step:
        if (places := _places_along(choice, known)) is not None:
            return self._branches(choice.names, places, choice.blocks)
        conditions = [_ready_condition(condition, known) for condition, _ in choice.cases]
        return self._branches(choice.names, _places_by(conditions), choice.blocks)

    def _use(self, names: Sequence[str], function: str, arguments: Sequence[Part]) -> Step:
        parameters = self.functions[function].parameters

        def step(values: Values, shared: Shared, n: int) -> None:
            bound = {
                name: argument(values, shared)
                for name, argument in zip(parameters, arguments, strict=True)
            }
            values.update(zip(names, self.ready(function)(bound, n), strict=True))

        return step

    def _branches(self, names: Sequence[str], places: Places, blocks: Sequence[Block]) -> Step:
        needed = cache(lambda number: names_used_in(blocks[number]))
        side = cache(lambda number: self.block(blocks[number]))

        def step(values: Values, shared: Shared, n: int) -> None:
            merged = [np.empty(n) for _ in names]
            for number, rows in places(values, shared, n):
                if len(rows) == n:
                    values.update(zip(names, side(number)(values, n), strict=True))
                    return
                on_rows = {
                    name: x.take(rows) if (x := values[name]).ndim else x
                    for name in needed(number)
                    if name in values
                }
                for whole, part in zip(merged, side(number)(on_rows, len(rows)), strict=True):
                    whole[rows] = part
            values.update(zip(names, merged, strict=True))

        return step


class _SampleCompiler(_Compiler):
    """Compiler for functions of one sample. Only the branch that applies is computed, and operators
    are called as functions.
    """

    def __init__(self, rules: Mapping[str, Callable[..., Any]]) -> None:
        super().__init__(())
        self.rules = rules

    def _use(self, names: Sequence[str], function: str, arguments: Sequence[Part]) -> Step:
        (name,), following = names, self.rules[function]

        def step(values: Values, shared: Shared, _n: int) -> None:
            values[name] = following(FLOATS, *[argument(values, shared) for argument in arguments])

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


def _places_by(conditions: Sequence[Test]) -> Places:
    """Return a function that yields, for each case of a branch, the rows to which this case
    applies. The conditions are tested one after the other until a case is found for every row.
    """

    def places(values: Values, shared: Shared, n: int) -> Iterator[tuple[int, IntArray]]:
        left = np.ones(n, dtype=np.bool_)
        for number in range(len(conditions) + 1):
            mask = left & conditions[number](values, shared) if number < len(conditions) else left
            rows = np.flatnonzero(mask)
            if len(rows):
                yield number, rows
                left = left ^ mask
                if not left.any():
                    return

    return places


MANY = 16
"""Smallest number of cases for which the case of a row is found by bisection."""


def _places_along(choice: Choose, known: Known) -> Places | None:
    """Return a function that yields, for each case of a branch, the rows to which this case
    applies. The case of each row is found by bisection, so that the time does not grow with the
    square of the number of cases. Return None if there are few cases, or if the cases do not all
    compare the same value with a number.

    The first case whose condition is true applies. Therefore, a case `x < 3` has no effect after a
    case `x < 5`. If such cases are removed, the numbers are in ascending order (in descending order
    for `>`), and bisection finds the first true condition.
    """
    conditions = [condition for condition, _ in choice.cases]
    along = {condition.left for condition in conditions}
    numbers = [
        condition.right.value for condition in conditions if isinstance(condition.right, Number)
    ]
    if not MANY <= len(conditions) == len(numbers) or len(along) > 1:
        return None
    if not np.isfinite(numbers).all():
        return None
    value = part_of(along.pop(), known)
    words = np.array([condition.comparison for condition in conditions])
    ways = [
        _first_that_holds(word, np.flatnonzero(words == word), np.array(numbers))
        for word in np.unique(words).tolist()
    ]

    def places(values: Values, shared: Shared, n: int) -> Iterator[tuple[int, IntArray]]:
        x = np.broadcast_to(value(values, shared), (n,))
        first: IntArray = reduce(np.minimum, (way(x) for way in ways))
        for number in np.unique(first).tolist():
            yield number, np.flatnonzero(first == number)

    return places


def _first_that_holds(
    comparison: str, places: IntArray, numbers: Array
) -> Callable[[Array], IntArray]:
    """Return a function that finds, for each of the values x, (n,), the first condition that is
    true for x.

    All these conditions have the same `comparison`. `places` holds their indices among all
    conditions, in ascending order, and `numbers` holds the right-hand sides of all conditions. The
    function returns the index of the first true condition, or `len(numbers)` if none is true, shape
    (n,).
    """
    ends, numbers = np.append(places, len(numbers)), numbers[places]
    if comparison == "==":
        kept, first = np.unique(numbers, return_index=True)
        padded = np.append(kept, np.nan)

        def equal(x: Array) -> IntArray:
            at = np.searchsorted(kept, x)
            place: IntArray = np.where(padded[at] == x, ends[np.append(first, -1)[at]], ends[-1])
            return place

        return equal
    turn = 1.0 if comparison.startswith("<") else -1.0
    reached = np.maximum.accumulate(turn * numbers)
    side: Literal["left", "right"] = "left" if comparison.endswith("=") else "right"

    def beyond(x: Array) -> IntArray:
        return ends[np.searchsorted(reached, turn * x, side=side)]

    return beyond
