"""Families of states with memory: their names, and from names to numbers (ranges, resonances, scales) by the training samples alone."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import MemoryModel, StateSet
from mapmore_cli.modelling.memory.evaluation import Known, value_of
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.regressors import refuse_beyond_memory
from mapmore_cli.modelling.memory.resonances import find_resonance
from mapmore_cli.modelling.terms import Expression, multiply, parse, power
from mapmore_cli.modelling.terms.operators import OPERATORS, families
from mapmore_cli.modelling.terms.states import Measured, Operated, State, lagged, state
from mapmore_cli.modelling.terms.syntax import MAX_EXPONENT


def lags(of: Sequence[str], steps: Sequence[int]) -> tuple[str, ...]:
    """Every state `of` so many samples ago, step by step: `force[k-1]`; the state itself for no step."""
    return tuple(lagged(state(name), step).name for step in steps for name in of)


def delays(of: Sequence[str], times: Sequence[float], step: float) -> tuple[str, ...]:
    """Every state `of` so many seconds ago, to the nearest sample of `step` seconds; each once."""
    return tuple(dict.fromkeys(lags(of, [round(time / step) for time in times])))


def operated(family: str, of: Sequence[str], numbers: Sequence[float | tuple[float, ...]] = ()) -> tuple[str, ...]:
    """The operators of a `family` on every state `of`, with each of `numbers`: `slow(pressure, 0.5)`; or without, `resonance(pressure)`.

    Raises `ValueError` for numbers that do not fit the operator.
    """
    names = [operator.name for operator in families()[family]]
    each = [own if isinstance(own, tuple) else (float(own),) for own in numbers] or [()]
    return tuple(state(Operated(name, state(one), own).name).name for own in each for one in of for name in names)


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


def resolve(names: Sequence[str], records: Sequence[Record], target: str, step: float, *, scale: bool, margin: float) -> StateSet:
    """The states of these names, with every number that they need.

    Parameters
    ----------
    names
        Texts of states; each once.
    target
        The output: `resonance` without numbers is the oscillator that explains most of it.
    step
        Time between samples, s.
    scale
        Whether states are scaled to [0, 1] on the training samples and clipped `margin` beyond.

    Raises
    ------
    DataError
        Where a quantity is missing, or no training sample has a value of every state.
    """
    states = StateSet(tuple(names), step, {}, {}, np.empty(0), np.empty(0), margin)
    known: list[Known] = [{} for _ in records]
    for found in dict.fromkeys(part for name in names for part in _parts(state(name))):
        if isinstance(found, Operated):
            states = _numbered(found, records, target, states, known)
    if not scale:
        return states
    limits = [_range(_training_values(state(name), records, states, known), name) for name in names]
    return replace(states, low=np.array([low for low, _ in limits]), high=np.array([high for _, high in limits]))


def _parts(found: State) -> Iterator[State]:
    """The state and all that it is made of, the innermost first."""
    if not isinstance(found, Measured):
        yield from _parts(found.source)
    yield found


def _numbered(found: Operated, records: Sequence[Record], target: str, states: StateSet, known: list[Known]) -> StateSet:
    name, needs = found.source.name, OPERATORS[found.operator].needs
    if needs == "range" and name not in states.ranges:
        return replace(states, ranges={**states.ranges, name: _range(_training_values(found.source, records, states, known), name)})
    if needs == "oscillator" and not found.numbers and name not in states.resonances:
        driving = [value_of(found.source, record.columns, states, own) for record, own in zip(records, known, strict=True)]
        oscillator = find_resonance(driving, [record.columns[target] for record in records], [r.training for r in records], states.step)
        return replace(states, resonances={**states.resonances, name: oscillator})
    return states


def _training_values(found: State, records: Sequence[Record], states: StateSet, known: list[Known]) -> Array:
    return np.concatenate(
        [value_of(found, record.columns, states, own)[record.training] for record, own in zip(records, known, strict=True)]
    )


def _range(values: Array, name: str) -> tuple[float, float]:
    values = values[np.isfinite(values)]
    if not len(values):
        raise DataError(f"`{name}` has no value on any training sample", "use fewer steps of delay, or longer recordings")
    return float(values.min()), float(values.max())


def memory_inputs(memory: MemoryModel) -> tuple[str, ...]:
    """Every quantity that the states are made of, besides the output."""
    return tuple(sorted({state(name).quantity for name in memory.states.names} - {memory.output}))
