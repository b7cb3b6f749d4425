"""Training samples made ready: regressors for one step ahead, pieces for free runs, and the models that both give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np

from mapmore_cli.domain.arrays import BoolArray, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import MemoryFit, MemoryModel, StateSet
from mapmore_cli.modelling.expressions import parse
from mapmore_cli.modelling.memory.feedback import Feedback, fed_back_states, feedback_of, parted
from mapmore_cli.modelling.memory.identification import Unknown, unknown
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.refinement import Coefficients, Problem, standard_errors
from mapmore_cli.modelling.memory.selectors import Choice, regressors, selector
from mapmore_cli.modelling.memory.simulation import Course, Piece, bounds_of, course_of, piece_of, refuse_unknown_beginning
from mapmore_cli.modelling.memory.states import resolve
from mapmore_cli.modelling.selection import MemoryRecipe


class Training:
    """One set of training samples.

    Raises DataError where a quantity is missing, too few samples have a history, or a state cannot be fed back.
    """

    def __init__(self, records: Sequence[Record], recipe: MemoryRecipe) -> None:
        self.terms = tuple(parse(text) for text in recipe.dictionary)
        names = sorted(frozenset[str]().union(*(term.names for term in self.terms)))
        self.records, self.recipe = records, recipe
        self.states = resolve(names, records, recipe.target, recipe.step, scale=recipe.scaling == "range", margin=recipe.margin)
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

    # one step ahead ------------------------------------------------------------------------------------------------------------------

    def fit(self, choice: Choice) -> MemoryFit:
        """Return the model of a choice, with its coefficients of one step ahead."""
        found = choice.selection
        states = self._states_of(found.chosen)
        terms = tuple(self.recipe.dictionary[i] for i in found.chosen)
        model = MemoryModel(
            self.recipe.target, states, terms, found.theta, found.theta_error, choice.constant, self.limits, self.recipe.start
        )
        return MemoryFit(model, self.recipe.dictionary, found, choice.ridge, choice.forward, choice.substitutes, choice.shares)

    # free run ------------------------------------------------------------------------------------------------------------------------

    def refined(self, choice: Choice, point: Coefficients, open_terms: Sequence[str]) -> MemoryFit:
        """Return the model of a choice with coefficients found in free run, and standard errors; theta are in the order of the choice.

        `open_terms` are its terms as the dictionary names them, where numbers of their operators were searched as well.
        """
        errors, of_numbers = standard_errors(self.problem(choice.selection.chosen, open_terms=open_terms), point)
        selection = replace(choice.selection, theta=point.theta, theta_error=errors)
        fit = self.fit(replace(choice, selection=selection, constant=point.constant))
        numbers = self.unknown(open_terms)
        return replace(fit, identified=numbers.found(point.numbers, of_numbers)) if numbers.places else fit

    def problem(self, chosen: IntArray, counted: Sequence[BoolArray] | None = None, open_terms: Sequence[str] | None = None) -> Problem:
        """Return the simulation error of some candidates, over the training samples or those that are `counted`, (n,) for each record.

        `open_terms` are the candidates as the dictionary names them, where numbers of their operators are to be searched as well.

        Raises DataError where no sample has a history, or a first output is missing.
        """
        wanted = [record.training for record in self.records] if counted is None else counted
        terms = [self.recipe.dictionary[i] for i in chosen]
        courses = self._courses(feedback_of(terms, self._states_of(chosen), self.recipe.target), self._pieces, wanted)
        rows = [_counted(course, mask) for course, mask in zip(courses, wanted, strict=True)]
        counts = [place for place, own in enumerate(rows) if own.any()]
        if not counts:
            raise DataError("no sample has a history as long as a free run needs", "use fewer steps of delay, or longer recordings")
        for place in counts:
            refuse_unknown_beginning(courses[place])
        problem = Problem(
            tuple(courses[place] for place in counts),
            tuple(rows[place] for place in counts),
            bounds_of(self.limits),
            self.selector.penalty(chosen),
            self.recipe.ridge != 0.0,
        )
        numbers = self.unknown(open_terms or ())
        if not numbers.places:
            return problem

        @lru_cache(maxsize=2)
        def moved(at: tuple[float, ...]) -> tuple[Course, ...]:
            feedback = self._feedback(numbers.filled(open_terms or (), numbers.numbers(np.array(at))))
            pieces = [piece_of(feedback.states, self.recipe.target, record.columns) for record in self.records]
            courses = self._courses(feedback, pieces, wanted)
            return tuple(courses[place] for place in counts)

        return replace(problem, moved=lambda at: moved(tuple(at.tolist())), between=numbers.bounds)

    def unknown(self, terms: Sequence[str]) -> Unknown:
        """Return what terms leave open."""
        longest = max((int(record.training.sum()) for record in self.records), default=1)
        return unknown(terms, self.recipe.step, longest * self.recipe.step)

    def _feedback(self, terms: Sequence[str]) -> Feedback:
        """Terms taken apart, with everything that their states need found from the training samples."""
        names = sorted(frozenset[str]().union(*(parse(text).names for text in terms)))
        recipe = self.recipe
        known = self.states.resonances
        states = resolve(
            names, self.records, recipe.target, recipe.step, scale=recipe.scaling == "range", margin=recipe.margin, resonances=known
        )
        return feedback_of(terms, states, recipe.target)

    def _courses(self, feedback: Feedback, pieces: Sequence[Piece], wanted: Sequence[BoolArray]) -> list[Course]:
        ends = (int(np.flatnonzero(mask)[-1]) + 1 if mask.any() else 0 for mask in wanted)
        return [course_of(feedback, piece, end) for piece, end in zip(pieces, ends, strict=True)]

    @cached_property
    def _pieces(self) -> tuple[Piece, ...]:
        return tuple(piece_of(self.states, self.recipe.target, record.columns) for record in self.records)

    def _states_of(self, chosen: IntArray) -> StateSet:
        """Return the states that some candidates need, with their numbers."""
        used = frozenset[str]().union(*(self.terms[i].names for i in chosen))
        places = [place for place, name in enumerate(self.states.names) if name in used]
        scales = (self.states.low[places], self.states.high[places]) if self.states.scaled else (self.states.low, self.states.high)
        return replace(self.states, names=tuple(self.states.names[place] for place in places), low=scales[0], high=scales[1])


def _counted(course: Course, mask: BoolArray) -> BoolArray:
    """(n - start,) the samples of a run that count: those of a mask whose output is known."""
    end = course.start + course.size
    return np.asarray(mask[course.start : end] & np.isfinite(course.measured[course.start : end]))
