"""Choose models with 1, 2, ... terms from the same regressors. This is done by plain FROLS, or by
regularised FROLS with pruning.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, IntArray, column_in, columns_at
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Selection, StateSet
from mapmore_cli.domain.recording import uncertainty_of
from mapmore_cli.modelling.expressions import Expression, dictionary_blocks, dictionary_matrix
from mapmore_cli.modelling.expressions.families import fits_whole, refuse_beyond_memory
from mapmore_cli.modelling.frols import Regression, Weighing, frols, frols_together
from mapmore_cli.modelling.frols.moments import moments, standard, standardised
from mapmore_cli.modelling.frols.ridge import Regularised, choose_ridge, prune, ridge_press, select
from mapmore_cli.modelling.frols.select import PRICES, fewest_terms, in_units, widened
from mapmore_cli.modelling.frols.weighing import SHORT, gross_outlier
from mapmore_cli.modelling.memory.records import Record, complete
from mapmore_cli.modelling.memory.states import evaluate_states
from mapmore_cli.modelling.selection import MemoryRecipe, Stop


@dataclass(frozen=True)
class Regressors:
    """States and output of the n training samples that have enough earlier samples, shape (n,)
    each, one recording after the other.

    `uncertainty`, shape (n,), is the standard deviation of each measured output, or None. `lengths`
    holds the number of samples of each recording.
    """

    terms: tuple[Expression, ...]
    states: Columns
    y: Array
    uncertainty: Array | None = None
    lengths: tuple[int, ...] = ()

    def blocks(
        self, among: IntArray | None = None, part: slice = slice(None)
    ) -> Iterator[tuple[Array, Array]]:
        """Yield the regressors and the output block by block, optionally for only some of the terms
        (`among`) or samples (`part`).
        """
        terms = self.terms if among is None else [self.terms[i] for i in among]
        states = columns_at(self.states, part)
        y = self.y[part]
        for rows, P in dictionary_blocks(terms, states, len(y)):
            yield P, y[rows]


def regressors(
    records: Sequence[Record], states: StateSet, terms: Sequence[Expression], target: str
) -> Regressors:
    """Return the training samples of all pieces at which every state has a value.

    Raises DataError if there is no such sample, or if the output is missing.
    """
    parts: list[tuple[Columns, Array]] = []
    unsure = uncertainty_of(target)
    sigma = list[Array]()
    for record in records:
        y = column_in(record.columns, target)
        values = evaluate_states(states, record.columns)
        known = record.training & complete(values.values(), record.size)
        sigma += [record.columns[unsure][known]] if unsure in record.columns else []
        parts.append(
            (
                columns_at(values, known),
                y[known],
            )
        )
    pooled = {name: np.concatenate([values[name] for values, _ in parts]) for name in states.names}
    y = np.concatenate([output for _, output in parts])
    if not len(y):
        raise DataError(
            "no training sample has as many samples before it as the longest delay needs",
            "remove the longest delays from the dictionary, or use longer recordings",
        )
    lengths = tuple(len(output) for _, output in parts if len(output))
    return Regressors(tuple(terms), pooled, y, np.concatenate(sigma) if sigma else None, lengths)


FOLDS = 4  # number of blocks of samples for the cross-validation that chooses the ridge


@dataclass(frozen=True)
class TermChoice:
    """Chosen terms of one model. `selection` has the coefficients of the candidates themselves, not
    of the standardised candidates, `constant` is the constant of the model, and `forward` holds the
    candidates that were chosen before pruning.
    """

    selection: Selection
    constant: float
    ridge: float
    forward: IntArray


def problem_of(data: Regressors, recipe: MemoryRecipe, among: IntArray | None = None) -> Regression:
    """Return the regression problem for FROLS. If `among` is given, only these candidates can be
    chosen.
    """
    every = np.arange(len(data.terms)) if among is None else among
    weighing = Weighing(data.uncertainty, recipe.loss, recipe.known_scale)
    if recipe.loss != "squares" and len(data.y) <= SHORT:
        P, y = map(np.concatenate, zip(*weighing.rows(partial(data.blocks, every))(), strict=True))
        _, outlier = gross_outlier(P, y)
        weighing = weighing.without(outlier, np.ones(len(y)))
    return Regression(
        partial(data.blocks, every), weighing, lambda chosen: partial(data.blocks, every[chosen])
    )


class _Plain:
    """Term selection by plain FROLS. The whole dictionary is kept in memory if there is enough
    memory.
    """

    def __init__(self, data: Regressors, recipe: MemoryRecipe) -> None:
        self.data = data
        self.recipe = recipe
        self.whole = None
        if fits_whole(len(data.y), len(data.terms)):
            self.whole = dictionary_matrix(data.terms, data.states, len(data.y))
        else:
            refuse_beyond_memory(len(data.terms))

    def best(self) -> TermChoice:
        """Return the model whose number of terms is chosen by the stopping rule of the recipe."""
        recipe = self.recipe
        every = np.arange(len(self.data.terms))
        rule = () if recipe.stop == "free_run" else (recipe.tolerance, recipe.stop)
        return self._selected(every, recipe.max_terms, *rule)

    @cached_property
    def sizes(self) -> list[IntArray]:
        """The chosen terms of the models with 1, 2, ... terms."""
        largest = self._selected(np.arange(len(self.data.terms)), self.recipe.max_terms)
        return [largest.forward[: size + 1] for size in range(len(largest.forward))]

    def among(self, chosen: IntArray, stop: str) -> TermChoice:
        """Return the model with the given candidates, sorted by their error reduction ratio. `stop`
        is the reason for the number of terms, and is stored with the selection.
        """
        choice = self._selected(chosen, len(chosen))
        return replace(choice, selection=replace(choice.selection, stop=stop))

    def penalty(self, chosen: IntArray) -> Array:
        """Return the factor of each squared coefficient in the penalty, shape (k,). Without a
        ridge, the factors are zero. With a ridge (`_Ridged`), each factor is the ridge times the
        sum of squares of the candidate about its mean.
        """
        return np.zeros(len(chosen))

    def _selected(
        self, among: IntArray, terms: int, tolerance: float = 0.0, stop: Stop = "tolerance"
    ) -> TermChoice:
        problem = problem_of(self.data, self.recipe, among)
        if self.whole is None:
            (selection,) = frols_together([problem], terms, tolerance, stop=stop)
        else:
            P = self.whole[:, among]
            weighing = problem.weighing
            selection = frols(P, self.data.y, terms, tolerance, stop=stop, weighing=weighing)
        selection = widened(selection, among, len(self.data.terms))
        return TermChoice(selection, 0.0, 0.0, selection.chosen)


class _Ridged:
    """Term selection by regularised FROLS: forward selection, then pruning.

    It uses sums of products that are computed block by block, and has the same methods as `_Plain`.
    If the ridge of the recipe is `auto`, cross-validation chooses the ridge. Raises DataError if no
    candidate explains anything.
    """

    def __init__(self, data: Regressors, recipe: MemoryRecipe) -> None:
        refuse_beyond_memory(len(data.terms))
        self.recipe = recipe
        self.standard = standard(data.blocks)
        self.blocks = standardised(data.blocks, self.standard)
        total = moments(self.blocks)
        ridge = recipe.ridge
        if ridge == "auto":
            edges = np.linspace(0, len(data.y), min(FOLDS, len(data.y)) + 1).astype(np.int64)
            parts = [partial(data.blocks, part=slice(*ends)) for ends in pairwise(edges)]
            folds = [moments(standardised(blocks, self.standard)) for blocks in parts]
            ridge = choose_ridge(total, folds, recipe.forward_terms, recipe.max_terms)
        self.data = Regularised(total.covariance, total.samples, ridge)
        self.forward = select(self.data, recipe.forward_terms).chosen
        if not len(self.forward):
            remedy = "check that the output and the inputs vary in the training samples"
            raise DataError("no candidate term explains any part of the output", remedy)
        self.sizes = prune(self.data, self.forward)[: recipe.max_terms]

    def best(self) -> TermChoice:
        unexplained = np.array(
            [self.data.unexplained(kept, self.data.coefficients(kept)) for kept in self.sizes]
        )
        stop = self.recipe.stop
        samples = self.data.samples
        if stop == "press":
            errors = ridge_press(self.blocks, self.data, self.sizes)
            return self.among(self.sizes[int(np.argmin(errors))], stop)
        if stop in PRICES:
            count = fewest_terms(stop, unexplained, samples, len(self.standard.spread) - 1)
            return self.among(self.sizes[count - 1], stop)
        enough = np.flatnonzero(unexplained <= self.recipe.tolerance)
        if self.recipe.stop == "tolerance" and len(enough):
            return self.among(self.sizes[enough[0]], "tolerance")
        return self.among(self.sizes[-1], "pruned")

    def among(self, chosen: IntArray, stop: str) -> TermChoice:
        selection = replace(select(self.data, len(chosen), chosen), stop=stop)
        selection = in_units(selection, self.standard.spread)
        centre = self.standard.centre
        constant = float(centre[-1] - selection.theta @ centre[selection.chosen])
        return TermChoice(selection, constant, self.data.ridge, self.forward)

    def penalty(self, chosen: IntArray) -> Array:
        return self.data.ridge * self.data.samples * self.standard.spread[chosen] ** 2


def selector(data: Regressors, recipe: MemoryRecipe) -> _Plain | _Ridged:
    """Return an object that selects the terms of models with different numbers of terms. It uses
    plain FROLS if the recipe has no ridge, and regularised FROLS otherwise.
    """
    return _Plain(data, recipe) if recipe.ridge == 0.0 else _Ridged(data, recipe)
