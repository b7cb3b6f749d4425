"""Training samples made ready: the numbers that terms leave open, regressors for one step ahead,
pieces for free runs.

Training finds numbers of operators: `wen(force[k-1])` has none in its name. A grid is scanned, one
step ahead: for every set of starting numbers FROLS chooses the terms, and the sets of least error
are kept. They are refined together with all coefficients in free run. From random starts few
searches end at the best model; from the grid most do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import chain, product
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Identified, MemoryFit, MemoryModel, StateSet
from mapmore_cli.modelling.expressions import Name, parse, substitute, to_text
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import Measured, Operated, State, state
from mapmore_cli.modelling.memory.feedback import Feedback, fed_back_states, parted
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.refinement import Coefficients, Problem, standard_errors
from mapmore_cli.modelling.memory.selectors import Choice, regressors, selector
from mapmore_cli.modelling.memory.simulation import (
    Course,
    Piece,
    bounds_of,
    piece_of,
    refuse_unknown_beginning,
)
from mapmore_cli.modelling.memory.states import resolve
from mapmore_cli.modelling.selection import MemoryRecipe

DIGITS = 10  # significant digits of a number that was found; its standard error is far larger
ALL = 64  # sets of starting numbers up to which every one is tried
AT_BOUND = 1e-6  # of the way between the bounds: a number so near to one lies on it


class _Place(NamedTuple):
    """One number: the state that it belongs to, its key, its bounds. It is searched by its
    logarithm where it is positive.
    """

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

    - `states`: operators without their numbers, the innermost first, each once; those of fewer
      terms keep their order.
    - `step`, `longest`: time between samples and duration of the longest piece, s.
    """

    states: tuple[Operated, ...]
    step: float
    longest: float

    @cached_property
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
        return np.array(
            [[place.searched(place.low), place.searched(place.high)] for place in self.places]
        ).reshape(-1, 2)

    def those_of(self, part: Unknown) -> BoolArray:
        """(m,) whether a number is one of `part`, too."""
        return np.array([place.state in part.states for place in self.places], dtype=np.bool_)

    def searched(self, numbers: Sequence[float]) -> Array:
        """(m,) where numbers lie in the search."""
        places = np.array(
            [place.searched(number) for number, place in zip(numbers, self.places, strict=True)]
        )
        return np.asarray(np.clip(places, *self.bounds.T))

    def numbers(self, searched: Array, digits: int = 17) -> tuple[float, ...]:
        """Return the numbers at a place of the search, to so many significant digits."""
        return tuple(
            place.number(at, digits)
            for at, place in zip(searched.tolist(), self.places, strict=True)
        )

    def filled(self, texts: Sequence[str], numbers: Sequence[float]) -> tuple[str, ...]:
        """Return the terms with the numbers in their states' names."""
        rest, own = list(numbers), {}
        for one in self.states:
            count = len(OPERATORS[one.operator].parameters)
            own[one], rest = tuple(rest[:count]), rest[count:]
        return tuple(
            to_text(
                substitute(term, {name: Name(_with(state(name), own).name) for name in term.names})
            )
            for term in map(parse, texts)
        )

    def found(self, searched: Array, errors: Array) -> Identified:
        """Numbers with their standard errors and bounds, from those of the search."""
        numbers = self.numbers(searched, DIGITS)
        names = tuple(f"{place.key} of {place.state.name}" for place in self.places)
        scale = np.array(
            [
                number if place.low > 0 else 1.0
                for number, place in zip(numbers, self.places, strict=True)
            ]
        )
        low, high = self.bounds.T
        near = AT_BOUND * (high - low)
        held = (searched <= low + near) | (searched >= high - near)
        return Identified(names, np.array(numbers), np.where(held, np.nan, errors * scale), held)

    def scan(
        self, error: Callable[[tuple[float, ...]], float], keep: int
    ) -> list[tuple[float, ...]]:
        """Return the `keep` best sets of starting numbers, the best first, by the `error` one step
        ahead with the numbers of all states.

        All sets are tried where they are few, else each state over its grid in turn.
        """
        grids = [
            starts(self.step, self.longest)
            for one in self.states
            if (starts := OPERATORS[one.operator].starts) is not None
        ]

        def ranked(
            sets: Sequence[tuple[tuple[float, ...], ...]],
        ) -> list[tuple[tuple[float, ...], ...]]:
            return sorted(sets, key=lambda own: error(tuple(chain(*own))))

        if math.prod(map(len, grids)) <= ALL:
            best = ranked(list(product(*grids)))
        else:
            best = [tuple(grid[len(grid) // 2] for grid in grids)]
            for place, grid in enumerate(grids):
                best = ranked([(*best[0][:place], own, *best[0][place + 1 :]) for own in grid])
        return [tuple(chain(*own)) for own in best[:keep]]


def left_open(records: Sequence[Record], terms: Sequence[str], step: float) -> Unknown:
    """Return the numbers that terms leave open; `step` is the time between the samples of the
    records, s.
    """
    parts = {
        part
        for text in terms
        for name in parse(text).names
        for part in state(name).parts
        if isinstance(part, Operated)
    }
    found = [
        part for part in parts if not part.numbers and OPERATORS[part.operator].starts is not None
    ]
    longest = step * max((int(record.training.sum()) for record in records), default=1)
    return Unknown(tuple(sorted(found, key=lambda one: (len(one.name), one.name))), step, longest)


def _with(found: State, numbers: dict[Operated, tuple[float, ...]]) -> State:
    """Return a state with the numbers of what was left open in it."""
    if isinstance(found, Measured):
        return found
    inner = _with(found.source, numbers)
    return (
        replace(found, source=inner, numbers=numbers[found])
        if found in numbers
        else replace(found, source=inner)
    )


class Training:
    """One set of training samples, and the `numbers` of operators that the recipe's dictionary
    leaves open.

    Raises DataError where a quantity is missing, too few samples have a history, or a state cannot
    be fed back.
    """

    def __init__(
        self, records: Sequence[Record], recipe: MemoryRecipe, numbers: Sequence[float] = ()
    ) -> None:
        self.records, self.recipe = records, recipe
        self.dictionary = left_open(records, recipe.dictionary, recipe.step).filled(
            recipe.dictionary, numbers
        )
        self.terms = tuple(map(parse, self.dictionary))
        self.states = resolve(_names_in(self.dictionary), records, recipe)
        fed_back = fed_back_states(self.states, recipe.target)
        for term in self.terms:
            parted(term, fed_back)  # refuses what no free run could feed back
        self.data = regressors(records, self.states, self.terms, recipe.target)
        if self.data.samples <= recipe.max_terms:
            raise DataError(
                f"{self.data.samples} training sample(s) with a history, too few for "
                f"{recipe.max_terms} term(s)",
                "keep more samples, or lower fit.max_terms",
            )
        self.limits = (float(self.data.y.min()), float(self.data.y.max()))
        self.selector = selector(self.data, recipe)

    def fit(self, choice: Choice) -> MemoryFit:
        """Return the model of a choice, with its coefficients of one step ahead."""
        found, recipe = choice.selection, self.recipe
        terms = tuple(self.dictionary[i] for i in found.chosen)
        states = self._states_of(found.chosen)
        model = MemoryModel(
            recipe.target,
            states,
            terms,
            found.theta,
            found.theta_error,
            choice.constant,
            self.limits,
            recipe.start,
        )
        return MemoryFit(
            model,
            self.dictionary,
            found,
            choice.ridge,
            choice.forward,
            choice.substitutes,
            choice.shares,
        )

    def refined(self, choice: Choice, point: Coefficients) -> MemoryFit:
        """Return the model of a choice with coefficients and numbers found in free run, and their
        standard errors.

        theta are in the order of the choice.
        """
        chosen = choice.selection.chosen
        errors, of_numbers = standard_errors(self.problem(chosen, search=True), point)
        selection = replace(choice.selection, theta=point.theta, theta_error=errors)
        fit = self.fit(replace(choice, selection=selection, constant=point.constant))
        numbers = self.open_in(chosen)
        return (
            replace(fit, identified=numbers.found(point.numbers, of_numbers))
            if numbers.places
            else fit
        )

    def open_in(self, chosen: IntArray) -> Unknown:
        """Return the numbers that some candidates leave open."""
        return left_open(
            self.records, [self.recipe.dictionary[i] for i in chosen], self.recipe.step
        )

    def problem(
        self, chosen: IntArray, counted: Sequence[BoolArray] | None = None, *, search: bool = False
    ) -> Problem:
        """Return the simulation error of some candidates, over the training samples or those that
        are `counted`, (n,) for each record.

        `search` says whether the numbers that they leave open are to be searched as well.

        Raises DataError where no sample has a history, or a first output is missing.
        """
        wanted = [record.training for record in self.records] if counted is None else counted
        ends = [
            int(np.flatnonzero(mask)[-1]) + 1 if mask.any() else 0 for mask in wanted
        ]  # a run goes on to the last wanted sample

        def made_ready(
            terms: Sequence[str], states: StateSet, pieces: Sequence[Piece]
        ) -> list[Course]:
            feedback = Feedback(terms, states, self.recipe.target)
            return [Course(feedback, piece, end) for piece, end in zip(pieces, ends, strict=True)]

        courses = made_ready(
            [self.dictionary[i] for i in chosen], self._states_of(chosen), self.pieces
        )
        rows = [
            mask[one.start :][: one.size] & np.isfinite(one.measured[one.start :])
            for one, mask in zip(courses, wanted, strict=True)
        ]
        places = [place for place, own in enumerate(rows) if own.any()]
        if not places:
            raise DataError(
                "no sample has a history as long as a free run needs",
                "use fewer steps of delay, or longer recordings",
            )
        for place in places:
            refuse_unknown_beginning(courses[place])
        problem = Problem(
            tuple(courses[place] for place in places),
            tuple(rows[place] for place in places),
            bounds_of(self.limits),
            self.selector.penalty(chosen),
            self.recipe.ridge != 0.0,
        )
        if not search or not (numbers := self.open_in(chosen)).places:
            return problem
        open_terms = [self.recipe.dictionary[i] for i in chosen]

        @lru_cache(maxsize=2)
        def moved(at: tuple[float, ...]) -> tuple[Course, ...]:
            terms = numbers.filled(open_terms, numbers.numbers(np.array(at)))
            states = resolve(_names_in(terms), self.records, self.recipe, self.states.resonances)
            courses = made_ready(terms, states, self._pieces(states))
            return tuple(courses[place] for place in places)

        return replace(problem, moved=lambda at: moved(tuple(at.tolist())), between=numbers.bounds)

    @cached_property
    def pieces(self) -> list[Piece]:
        """The records with the states of all candidates."""
        return self._pieces(self.states)

    def _pieces(self, states: StateSet) -> list[Piece]:
        return [piece_of(states, self.recipe.target, record.columns) for record in self.records]

    def _states_of(self, chosen: IntArray) -> StateSet:
        """Return the states that some candidates need, with their numbers."""
        states, used = self.states, frozenset[str]().union(*(self.terms[i].names for i in chosen))
        places = [place for place, name in enumerate(states.names) if name in used]
        kept = replace(states, names=tuple(states.names[place] for place in places))
        return (
            replace(kept, low=states.low[places], high=states.high[places])
            if states.scaled
            else kept
        )


def _names_in(terms: Sequence[str]) -> list[str]:
    return sorted(frozenset[str]().union(*(parse(text).names for text in terms)))
