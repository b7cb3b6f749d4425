"""Prepare training data for models with memory: regressors for one-step-ahead prediction, and
pieces for free runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray, extremes
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import MemoryFit, MemoryModel, Selection, StateSet
from mapmore_cli.modelling.expressions import parse
from mapmore_cli.modelling.expressions.syntax import names_in
from mapmore_cli.modelling.frols.correlated import MOST, correlated_errors
from mapmore_cli.modelling.memory.feedback import Feedback, fed_back_states, parted
from mapmore_cli.modelling.memory.free_parameters import Unknown, left_open
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.refinement import FreeRunProblem, free_run_errors
from mapmore_cli.modelling.memory.selectors import TermChoice, regressors, selector
from mapmore_cli.modelling.memory.simulation import (
    ReadyPiece,
    divergence_bounds,
    refuse_unknown_beginning,
)
from mapmore_cli.modelling.memory.states import resolve_states
from mapmore_cli.modelling.selection import MemoryRecipe


class TrainingData:
    """Training samples of a model with memory, prepared for the fit. `numbers` holds the parameters
    of those operators for which the recipe's dictionary gives no parameters.

    Raises DataError if a quantity is missing, too few samples have enough earlier samples, or a
    state cannot be fed back.
    """

    def __init__(
        self, records: Sequence[Record], recipe: MemoryRecipe, numbers: Sequence[float] = ()
    ) -> None:
        self.records = records
        self.recipe = recipe
        self.dictionary = left_open(records, recipe.dictionary, recipe.step).filled(
            recipe.dictionary, numbers
        )
        self.terms = tuple(map(parse, self.dictionary))
        self.states = resolve_states(names_in(self.terms), records, recipe)
        fed_back = fed_back_states(self.states, recipe.target)
        for term in self.terms:
            parted(term, fed_back)  # raises an error if a term cannot be computed in free run
        self.data = regressors(records, self.states, self.terms, recipe.target)
        if len(self.data.y) <= recipe.max_terms:
            raise DataError(
                f"{len(self.data.y)} training sample(s) have enough samples before them for all "
                f"delays, too few for {recipe.max_terms} term(s)",
                "loosen `data.keep`, use shorter delays, or lower `fit.max_terms`",
            )
        self.limits = extremes(self.data.y)
        self.selector = selector(self.data, recipe)

    def fit(self, choice: TermChoice, vector: Array | None = None) -> MemoryFit:
        """Return the fitted model with the terms in `choice`. Without `vector`, the model has the
        coefficients of the one-step-ahead fit. With `vector`, it has the coefficients in this
        vector, which were found by a search in free run, and their standard errors. The
        coefficients are in the order of the choice.
        """
        selection = choice.selection
        constant = choice.constant
        identified = None
        chosen = selection.chosen
        if vector is None:
            selection = self._with_errors(selection, choice)
        else:
            problem = self.problem(chosen, search=True)
            numbers = self.open_in(chosen)
            errors_of_all, worth = free_run_errors(problem, vector)
            errors, _, of_numbers = problem.split(errors_of_all)
            theta, constant, at = problem.split(vector)
            selection = replace(selection, theta=theta, theta_error=errors, worth=worth)
            if numbers.states:
                identified = numbers.identified(at, of_numbers)
        model = MemoryModel(
            self.recipe.target,
            self._states_of(chosen),
            tuple(self.dictionary[i] for i in chosen),
            selection.theta,
            selection.theta_error,
            constant,
            self.limits,
            selection.errors_note,
        )
        return MemoryFit(
            model,
            self.dictionary,
            selection,
            choice.ridge,
            choice.forward,
            identified=identified,
        )

    def _with_errors(self, selection: Selection, choice: TermChoice) -> Selection:
        """Return the selection with standard errors that take the correlation of residuals along
        the recordings into account. With a robust loss or weighted samples, the standard errors are
        not changed; they assume independent samples.
        """
        data = self.data
        k = len(selection.chosen)
        weighed = self.recipe.loss != "squares" or data.uncertainty is not None
        if weighed or not k or k * len(data.y) > MOST:
            return selection
        P, y = map(np.concatenate, zip(*data.blocks(selection.chosen), strict=True))
        residual = y - P @ selection.theta - choice.constant
        ridge = np.zeros(k)
        if choice.ridge:
            P, ridge = P - P.mean(axis=0), choice.ridge * len(y) * P.var(axis=0)
        errors, worth = correlated_errors(P, residual, data.lengths, ridge)
        return replace(selection, theta_error=errors, worth=worth)

    def open_in(self, chosen: IntArray) -> Unknown:
        """Return the free parameters of the chosen candidates: the operators' parameters that are
        not written in these terms.
        """
        return left_open(
            self.records, [self.recipe.dictionary[i] for i in chosen], self.recipe.step
        )

    def problem(
        self, chosen: IntArray, counted: Sequence[BoolArray] | None = None, *, search: bool = False
    ) -> FreeRunProblem:
        """Return the problem of finding the smallest simulation error of a model with the chosen
        candidates.

        The error is computed from all training samples, or only from the samples in the masks
        `counted`, (n,) for each record. The variables of the problem are the coefficients, the
        constant and, with `search`, the free parameters of operators.

        Raises DataError if no sample has enough earlier samples, or if a measured output from which
        a run starts is missing.
        """
        wanted = [record.training for record in self.records] if counted is None else counted
        # each piece, cut off after the last sample whose error is used
        parts = []
        for record, mask in zip(self.records, wanted, strict=True):
            end = int(np.max(np.flatnonzero(mask), initial=-1)) + 1
            if end:
                parts.append(({name: x[:end] for name, x in record.columns.items()}, mask[:end]))
        texts = [self.recipe.dictionary[i] for i in chosen] if search else []
        numbers = left_open(self.records, texts, self.recipe.step)

        @lru_cache(maxsize=4)
        def made_ready(*at: float) -> list[ReadyPiece]:
            """Return all pieces, prepared with the operator parameters that belong to the search
            coordinates `at`.
            """
            terms = tuple(self.dictionary[i] for i in chosen)
            states = self._states_of(chosen)
            if at:
                terms = numbers.filled(texts, numbers.numbers(np.array(at)))
                resonances = self.states.resonances
                states = resolve_states(
                    names_in(map(parse, terms)), self.records, self.recipe, resonances
                )
            feedback = Feedback(terms, states, self.recipe.target)
            return [ReadyPiece(feedback, columns) for columns, _ in parts]

        pieces = made_ready()
        rows = [
            mask[piece.start :] & np.isfinite(piece.measured[piece.start :])
            for piece, (_, mask) in zip(pieces, parts, strict=True)
        ]
        places = [place for place, mask in enumerate(rows) if mask.any()]
        if not places:
            raise DataError(
                "no sample has as many samples before it as the longest delay needs",
                "remove the longest delays from the dictionary, or use longer recordings",
            )
        for place in places:
            refuse_unknown_beginning(pieces[place])
        free = [[-np.inf], [np.inf]] * np.ones(len(chosen) + 1)
        return FreeRunProblem(
            lambda at: [made_ready(*at.tolist())[place] for place in places],
            [rows[place] for place in places],
            divergence_bounds(self.limits),
            self.selector.penalty(chosen),
            self.recipe.ridge != 0.0,
            np.hstack([free, numbers.bounds]),
        )

    def _states_of(self, chosen: IntArray) -> StateSet:
        """Return the states that occur in the chosen candidates, with their parameters."""
        states = self.states
        used = names_in(self.terms[i] for i in chosen)
        places = [place for place, name in enumerate(states.names) if name in used]
        kept = replace(states, names=tuple(states.names[place] for place in places))
        return (
            replace(kept, low=states.low[places], high=states.high[places])
            if states.scaled
            else kept
        )
