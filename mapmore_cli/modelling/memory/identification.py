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

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.memory import Identified
from mapmore_cli.modelling.expressions import Name, parse, substitute, to_text
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import Measured, Operated, State, state

DIGITS = 10  # significant digits of a number that was found; its standard error is far larger
ALL = 64  # sets of starting numbers up to which every one is tried
AT_BOUND = 1e-6  # of the way between the bounds: a number so near to one lies on it


class _Place(NamedTuple):
    """One number: the state that it belongs to, its key, its bounds. It is searched by its logarithm where it is positive."""

    state: Operated
    key: str
    low: float
    high: float

    def searched(self, number: float) -> float:
        return float(np.log(max(number, self.low))) if self.low > 0 else float(number)

    def number(self, searched: float, digits: int) -> float:
        return float(f"{np.exp(searched) if self.low > 0 else searched:.{digits}g}") + 0.0


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
        return np.array([[place.searched(place.low), place.searched(place.high)] for place in self.places]).reshape(-1, 2)

    def those_of(self, part: Unknown) -> BoolArray:
        """(m,) whether a number is one of `part`, too."""
        return np.array([place.state in part.states for place in self.places], dtype=np.bool_)

    def searched(self, numbers: Sequence[float]) -> Array:
        """(m,) where numbers lie in the search."""
        places = np.array([place.searched(number) for number, place in zip(numbers, self.places, strict=True)])
        return np.asarray(np.clip(places, *self.bounds.T))

    def numbers(self, searched: Array, digits: int = 17) -> tuple[float, ...]:
        """Return the numbers at a place of the search, to so many significant digits."""
        return tuple(place.number(at, digits) for at, place in zip(searched.tolist(), self.places, strict=True))

    def filled(self, texts: Sequence[str], numbers: Sequence[float]) -> tuple[str, ...]:
        """Return the terms with the numbers in their states' names."""
        rest, own = list(numbers), {}
        for one in self.states:
            count = len(OPERATORS[one.operator].parameters)
            own[one], rest = tuple(rest[:count]), rest[count:]
        return tuple(
            to_text(substitute(term, {name: Name(_with(state(name), own).name) for name in term.names})) for term in map(parse, texts)
        )

    def found(self, searched: Array, errors: Array) -> Identified:
        """Numbers with their standard errors and bounds, from those of the search."""
        numbers = self.numbers(searched, DIGITS)
        names = tuple(f"{place.key} of {place.state.name}" for place in self.places)
        scale = np.array([number if place.low > 0 else 1.0 for number, place in zip(numbers, self.places, strict=True)])
        low, high = self.bounds.T
        near = AT_BOUND * (high - low)
        held = (searched <= low + near) | (searched >= high - near)
        return Identified(names, np.array(numbers), np.where(held, np.nan, errors * scale), held)

    def scan(self, error: Callable[[tuple[float, ...]], float], keep: int) -> list[tuple[float, ...]]:
        """Return the `keep` best sets of starting numbers, the best first, by the `error` one step ahead with the numbers of all states.

        All sets are tried where they are few, else each state over its grid in turn.
        """
        grids = [starts(self.step, self.longest) for one in self.states if (starts := OPERATORS[one.operator].starts) is not None]

        def ranked(sets: Sequence[tuple[tuple[float, ...], ...]]) -> list[tuple[tuple[float, ...], ...]]:
            return sorted(sets, key=lambda own: error(tuple(chain(*own))))

        if math.prod(map(len, grids)) <= ALL:
            best = ranked(list(product(*grids)))
        else:
            best = [tuple(grid[len(grid) // 2] for grid in grids)]
            for place, grid in enumerate(grids):
                best = ranked([(*best[0][:place], own, *best[0][place + 1 :]) for own in grid])
        return [tuple(chain(*own)) for own in best[:keep]]


def unknown(texts: Sequence[str], step: float, longest: float) -> Unknown:
    """Return what the terms leave open."""
    parts = {part for text in texts for name in parse(text).names for part in state(name).parts if isinstance(part, Operated)}
    found = [part for part in parts if not part.numbers and OPERATORS[part.operator].starts is not None]
    return Unknown(tuple(sorted(found, key=lambda one: (len(one.name), one.name))), step, longest)


def _with(found: State, numbers: dict[Operated, tuple[float, ...]]) -> State:
    """Return a state with the numbers of what was left open in it."""
    if isinstance(found, Measured):
        return found
    inner = _with(found.source, numbers)
    return replace(found, source=inner, numbers=numbers[found]) if found in numbers else replace(found, source=inner)
