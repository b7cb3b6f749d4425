"""Expressions made ready to be evaluated many times: the tree is walked once, and parts that occur again are computed once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mapmore_cli.domain.arrays import Value
from mapmore_cli.modelling.terms.functions import FUNCTIONS
from mapmore_cli.modelling.terms.syntax import Call, Expression, Name, Number, Power, Product, Sum

Shared = list[Value | None]
"""What was computed so far of the parts that may occur again."""

Part = Callable[[Mapping[str, Value], Shared], Value]
"""A node with everything below it, as a function of columns."""

Known = dict[Expression, Part]


@dataclass(frozen=True)
class Compiled:
    """Several expressions, to be evaluated together; `slots` is the number of powers and function values in them."""

    parts: tuple[Part, ...]
    slots: int

    def values(self, columns: Mapping[str, Value]) -> Iterator[Value]:
        """The expressions' values one after the other; an array may be a column itself, or shared with a later value: not to be changed."""
        shared: Shared = [None] * self.slots
        for part in self.parts:
            yield part(columns, shared)


@lru_cache(maxsize=4096)
def compiled(expressions: tuple[Expression, ...]) -> Compiled:
    """The program that evaluates `expressions`; powers and function values that several share are computed once."""
    known: Known = {}
    parts = tuple(part_of(expression, known) for expression in expressions)
    return Compiled(parts, len(known))


def part_of(expression: Expression, known: Known) -> Part:
    """Return a node ready to be evaluated; `known` has the powers and function values of those that it is evaluated with."""
    match expression:
        case Number(value):
            constant = np.float64(value)
            return lambda _columns, _shared: constant
        case Name(name):
            return lambda columns, _shared: columns[name]
        case Sum(terms):
            return _sum([part_of(term, known) for term in terms])
        case Product(factors):
            return _product(factors, known)
        case Power() | Call():
            return _once(expression, known)
    raise TypeError(f"not an expression: {expression!r}")


def _sum(terms: Sequence[Part]) -> Part:
    first, *others = terms

    def total(columns: Mapping[str, Value], shared: Shared) -> Value:
        value = first(columns, shared)
        for term in others:
            value = value + term(columns, shared)
        return value

    return total


def _product(factors: Sequence[Expression], known: Known) -> Part:
    first = part_of(factors[0], known)
    others = [(_divides(factor), _divisor(factor, known) if _divides(factor) else part_of(factor, known)) for factor in factors[1:]]

    def total(columns: Mapping[str, Value], shared: Shared) -> Value:
        value = first(columns, shared)
        for divides, factor in others:
            value = value / factor(columns, shared) if divides else value * factor(columns, shared)
        return value

    return total


def _divides(factor: Expression) -> bool:
    return isinstance(factor, Power) and factor.exponent < 0


def _divisor(factor: Expression, known: Known) -> Part:
    assert isinstance(factor, Power)
    return _power(factor.base, -factor.exponent, known)


def _once(expression: Power | Call, known: Known) -> Part:
    """Computed at its first occurrence, and looked up at every other."""
    if expression not in known:
        compute, slot = _computed(expression, known), len(known)

        def value(columns: Mapping[str, Value], shared: Shared) -> Value:
            found = shared[slot]
            if found is None:
                found = shared[slot] = compute(columns, shared)
            return found

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
            half = exponent // 2  # x^5 = x^2 x^3: a few multiplications, shared between terms, where a general power costs fifty
            left, right = _power(base, half, known), _power(base, exponent - half, known)
            return lambda columns, shared: left(columns, shared) * right(columns, shared)
        case Power(base, exponent):
            raised = part_of(base, known)
            return lambda columns, shared: np.power(raised(columns, shared), exponent)


def _power(base: Expression, exponent: float, known: Known) -> Part:
    return part_of(base if exponent == 1.0 else Power(base, exponent), known)
