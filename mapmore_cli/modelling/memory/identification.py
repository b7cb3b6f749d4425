"""Numbers of operators that training finds: `wen(force[k-1])` has none in its name; a grid is scanned, and the best are refined.

The scan is one step ahead: for every set of starting numbers FROLS chooses the terms, and the sets of least error are kept. They are
refined together with all coefficients in free run. From random starts few searches end at the best model; from the grid most do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, product
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.fits import Identified
from mapmore_cli.modelling.expressions import Name, parse, substitute, to_text
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import Measured, Operated, State, state

DIGITS = 10
"""Significant digits of a number that was found; its standard error is far larger."""

ALL = 64
"""Sets of starting numbers up to which every one is tried."""

AT_BOUND = 1e-6
"""Of the way between the bounds: a number so near to one lies on it."""


def is_open(found: State) -> bool:
    """Whether training has to find the numbers of the operator itself."""
    return isinstance(found, Operated) and not found.numbers and OPERATORS[found.operator].starts is not None


class _Place(NamedTuple):
    """One number: the state that it belongs to, its key, its bounds."""

    state: Operated
    key: str
    low: float
    high: float


@dataclass(frozen=True)
class Unknown:
    """The numbers that some terms leave open.

    - `states`: operators without their numbers, the innermost first, each once; those of fewer terms keep their order.
    - `step`, `longest`: time between samples and duration of the longest piece, s.
    """

    states: tuple[Operated, ...]
    step: float
    longest: float

    @property
    def places(self) -> tuple[_Place, ...]:
        """(m) every number."""
        return tuple(
            _Place(one, parameter.key, *parameter.between(self.step, self.longest))
            for one in self.states
            for parameter in OPERATORS[one.operator].parameters
            if parameter.between is not None
        )

    @property
    def bounds(self) -> Array:
        """(m, 2) least and greatest place of each number in the search."""
        return np.array([[_place(place.low, place), _place(place.high, place)] for place in self.places]).reshape(-1, 2)

    def grids(self) -> tuple[tuple[tuple[float, ...], ...], ...]:
        """Return the starting numbers of each state, within the bounds."""
        sets = []
        for one in self.states:
            starts = OPERATORS[one.operator].starts
            assert starts is not None
            sets.append(starts(self.step, self.longest))
        return tuple(sets)

    def searched(self, numbers: Sequence[float]) -> Array:
        """(m,) where numbers lie in the search: those that are positive by their logarithm."""
        places = [_place(number, place) for number, place in zip(numbers, self.places, strict=True)]
        return np.clip(places, *self.bounds.T) if places else np.empty(0)

    def numbers(self, searched: Array, digits: int = 17) -> tuple[float, ...]:
        """Return the numbers at a place of the search, to so many significant digits."""
        values = (np.exp(at) if place.low > 0 else at for at, place in zip(searched.tolist(), self.places, strict=True))
        return tuple(float(f"{value:.{digits}g}") + 0.0 for value in values)

    def filled(self, texts: Sequence[str], numbers: Sequence[float]) -> tuple[str, ...]:
        """Return the terms with the numbers in their states' names."""
        rest, own = list(numbers), {}
        for one in self.states:
            count = len(OPERATORS[one.operator].parameters)
            own[one], rest = tuple(rest[:count]), rest[count:]
        return tuple(_renamed(text, lambda found: _with(found, own).name) for text in texts)

    def found(self, searched: Array, errors: Array) -> Identified:
        """Numbers with their standard errors and bounds, from those of the search."""
        numbers = self.numbers(searched, DIGITS)
        names = [f"{place.key} of {place.state.name}" for place in self.places]
        scale = [number if place.low > 0 else 1.0 for number, place in zip(numbers, self.places, strict=True)]
        low, high = self.bounds.T
        near = AT_BOUND * (high - low)
        held = (searched <= low + near) | (searched >= high - near)
        return Identified(tuple(names), np.array(numbers), np.where(held, np.nan, errors * np.array(scale)), held)


def unknown(texts: Sequence[str], step: float, longest: float) -> Unknown:
    """Return what the terms leave open."""
    states = {part for text in texts for name in parse(text).names for part in _parts(state(name))}
    found = sorted((part for part in states if isinstance(part, Operated) and is_open(part)), key=lambda one: (len(one.name), one.name))
    return Unknown(tuple(found), step, longest)


Error = Callable[[tuple[float, ...]], float]
"""The error one step ahead with the numbers of all states."""


def scan(open_numbers: Unknown, error: Error, keep: int) -> list[tuple[float, ...]]:
    """Return the `keep` best sets of numbers, the best first: all sets where they are few, else each state over its grid in turn."""
    grids = open_numbers.grids()
    if math.prod(map(len, grids)) <= ALL:
        sets = [tuple(chain(*own)) for own in product(*grids)]
        return sorted(sets, key=error)[:keep]
    best = [grid[len(grid) // 2] for grid in grids]

    def filled(place: int, own: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(chain(*best[:place], own, *best[place + 1 :]))

    ranked: list[tuple[float, ...]] = []
    for place, grid in enumerate(grids):
        ranked = sorted((filled(place, own) for own in grid), key=error)
        size = len(grid[0])
        before = sum(map(len, best[:place]))
        best[place] = ranked[0][before : before + size]
    return ranked[:keep]


def _place(number: float, place: _Place) -> float:
    return float(np.log(max(number, place.low))) if place.low > 0 else float(number)


def _with(found: State, numbers: dict[Operated, tuple[float, ...]]) -> State:
    """Return a state with the numbers of what was left open in it."""
    if isinstance(found, Measured):
        return found
    inner = _with(found.source, numbers)
    return replace(found, source=inner, numbers=numbers[found]) if found in numbers else replace(found, source=inner)


def _renamed(text: str, name_of: Callable[[State], str]) -> str:
    term = parse(text)
    return to_text(substitute(term, {name: Name(name_of(state(name))) for name in term.names}))


def _parts(found: State) -> list[State]:
    return [found] if isinstance(found, Measured) else [*_parts(found.source), found]
