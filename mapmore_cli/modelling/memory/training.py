"""Training samples made ready: regressors for one step ahead, pieces for free runs, and the models that both give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from mapmore_cli.domain.arrays import BoolArray, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import MemoryFit, MemoryModel, StateSet
from mapmore_cli.modelling.memory.feedback import fed_back_states, feedback_of, parted
from mapmore_cli.modelling.memory.recipe import MemoryRecipe
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.refinement import Coefficients, Problem, standard_errors
from mapmore_cli.modelling.memory.regressors import regressors
from mapmore_cli.modelling.memory.resolution import resolve
from mapmore_cli.modelling.memory.selectors import Choice, selector
from mapmore_cli.modelling.memory.simulation import Piece, bounds_of, course_of, piece_of, refuse_unknown_beginning
from mapmore_cli.modelling.terms import parse


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
        """The model of a choice, with its coefficients of one step ahead."""
        found = choice.selection
        states = self._states_of(found.chosen)
        terms = tuple(self.recipe.dictionary[i] for i in found.chosen)
        model = MemoryModel(self.recipe.target, states, terms, found.theta, found.theta_error, choice.constant, self.limits)
        return MemoryFit(model, self.recipe.dictionary, found, choice.ridge, choice.forward, choice.substitutes, choice.shares)

    # free run ------------------------------------------------------------------------------------------------------------------------

    def refined(self, choice: Choice, point: Coefficients) -> MemoryFit:
        """The model of a choice with coefficients found in free run, and their standard errors; theta are in the order of the choice."""
        errors = standard_errors(self.problem(choice.selection.chosen), point)
        selection = replace(choice.selection, theta=point.theta, theta_error=errors)
        return self.fit(replace(choice, selection=selection, constant=point.constant))

    def problem(self, chosen: IntArray, counted: Sequence[BoolArray] | None = None) -> Problem:
        """The simulation error of some candidates, over the training samples or those that are `counted`, (n,) for each record.

        Raises
        ------
        DataError
            Where no sample has a history, or a first output is missing.
        """
        feedback = feedback_of([self.recipe.dictionary[i] for i in chosen], self._states_of(chosen), self.recipe.target)
        wanted = [record.training for record in self.records] if counted is None else counted
        courses, rows = [], []
        for piece, mask in zip(self._pieces, wanted, strict=True):
            end = int(np.flatnonzero(mask)[-1]) + 1 if mask.any() else 0
            course = course_of(feedback, piece, end)
            counts = mask[course.start : end] & np.isfinite(piece.measured[course.start : end])
            if counts.any():
                refuse_unknown_beginning(course)
                courses.append(course)
                rows.append(counts)
        if not courses:
            raise DataError("no sample has a history as long as a free run needs", "use fewer steps of delay, or longer recordings")
        return Problem(tuple(courses), tuple(rows), bounds_of(self.limits), self.selector.penalty(chosen), self.recipe.ridge != 0.0)

    @cached_property
    def _pieces(self) -> tuple[Piece, ...]:
        return tuple(piece_of(self.states, self.recipe.target, record.columns) for record in self.records)

    def _states_of(self, chosen: IntArray) -> StateSet:
        """The states that some candidates need, with their numbers."""
        used = frozenset[str]().union(*(self.terms[i].names for i in chosen))
        places = [place for place, name in enumerate(self.states.names) if name in used]
        scales = (self.states.low[places], self.states.high[places]) if self.states.scaled else (self.states.low, self.states.high)
        return replace(self.states, names=tuple(self.states.names[place] for place in places), low=scales[0], high=scales[1])
