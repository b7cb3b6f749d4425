"""Define the syntax tree of expressions, and constructors that keep it in a simple canonical form.

Build trees with `add`, `multiply`, `power` and `call`. They flatten nested sums and products, drop
zeros and ones, and fold the numbers of a product into one number in front. Subtraction is written
as a factor of -1 and division as an exponent of -1, so that six kinds of nodes are enough. Folding
changes no finite value, apart from rounding.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar, Union, dataclass_transform

from mapmore_cli.modelling.expressions.functions import FUNCTIONS
from mapmore_cli.modelling.expressions.states import IDENTIFIER, ExpressionError, state

MAX_EXPONENT = 20

Class = TypeVar("Class", bound=type)
# types of the operands in an arithmetic operation with an expression
Operand = Union["Expression", float]
Operation = Callable[[Any, Operand], "Expression"]


@dataclass_transform(frozen_default=True)
def _node(cls: Class) -> Class:
    """Turn the class into a frozen dataclass whose objects store their hash. Computing the hash of
    a tree visits all its nodes. Because trees are often keys of dictionaries, the hash is computed
    only once.
    """
    made: Any = dataclass(frozen=True)(cls)
    walked = made.__hash__

    def kept(self: object) -> int:
        held = vars(self)
        if "_hash" not in held:
            held["_hash"] = walked(self)
        return int(held["_hash"])

    made.__hash__ = kept
    return cls  # the dataclass decorator changes the class in place


def _both_ways(made: Callable[[Expression, Expression], Expression]) -> tuple[Operation, Operation]:
    """Return the two methods of a binary operator of Python, for example `__sub__` and `__rsub__`.
    `self` is the left operand in the first method, and the right operand in the second. The other
    operand is an expression or a number.
    """
    return lambda left, right: made(left, expression(right)), lambda right, left: made(
        expression(left), right
    )


def _compared(comparison: str) -> Callable[[Any, Operand], Condition]:
    return lambda left, right: Condition(left, comparison, expression(right))


@_node
class Expression:
    """Base class of the nodes of a syntax tree. Nodes are immutable, comparable and hashable."""

    def __getstate__(self) -> dict[str, object]:
        """Return the attributes to pickle, without the hash, because hashes differ between
        processes.
        """
        return {name: value for name, value in self.__dict__.items() if name != "_hash"}

    @cached_property
    def names(self) -> frozenset[str]:
        """All names that occur in the expression."""
        match self:
            case Sum(parts) | Product(parts):
                return names_in(parts)
            case Power(part) | Call(_, part):
                return part.names
        return frozenset()

    # For `NumPy number + expression`, NumPy then leaves the operation to `__radd__` of this class.
    # The same is true for the other operators.
    __array_ufunc__ = None

    __add__, __radd__ = _both_ways(lambda left, right: add(left, right))
    __sub__, __rsub__ = _both_ways(lambda left, right: add(left, negate(right)))
    __mul__, __rmul__ = _both_ways(lambda left, right: multiply(left, right))
    __truediv__, __rtruediv__ = _both_ways(lambda left, right: multiply(left, power(right, -1)))
    __lt__, __le__, __gt__, __ge__ = (
        _compared("<"),
        _compared("<="),
        _compared(">"),
        _compared(">="),
    )

    def __pow__(self, exponent: float) -> Expression:
        return power(self, exponent)

    def __neg__(self) -> Expression:
        return negate(self)


@_node
class Number(Expression):
    """A finite number."""

    value: float
    names = frozenset[str]()

    def __post_init__(self) -> None:
        if not math.isfinite(self.value):
            raise ExpressionError(f"{self.value} is not a finite number")
        # -0.0 becomes 0.0, because the text of an expression cannot show the sign of zero
        object.__setattr__(self, "value", self.value + 0.0)


@_node
class Name(Expression):
    """A quantity or a parameter, given by an identifier that is no name of a function; or a state
    with memory, given by its canonical text.
    """

    name: str

    def __post_init__(self) -> None:
        if not IDENTIFIER.fullmatch(self.name):
            if state(self.name).name != self.name:
                raise ExpressionError(f"`{self.name}` must be written `{state(self.name).name}`")
        elif self.name in FUNCTIONS:
            raise ExpressionError(
                f"`{self.name}` is a function and cannot be the name of a quantity"
            )

    @property
    def names(self) -> frozenset[str]:
        """Set that contains this name only."""
        return frozenset((self.name,))


@_node
class Sum(Expression):
    """A sum of two or more terms."""

    terms: tuple[Expression, ...]


@_node
class Product(Expression):
    """A product of two or more factors. A factor with a negative exponent stands for a division."""

    factors: tuple[Expression, ...]


@_node
class Power(Expression):
    """A power with a constant exponent, whose magnitude is at most `MAX_EXPONENT`."""

    base: Expression
    exponent: float

    def __post_init__(self) -> None:
        if not abs(self.exponent) <= MAX_EXPONENT:
            raise ExpressionError(
                f"the exponent {self.exponent:g} is too large: its magnitude may be at most "
                f"{MAX_EXPONENT}"
            )


@_node
class Call(Expression):
    """A call of one of `FUNCTIONS` with one argument."""

    function: str
    argument: Expression


@dataclass(frozen=True)
class Condition:
    """Comparison of two expressions with `<`, `<=`, `>`, `>=` or `==`. It is false if one of the
    sides is NaN.
    """

    left: Expression
    comparison: str
    right: Expression

    def __bool__(self) -> bool:
        raise TypeError(
            "the condition has no value before the program runs; use the function `where` "
            "for a branch"
        )


ZERO, ONE = Number(0.0), Number(1.0)


def expression(value: Operand) -> Expression:
    """Return an expression unchanged, or convert a number to an expression."""
    return value if isinstance(value, Expression) else Number(float(value))


def add(*terms: Expression) -> Expression:
    """Return the sum of `terms` with nested sums flattened, zeros dropped and all numbers folded
    into the first term.
    """
    flat = [
        part
        for term in terms
        for part in (term.terms if isinstance(term, Sum) else (term,))
        if part != ZERO
    ]
    numbers = {place: part.value for place, part in enumerate(flat) if isinstance(part, Number)}
    if numbers and math.isfinite(whole := sum(numbers.values())):
        first, *others = numbers
        flat[first] = Number(whole)
        flat = [part for place, part in enumerate(flat) if place not in others and part != ZERO]
    if len(flat) < 2:
        return flat[0] if flat else ZERO
    return Sum(tuple(flat))


def multiply(*factors: Expression) -> Expression:
    """Return the product of `factors` with nested products flattened, ones dropped and all numbers
    folded into one factor in front.
    """
    flat = [
        part
        for factor in factors
        for part in (factor.factors if isinstance(factor, Product) else (factor,))
    ]
    if ZERO in flat:
        return ZERO
    numbers = _folded([part.value for part in flat if isinstance(part, Number)])
    kept = [*map(Number, numbers), *(part for part in flat if not isinstance(part, Number))]
    if len(kept) < 2:
        return kept[0] if kept else ONE
    return Product(tuple(kept))


def power(base: Expression, exponent: float) -> Expression:
    """Return `base^exponent` in canonical form. For example, the reciprocal of `x^2` is written
    `x^-2`.
    """
    if exponent == 1.0:
        return base
    if exponent == 0.0:
        return ONE
    if exponent == -1.0 and isinstance(base, Power):
        return power(base.base, -base.exponent)
    return Power(base, float(exponent))


def call(function: str, argument: Expression) -> Expression:
    """Return `function(argument)` for one of `FUNCTIONS`."""
    if function not in FUNCTIONS:
        raise ExpressionError(
            f"there is no function `{function}`; there are {', '.join(FUNCTIONS)}"
        )
    return Call(function, argument)


def negate(expression: Expression) -> Expression:
    """Return `-expression`."""
    return multiply(Number(-1.0), expression)


def names_in(expressions: Iterable[Expression]) -> frozenset[str]:
    """Return every name that occurs in any of the expressions."""
    return frozenset[str]().union(*(expression.names for expression in expressions))


def with_parts(expression: Expression, change: Callable[[Expression], Expression]) -> Expression:
    """Return the expression in canonical form with `change` applied to each of its operands. A name
    or a number has no operands and is returned unchanged.
    """
    match expression:
        case Sum(terms):
            return add(*map(change, terms))
        case Product(factors):
            return multiply(*map(change, factors))
        case Power(base, exponent):
            return power(change(base), exponent)
        case Call(function, argument):
            return call(function, change(argument))
    return expression


def _folded(numbers: list[float]) -> list[float]:
    """Return a shorter list of numbers with the same product: an empty list if the product is one,
    otherwise the product as the only number. If the product would overflow or lose digits, the list
    has the magnitudes of all numbers except those with the magnitude one, and the first of them
    gets the sign of the product.
    """
    product = math.prod(numbers)
    if sys.float_info.min <= abs(product) < math.inf:
        return [] if product == 1.0 else [product]
    magnitudes = [abs(number) for number in numbers if abs(number) != 1.0]
    sign = math.prod(math.copysign(1.0, number) for number in numbers)
    return [sign * magnitudes[0], *magnitudes[1:]]
