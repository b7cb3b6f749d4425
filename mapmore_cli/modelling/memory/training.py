"""Training samples made ready: regressors for one step ahead, pieces for free runs, and the models that both give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np

from mapmore_cli.domain.arrays import BoolArray, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import MemoryFit, MemoryModel, StateSet
from mapmore_cli.modelling.expressions import parse
from mapmore_cli.modelling.memory.feedback import fed_back_states, feedback_of, parted
from mapmore_cli.modelling.memory.identification import Unknown, unknown
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.refinement import Coefficients, Problem, standard_errors
from mapmore_cli.modelling.memory.selectors import Choice, regressors, selector
from mapmore_cli.modelling.memory.simulation import Course, Piece, bounds_of, course_of, piece_of, refuse_unknown_beginning
from mapmore_cli.modelling.memory.states import resolve
from mapmore_cli.modelling.selection import MemoryRecipe


def left_open(records: Sequence[Record], terms: Sequence[str], step: float) -> Unknown:
    """Return the numbers that terms leave open; `step` is the time between the samples of the records, s."""
    return unknown(terms, step, step * max((int(record.training.sum()) for record in records), default=1))


class Training:
    """One set of training samples, and the `numbers` of operators that the recipe's dictionary leaves open.

    Raises DataError where a quantity is missing, too few samples have a history, or a state cannot be fed back.
    """

    def __init__(self, records: Sequence[Record], recipe: MemoryRecipe, numbers: Sequence[float] = ()) -> None:
        self.records, self.recipe = records, recipe
        self.dictionary = left_open(records, recipe.dictionary, recipe.step).filled(recipe.dictionary, numbers)
        self.terms = tuple(map(parse, self.dictionary))
        self.states = resolve(_names_in(self.dictionary), records, recipe)
        fed_back = fed_back_states(self.states, recipe.target)
        for term in self.terms:
            parted(term, fed_back)  # refuses what no free run could feed back
        self.data = regressors(records, self.states, self.terms, recipe.target)
        if self.data.samples <= recipe.most_terms:
            raise DataError(
                f"{self.data.samples} training sample(s) with a history, too few for {recipe.most_terms} term(s)",
                "keep more samples, or lower fit.max_terms",
            )
        self.limits = (float(self.data.y.min()), float(self.data.y.max()))
        self.selector = selector(self.data, recipe)

    def fit(self, choice: Choice) -> MemoryFit:
        """Return the model of a choice, with its coefficients of one step ahead."""
        found, recipe = choice.selection, self.recipe
        terms = tuple(self.dictionary[i] for i in found.chosen)
        states = self._states_of(found.chosen)
        model = MemoryModel(recipe.target, states, terms, found.theta, found.theta_error, choice.constant, self.limits, recipe.start)
        return MemoryFit(model, self.dictionary, found, choice.ridge, choice.forward, choice.substitutes, choice.shares)

    def refined(self, choice: Choice, point: Coefficients) -> MemoryFit:
        """Return the model of a choice with coefficients and numbers found in free run, and their standard errors.

        theta are in the order of the choice.
        """
        chosen = choice.selection.chosen
        errors, of_numbers = standard_errors(self.problem(chosen, search=True), point)
        selection = replace(choice.selection, theta=point.theta, theta_error=errors)
        fit = self.fit(replace(choice, selection=selection, constant=point.constant))
        numbers = self.open_in(chosen)
        return replace(fit, identified=numbers.found(point.numbers, of_numbers)) if numbers.places else fit

    def open_in(self, chosen: IntArray) -> Unknown:
        """Return the numbers that some candidates leave open."""
        return left_open(self.records, [self.recipe.dictionary[i] for i in chosen], self.recipe.step)

    def problem(self, chosen: IntArray, counted: Sequence[BoolArray] | None = None, *, search: bool = False) -> Problem:
        """Return the simulation error of some candidates, over the training samples or those that are `counted`, (n,) for each record.

        `search` says whether the numbers that they leave open are to be searched as well.

        Raises DataError where no sample has a history, or a first output is missing.
        """
        wanted = [record.training for record in self.records] if counted is None else counted
        ends = [int(np.flatnonzero(mask)[-1]) + 1 if mask.any() else 0 for mask in wanted]  # a run goes on to the last wanted sample

        def made_ready(terms: Sequence[str], states: StateSet, pieces: Sequence[Piece]) -> list[Course]:
            feedback = feedback_of(terms, states, self.recipe.target)
            return [course_of(feedback, piece, end) for piece, end in zip(pieces, ends, strict=True)]

        courses = made_ready([self.dictionary[i] for i in chosen], self._states_of(chosen), self.pieces)
        rows = [mask[one.start :][: one.size] & np.isfinite(one.measured[one.start :]) for one, mask in zip(courses, wanted, strict=True)]
        places = [place for place, own in enumerate(rows) if own.any()]
        if not places:
            raise DataError("no sample has a history as long as a free run needs", "use fewer steps of delay, or longer recordings")
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
        return replace(kept, low=states.low[places], high=states.high[places]) if states.scaled else kept


def _names_in(terms: Sequence[str]) -> list[str]:
    return sorted(frozenset[str]().union(*(parse(text).names for text in terms)))
