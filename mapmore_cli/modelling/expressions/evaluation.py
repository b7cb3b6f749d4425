"""Evaluate expressions on columns of samples."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, Value, column_in
from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions.functions import FUNCTIONS
from mapmore_cli.modelling.expressions.printing import to_text
from mapmore_cli.modelling.expressions.syntax import (
    Call,
    Expression,
    Name,
    Number,
    Power,
    Product,
    Sum,
    names_in,
    with_parts,
)


class NotFinite(DataError, ValueError):
    """Error for a term whose value is not finite on a row of the data. `term` is its text and `row`
    the 0-based row.
    """

    def __init__(self, term: str, row: int, inputs: str) -> None:
        super().__init__(
            f"the term `{term}` is not finite in row {row} ({inputs})",
            "remove the term from the dictionary, or keep only samples for which it is defined",
        )
        self.term = term
        self.row = row


# number of rows in a block; the values of so few rows stay in the processor's cache
BLOCK = 8192


def evaluate(expression: Expression, columns: Columns, n: int | None = None) -> Array:
    """Return the value of `expression` on every row, shape (n,), as a new array.

    - `columns`: quantities by name, shape (n,) each, or shape () for a parameter that is equal for
      all rows.
    - `n`: number of rows; by default the length of the first column.

    Values that are not finite (the logarithm of a negative number, a division by zero) remain in
    the result, without a warning. Raises `DataError` if a column is missing, or if its length is
    not n.
    """
    if n is None:
        n = next((len(column) for column in columns.values() if np.ndim(column)), None)
        if n is None:
            raise DataError(
                "the number of rows is unknown, because no column of samples is given",
                "give at least one column, or the number of rows as `n`",
            )
    values = _needed((expression,), columns, n)
    with np.errstate(all="ignore"):
        (value,) = compiled((expression,))(values)
        return np.array(np.broadcast_to(value, (n,)), dtype=float)


def folded(expression: Expression) -> Expression:
    """Return the expression, in which every part without variables is replaced by its numerical
    value. A constant divisor of an expression with variables remains a divisor: for example,
    `2*y/620` is not changed to `0.00322581*y`.

    Examples
    --------
    >>> from mapmore_cli.modelling.expressions import parse, to_text
    >>> to_text(folded(parse("3*exp(-(x - 1)/0.03)/tan(0.5)^2 - (1 - 0.925396)*y/620")), digits=6)
    '10.0521*exp(-(x - 1)/0.03) - 0.074604*y/620'
    """
    match expression:
        case Number() | Power(Number(), -1.0):
            return expression
        case _ if not expression.names:
            value = float(evaluate(expression, {}, 1)[0])
            return Number(value) if math.isfinite(value) else expression
    return with_parts(expression, folded)


def dictionary_matrix(terms: Sequence[Expression], columns: Columns, n: int) -> Array:
    """Return the regressor matrix `P`, shape (n, M) in Fortran order: column j is term j on every
    row (M2 eq 2).

    Powers and function values that several terms share are computed once. Raises `NotFinite` with
    the first row on which a term has no finite value, and DataError if a column is missing or does
    not have n rows.
    """
    matrix = np.empty((n, len(terms)), order="F")
    for rows, block in dictionary_blocks(terms, columns, n):
        matrix[rows] = block
    return matrix


def dictionary_blocks(
    terms: Sequence[Expression], columns: Columns, n: int
) -> Iterator[tuple[slice, Array]]:
    """Yield the rows of `dictionary_matrix` in blocks of shape (b, M), each with the slice of its
    rows. The whole matrix is never in memory. Raises the same errors as `dictionary_matrix`.
    """
    values, block_of = _needed(terms, columns, n), dictionary_block(terms)
    for start in range(0, n, BLOCK):
        rows = slice(start, min(start + BLOCK, n))
        held = {name: value[rows] if value.ndim else value for name, value in values.items()}
        yield rows, block_of(held, rows)


def dictionary_block(terms: Sequence[Expression]) -> Callable[[Mapping[str, Array], slice], Array]:
    """Return a function that computes b rows of the regressor matrix, shape (b, M). Its first
    argument holds the columns at these b rows. Its second argument is the slice of these rows in
    all rows, from which an error message computes the number of a row. Blocks of a few thousand
    rows are fastest.
    """
    program = compiled(tuple(terms))

    def block_of(columns: Mapping[str, Array], rows: slice) -> Array:
        block = np.empty((rows.stop - rows.start, len(terms)), order="F")
        with np.errstate(all="ignore"):
            for column, value in zip(block.T, program(columns), strict=True):
                column[:] = value
        for term, column in zip(terms, block.T, strict=True):
            if not np.isfinite(column).all():
                row = int(np.argmin(np.isfinite(column)))
                inputs = {
                    name: columns[name][row] if columns[name].ndim else columns[name]
                    for name in sorted(term.names)
                }
                raise NotFinite(
                    to_text(term),
                    rows.start + row,
                    ", ".join(f"{name} = {value:.6g}" for name, value in inputs.items()),
                )
        return block

    return block_of


def _needed(terms: Sequence[Expression], columns: Columns, n: int) -> dict[str, Array]:
    """Return the columns that occur in the terms. Raises DataError if a column is missing or does
    not have n rows.
    """
    needed: dict[str, Array] = {}
    for name in sorted(names_in(terms)):
        needed[name] = np.asarray(column_in(columns, name), dtype=float)
        if needed[name].shape not in ((n,), ()):
            raise DataError(
                f"the column `{name}` has the shape {needed[name].shape}, expected ({n},)",
                "give one value for each row",
            )
    return needed


# values of powers and calls that several expressions share; None until a value is computed
Shared = list[Value | None]
# function that computes the value of a node of a syntax tree from the columns
Part = Callable[[Mapping[str, Value], Shared], Value]
Known = dict[Expression, Part]


@lru_cache(maxsize=4096)
def compiled(
    expressions: tuple[Expression, ...],
) -> Callable[[Mapping[str, Value]], Iterator[Value]]:
    """Return a function that yields the values of `expressions` in order. Powers and function
    values that several expressions share are computed once.

    Do not change a yielded array in place, because it may be an input column or be used for a later
    value.
    """
    known: Known = {}
    parts = [part_of(expression, known) for expression in expressions]

    def values(columns: Mapping[str, Value]) -> Iterator[Value]:
        shared: Shared = [None] * len(known)
        for part in parts:
            yield part(columns, shared)

    return values


def part_of(expression: Expression, known: Known) -> Part:
    """Compile a node of a syntax tree into a function of the columns. `known` collects the compiled
    powers and function calls of all expressions that are evaluated together, so that each is
    computed once.
    """
    match expression:
        case Number(value):
            constant = np.float64(value)
            return lambda _columns, _shared: constant
        case Name(name):
            return lambda columns, _shared: columns[name]
        case Sum((first, *terms)):
            return _in_turn(
                part_of(first, known), [(operator.add, part_of(term, known)) for term in terms]
            )
        case Product((first, *factors)):
            return _in_turn(
                part_of(first, known), [_factor_part(factor, known) for factor in factors]
            )
        case Power() | Call():
            return _computed_once(expression, known)
    raise TypeError(f"not an expression: {expression!r}")


def _in_turn(first: Part, others: Sequence[tuple[Callable[[Any, Any], Any], Part]]) -> Part:
    """Return a function that computes a chain such as `a + b - c` from left to right. `others`
    holds the operation and the operand of each further step.
    """

    def total(columns: Mapping[str, Value], shared: Shared) -> Value:
        value = first(columns, shared)
        for combined, other in others:
            value = combined(value, other(columns, shared))
        return value

    return total


def _factor_part(factor: Expression, known: Known) -> tuple[Callable[[Any, Any], Any], Part]:
    if isinstance(factor, Power) and factor.exponent < 0:
        return operator.truediv, _power(factor.base, -factor.exponent, known)
    return operator.mul, part_of(factor, known)


def _computed_once(expression: Power | Call, known: Known) -> Part:
    """Return a function that computes the value of a power or call when it is first needed, and
    afterwards returns the stored value.
    """
    if expression not in known:
        compute, slot = _computed(expression, known), len(known)

        def value(columns: Mapping[str, Value], shared: Shared) -> Value:
            result = shared[slot]
            if result is None:
                result = shared[slot] = compute(columns, shared)
            return result

        known[expression] = value
    return known[expression]


def _computed(expression: Power | Call, known: Known) -> Part:
    match expression:
        case Call(function, argument):
            compute, inner = FUNCTIONS[function].compute, part_of(argument, known)
            return lambda columns, shared: compute(inner(columns, shared))
        case Power(base, exponent) if exponent < 0:
            divisor = _power(base, -exponent, known)
            return lambda columns, shared: np.float64(1.0) / divisor(columns, shared)
        case Power(base, exponent) if exponent.is_integer():
            # a few multiplications, as in x^5 = x^2 x^3, are far faster than a call of `pow`
            half = exponent // 2
            left, right = _power(base, half, known), _power(base, exponent - half, known)
            return lambda columns, shared: left(columns, shared) * right(columns, shared)
        case Power(base, exponent):
            raised = part_of(base, known)
            return lambda columns, shared: np.power(raised(columns, shared), exponent)


def _power(base: Expression, exponent: float, known: Known) -> Part:
    return part_of(base if exponent == 1.0 else Power(base, exponent), known)
