"""Families of candidate terms."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import combinations_with_replacement

from mapmore_cli.modelling.terms.syntax import MAX_EXPONENT, Expression, Name, multiply, power


def monomials(of: Sequence[str], order: int, constant: bool = True) -> tuple[Expression, ...]:
    """Every monomial of the quantities `of` of total degree up to `order`, `binomial(len(of) + order, order)` with the constant.

    The constant comes first, then degree by degree; within a degree, powers of quantities earlier in `of` come first.
    The factors of a monomial are in alphabetical order, so that its text does not depend on `of`.
    Raises `ValueError` for an order outside of 0..20 and for a quantity named twice, `ExpressionError` for an impossible name.

    Examples
    --------
    >>> from mapmore_cli.modelling.terms import to_text
    >>> [to_text(term) for term in monomials(["strain", "pressure"], 2)]
    ['1', 'strain', 'pressure', 'strain^2', 'pressure*strain', 'pressure^2']
    """
    if not 0 <= order <= MAX_EXPONENT:
        raise ValueError(f"the order of a polynomial must lie in 0..{MAX_EXPONENT}, not {order}")
    if len(set(of)) < len(of):
        raise ValueError(f"a quantity is named twice among {', '.join(of)}")
    degrees = range(0 if constant else 1, order + 1)
    return tuple(_monomial(names) for degree in degrees for names in combinations_with_replacement(of, degree))


def _monomial(names: Sequence[str]) -> Expression:
    return multiply(*(power(Name(name), count) for name, count in sorted(Counter(names).items())))
