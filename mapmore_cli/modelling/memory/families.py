"""Families of states with memory, as names; and the products of states that make a dictionary."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import combinations_with_replacement

import numpy as np

from mapmore_cli.modelling.memory.capacity import refuse_beyond_memory
from mapmore_cli.modelling.terms import Expression, multiply, parse, power
from mapmore_cli.modelling.terms.states import OPERATORS, Operated, lagged, state
from mapmore_cli.modelling.terms.syntax import MAX_EXPONENT

WIDEST_PLAY = 0.5
"""Half-width, as a fraction of the range, from which a play never follows."""

QUICKEST, SLOWEST = 10, 0.25
"""Spread time constants lie between so many samples and this fraction of the longest piece."""


def lags(of: Sequence[str], steps: Sequence[int]) -> tuple[str, ...]:
    """Every state `of` so many samples ago, step by step: `force[k-1]`; the state itself for no step."""
    return tuple(lagged(state(name), step).name for step in steps for name in of)


def delays(of: Sequence[str], times: Sequence[float], step: float) -> tuple[str, ...]:
    """Every state `of` so many seconds ago, to the nearest sample of `step` seconds; each once."""
    return tuple(dict.fromkeys(lags(of, [round(time / step) for time in times])))


def operated(operator: str, of: Sequence[str], numbers: Sequence[float] = ()) -> tuple[str, ...]:
    """`operator` on every state `of`, with each of `numbers`: `slow(pressure, 0.5)`; without numbers once, as `resonance(pressure)`.

    Raises `ValueError` for an operator that does not take one number, where numbers are given.
    """
    if len(numbers) and 1 not in OPERATORS[operator]:
        raise ValueError(f"`{operator}` does not take one number")
    each: list[tuple[float, ...]] = [(float(number),) for number in numbers] or [()]
    return tuple(_operation(operator, name, own) for own in each for name in of)


def resonances(of: Sequence[str], numbers: tuple[float, float] | tuple[()] = ()) -> tuple[str, ...]:
    """Position and velocity of an oscillator for each state `of`: of frequency (Hz) and damping `numbers`, or as training finds it."""
    return tuple(_operation(operator, one, numbers) for one in of for operator in ("resonance", "resonance_velocity"))


def _operation(operator: str, of: str, numbers: tuple[float, ...]) -> str:
    return state(Operated(operator, state(of), numbers).name).name


def spread_widths(count: int) -> tuple[float, ...]:
    """`count` half-widths of play or stop, evenly over those that can move, as fractions of the training range."""
    return tuple(round(WIDEST_PLAY * (i + 1) / (count + 1), 4) for i in range(count))


def spread_times(count: int, step: float, longest: float) -> tuple[float, ...]:
    """`count` time constants, s, in even ratios from ten samples of `step` seconds to a quarter of the `longest` piece, s."""
    quickest = QUICKEST * step
    times = np.geomspace(quickest, max(SLOWEST * longest, quickest), count)
    return tuple(dict.fromkeys(float(f"{time:.3g}") for time in times))


def products(of: Sequence[str], order: int, partners: Sequence[str] | None = None, constant: bool = True) -> tuple[Expression, ...]:
    """Every product of states (or other terms) `of` of total degree up to `order`, as `terms.monomials`; or only those with few partners.

    With `partners`, a product holds powers of at most one state besides those of `partners`: for order 2 and one partner p these are all
    states, all squares and p times every state.

    Examples
    --------
    >>> from mapmore_cli.modelling.terms import to_text
    >>> [to_text(term) for term in products(["p", "play(p, 0.1)", "p[k-1]"], 2, partners=["p"], constant=False)]
    ['p', 'play(p, 0.1)', 'p[k-1]', 'p^2', 'p*play(p, 0.1)', 'p*p[k-1]', 'play(p, 0.1)^2', 'p[k-1]^2']

    Raises
    ------
    ValueError
        For an order outside of 0..20, a state named twice, or a partner that is none of the states.
    DataError
        Where there would be more of them than memory allows, before any is built.
    """
    if not 0 <= order <= MAX_EXPONENT:
        raise ValueError(f"the order of products must lie in 0..{MAX_EXPONENT}, not {order}")
    if len(set(of)) < len(of):
        raise ValueError(f"a state is named twice among {', '.join(of)}")
    free = set(of) if partners is None else set(partners)
    if not free <= set(of):
        raise ValueError(f"the partner {min(free - set(of))} is none of the states")
    refuse_beyond_memory(count_products(len(of), order, len(free)))
    degrees = range(0 if constant else 1, order + 1)
    chosen = [names for degree in degrees for names in combinations_with_replacement(of, degree) if len(set(names) - free) <= 1]
    trees = {name: parse(name) for name in of}
    return tuple(multiply(*(power(trees[name], count) for name, count in sorted(Counter(names).items()))) for names in chosen)


def count_products(states: int, order: int, partners: int) -> int:
    """How many products `products` gives of so many states, of which so many are partners, the constant included."""
    of_partners = math.comb(partners + order, order)
    with_another = sum(math.comb(partners + order - degree, order - degree) for degree in range(1, order + 1))
    return math.comb(states + order, order) if partners == states else of_partners + (states - partners) * with_another
