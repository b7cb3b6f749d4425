"""Build families of candidate terms: delayed states, states of operators such as `slow`, and
products. Also compute how many bytes of the computer's memory a dictionary needs.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Sequence
from itertools import combinations_with_replacement

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions.operators import families
from mapmore_cli.modelling.expressions.parsing import candidate
from mapmore_cli.modelling.expressions.states import Lagged, Operated, state
from mapmore_cli.modelling.expressions.syntax import MAX_EXPONENT, Expression, multiply, power


def lags(of: Sequence[str], steps: Sequence[int]) -> tuple[str, ...]:
    """Return the names of all states in `of`, delayed by each number of samples in `steps`, for
    example `force[k-1]`. All states with the first delay come first, in the order of `of`, then all
    states with the next delay. A delay of 0 gives the state itself.
    """
    return tuple(
        (Lagged(state(name), step) if step else state(name)).name for step in steps for name in of
    )


def operated(
    family: str, of: Sequence[str], numbers: Sequence[tuple[float, ...]] = ()
) -> tuple[str, ...]:
    """Return the names of the states that the operators of a `family` compute from every state in
    `of`. Each entry of `numbers` holds the numbers in a name, for example `(0.5,)` for
    `slow(pressure, 0.5)`. If `numbers` is empty, the names have no numbers, for example
    `resonance(pressure)`.

    Raises ValueError for numbers that do not fit the operator.
    """
    names = [operator.name for operator in families()[family]]
    return tuple(
        state(Operated(name, state(source), setting).name).name
        for setting in numbers or [()]
        for source in of
        for name in names
    )


def products(
    of: Sequence[str], order: int, partners: Sequence[str] | None = None, constant: bool = True
) -> tuple[Expression, ...]:
    """Return every product of the terms in `of` (quantities, states or other terms) with a total
    degree up to `order`: first the constant, then degree by degree.

    Products of the same degree are sorted by the order of the terms in `of`. The factors of a
    product are in alphabetical order, so that its text does not depend on the order of `of`. With
    `partners`, a product may contain any number of partners, but only one term that is no partner
    (or a power of this term). For order 2 and one partner p, the result contains all terms, their
    squares, and the products of p with every other term.

    Examples
    --------
    >>> from mapmore_cli.modelling.expressions import to_text
    >>> [to_text(term) for term in products(["strain", "pressure"], 2)]
    ['1', 'strain', 'pressure', 'strain^2', 'pressure*strain', 'pressure^2']
    >>> states = ["p", "play(p, 0.1)", "p[k-1]"]
    >>> [to_text(term) for term in products(states, 2, partners=["p"], constant=False)]
    ... # doctest: +NORMALIZE_WHITESPACE
    ['p', 'play(p, 0.1)', 'p[k-1]', 'p^2', 'p*play(p, 0.1)', 'p*p[k-1]', 'play(p, 0.1)^2',
     'p[k-1]^2']

    Raises ValueError for an order outside 0..20, a term named twice, or a partner that is not in
    `of`. Raises DataError, before any product is built, if there would be more products than
    memory allows.
    """
    if not 0 <= order <= MAX_EXPONENT:
        raise ValueError(f"the order must lie in 0..{MAX_EXPONENT}, not {order}")
    if len(set(of)) < len(of):
        raise ValueError(f"a name is given twice among {', '.join(of)}")
    free = set(of) if partners is None else set(partners)
    if not free <= set(of):
        raise ValueError(f"`partners` names `{min(free - set(of))}`, which is not in `of`")
    refuse_beyond_memory(count_products(len(of), order, len(free)))
    degrees = range(0 if constant else 1, order + 1)
    chosen = [
        names
        for degree in degrees
        for names in combinations_with_replacement(of, degree)
        if len(set(names) - free) <= 1
    ]
    trees = {name: candidate(name) for name in of}
    return tuple(
        multiply(*(power(trees[name], count) for name, count in sorted(Counter(names).items())))
        for names in chosen
    )


def count_products(states: int, order: int, partners: int) -> int:
    """Return how many products the function `products` returns, including the constant. `states` is
    the number of terms in `of`, and `partners` is the number of partners among them.
    """
    whole = partners + order
    # products of partners alone, plus products that contain one state that is no partner
    return math.comb(whole, order) + (states - partners) * math.comb(whole, partners + 1)


SHARE = 0.5  # fraction of the installed memory that one fit may use
ASSUMED = 4_000_000_000  # bytes of memory, if the system does not report its installed memory


def products_bytes(candidates: int) -> int:
    """Return the number of bytes that the term selection needs for M `candidates` if the dictionary
    is built block by block. These are three matrices of shape (M+1, M+1).
    """
    return 3 * 8 * (candidates + 1) ** 2


def usable_memory() -> int:
    """Return the number of bytes that one fit may use."""
    try:
        installed = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        installed = ASSUMED
    return int(SHARE * installed)


def fits_whole(samples: int, candidates: int) -> bool:
    """Return True if the regressor matrix of all samples and candidates is small enough to be kept
    in memory. Otherwise, it is built block by block.
    """
    return 8 * samples * candidates <= usable_memory()


def refuse_beyond_memory(candidates: int) -> None:
    """Raise DataError if the term selection needs more memory (`products_bytes`) than one fit may
    use, even if the dictionary is built block by block. The message gives both sizes.
    """
    needed, room = products_bytes(candidates), usable_memory()
    if needed > room:
        sizes = [
            f"{size / 1e9:.3g} GB" if size >= 1e8 else f"{size / 1e6:.3g} MB"
            for size in (needed, room)
        ]
        raise DataError(
            f"the products of a dictionary with {candidates} candidates need {sizes[0]} of "
            f"memory; {sizes[1]} may be used",
            "lower the order of the products, use fewer states, or restrict the products "
            "with `with`",
        )
