"""Families of candidate terms: states with memory, and products of states and quantities; and how
much memory a dictionary needs.
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
    """Every state `of` so many samples ago, step by step: `force[k-1]`; the state itself for no
    step.
    """
    return tuple(
        (Lagged(state(name), step) if step else state(name)).name for step in steps for name in of
    )


def operated(
    family: str, of: Sequence[str], numbers: Sequence[float | tuple[float, ...]] = ()
) -> tuple[str, ...]:
    """Return operators of a `family` on every state `of`, with each of `numbers` (`slow(pressure,
    0.5)`) or none: `resonance(pressure)`.

    Raises `ValueError` for numbers that do not fit the operator.
    """
    names = [operator.name for operator in families()[family]]
    each = [
        setting if isinstance(setting, tuple) else (float(setting),) for setting in numbers
    ] or [()]
    return tuple(
        state(Operated(name, state(source), setting).name).name
        for setting in each
        for source in of
        for name in names
    )


def products(
    of: Sequence[str], order: int, partners: Sequence[str] | None = None, constant: bool = True
) -> tuple[Expression, ...]:
    """Every product of quantities, states or other terms `of`, of total degree up to `order`; the
    constant first, then degree by degree.

    Within a degree, powers of what is earlier in `of` come first. The factors of a product are in
    alphabetical order, so that its text does not depend on `of`. With `partners`, a product holds
    powers of at most one state besides those of `partners`: for order 2 and one partner p these are
    all states, all squares and p times every state.

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

    Raises ValueError for an order outside 0..20, a state named twice, or a partner that is none
    of the states; DataError if there would be more of them than memory allows, before any is
    built.
    """
    if not 0 <= order <= MAX_EXPONENT:
        raise ValueError(f"the order must lie in 0..{MAX_EXPONENT}, not {order}")
    if len(set(of)) < len(of):
        raise ValueError(f"a name is given twice among {', '.join(of)}")
    free = set(of) if partners is None else set(partners)
    if not free <= set(of):
        raise ValueError(f"the partner {min(free - set(of))} is not one of the states")
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
    """How many products `products` gives of so many states, of which so many are partners, the
    constant included.
    """
    whole = partners + order
    # of partners alone, and with a power of one of the others
    return math.comb(whole, order) + (states - partners) * math.comb(whole, partners + 1)


SHARE = 0.5  # of the installed memory, what one fit may take: other programs need some as well
ASSUMED = 4_000_000_000  # bytes of memory where the system does not say


def products_bytes(candidates: int) -> int:
    """Bytes of what selection needs of a dictionary that is built block by block: three matrices
    (M+1, M+1).
    """
    return 3 * 8 * (candidates + 1) ** 2


def usable_memory() -> int:
    """Bytes that one fit may take."""
    try:
        installed = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        installed = ASSUMED
    return int(SHARE * installed)


def fits_whole(samples: int, candidates: int) -> bool:
    """Whether the whole dictionary may be in memory at once; else it is built block by block."""
    return 8 * samples * candidates <= usable_memory()


def refuse_beyond_memory(candidates: int) -> None:
    """Raise DataError if so many candidates are too many even block by block, saying what they
    would need and what there is.
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
