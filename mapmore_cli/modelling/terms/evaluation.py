"""Values of expressions on columns of samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.terms.errors import NotFinite
from mapmore_cli.modelling.terms.functions import FUNCTIONS
from mapmore_cli.modelling.terms.printing import to_text
from mapmore_cli.modelling.terms.syntax import Call, Expression, Name, Number, Power, Product, Sum

BLOCK = 8192
"""Rows at a time in `dictionary_matrix`: shared powers of a block stay in the processor's cache, and memory stays bounded."""

_Value = Array | np.float64
_Shared = dict[Expression, _Value]


def evaluate(expression: Expression, columns: Columns, n: int | None = None) -> Array:
    """Value of `expression` on every row, `(n,)`; a new array.

    Parameters
    ----------
    columns
        Quantities by name, each `(n,)`, or `()` for a parameter that holds for every row.
    n
        Number of rows; the length of the first column where it is left out.

    Values that are not finite (a logarithm of a negative number, a division by zero) are left in, without a warning.
    Raises `DataError` where a column is absent or of another length.
    """
    rows = _length(columns) if n is None else n
    values = _needed(expression.names, columns, rows)
    with np.errstate(all="ignore"):
        return np.array(np.broadcast_to(_value(expression, values, {}), (rows,)), dtype=float)


def dictionary_matrix(terms: Sequence[Expression], columns: Columns, n: int) -> Array:
    """Regressors `P`, `(n, M)` in Fortran order: column j is term j on every row (M2 eq 2).

    Powers and function values that several terms share are computed once.
    Raises `NotFinite` with the first row where a term has no finite value, `DataError` as `evaluate` does.
    """
    values = _needed(frozenset[str]().union(*(term.names for term in terms)), columns, n)
    matrix = np.empty((n, len(terms)), order="F")
    for start in range(0, n, BLOCK):
        block = {name: value[start : start + BLOCK] if value.ndim else value for name, value in values.items()}
        shared: _Shared = {}
        for j, term in enumerate(terms):
            column = matrix[start : start + BLOCK, j]
            with np.errstate(all="ignore"):
                column[:] = _value(term, block, shared)
            if not np.isfinite(column).all():
                raise _not_finite(term, values, start + int(np.argmin(np.isfinite(column))))
    return matrix


def constant_value(expression: Expression) -> float:
    """Value of an expression without names; NaN or infinite where it has none."""
    with np.errstate(all="ignore"):
        return float(_value(expression, {}, {}))


def _value(expression: Expression, columns: Columns, shared: _Shared) -> _Value:
    match expression:
        case Number(value):
            return np.float64(value)
        case Name(name):
            return columns[name]
        case Sum(terms):
            total = _value(terms[0], columns, shared)
            for term in terms[1:]:
                total = total + _value(term, columns, shared)
            return total
        case Product(factors):
            return _product(factors, columns, shared)
        case Power() | Call():
            if expression not in shared:
                shared[expression] = _computed(expression, columns, shared)
            return shared[expression]
    raise TypeError(f"not an expression: {expression!r}")


def _product(factors: Sequence[Expression], columns: Columns, shared: _Shared) -> _Value:
    total = _value(factors[0], columns, shared)
    for factor in factors[1:]:
        if isinstance(factor, Power) and factor.exponent < 0:
            total = total / _power(factor.base, -factor.exponent, columns, shared)
        else:
            total = total * _value(factor, columns, shared)
    return total


def _computed(expression: Power | Call, columns: Columns, shared: _Shared) -> _Value:
    match expression:
        case Call(function, argument):
            value: _Value = FUNCTIONS[function].compute(_value(argument, columns, shared))
            return value
        case Power(base, exponent) if exponent < 0:
            return np.float64(1.0) / _power(base, -exponent, columns, shared)
        case Power(base, exponent) if exponent.is_integer():
            half = exponent // 2  # x^5 = x^2 x^3: a few multiplications, shared between terms, where a general power costs fifty
            return _power(base, half, columns, shared) * _power(base, exponent - half, columns, shared)
        case Power(base, exponent):
            raised: _Value = np.power(_value(base, columns, shared), exponent)
            return raised


def _power(base: Expression, exponent: float, columns: Columns, shared: _Shared) -> _Value:
    return _value(base if exponent == 1.0 else Power(base, exponent), columns, shared)


def _length(columns: Columns) -> int:
    lengths = [len(column) for column in columns.values() if np.ndim(column)]
    if not lengths:
        raise DataError("the number of rows is unknown: there is no column of samples")
    return lengths[0]


def _needed(names: frozenset[str], columns: Columns, n: int) -> dict[str, Array]:
    missing = sorted(names - columns.keys())
    if missing:
        raise DataError(f"there is no column `{missing[0]}`", f"there are: {', '.join(columns) or 'none'}")
    needed = {name: np.asarray(columns[name], dtype=float) for name in sorted(names)}
    for name, column in needed.items():
        if column.shape not in ((n,), ()):
            raise DataError(f"the column `{name}` has the shape {column.shape}, expected ({n},)")
    return needed


def _not_finite(term: Expression, columns: Columns, row: int) -> NotFinite:
    inputs = ", ".join(f"{name} = {columns[name] if columns[name].ndim == 0 else columns[name][row]:.6g}" for name in sorted(term.names))
    return NotFinite(to_text(term), row, inputs)
