"""Models of 1, 2, ... terms from the same regressors: plain FROLS, or regularised FROLS with
pruning.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Selection, StateSet
from mapmore_cli.modelling.expressions import Expression, dictionary_blocks, dictionary_matrix
from mapmore_cli.modelling.expressions.families import fits_whole, refuse_beyond_memory
from mapmore_cli.modelling.frols import frols, frols_streamed
from mapmore_cli.modelling.frols.moments import moments, standard, standardised, uncentred
from mapmore_cli.modelling.frols.ridge import (
    Regularised,
    choose_ridge,
    prune,
    ridge_press,
    select,
    substitutes,
)
from mapmore_cli.modelling.frols.select import fewest, in_units, information_criterion, widened
from mapmore_cli.modelling.memory.records import Record, complete
from mapmore_cli.modelling.memory.states import evaluate_states
from mapmore_cli.modelling.selection import LEAST_RIDGE, MemoryRecipe, Stop


@dataclass(frozen=True)
class Regressors:
    """States and output on the n training samples that have a history, (n,) each, in the order of
    the recordings.
    """

    terms: tuple[Expression, ...]
    states: Columns
    y: Array

    @property
    def samples(self) -> int:
        """Number of samples, n."""
        return len(self.y)

    def rows(self, part: slice) -> Regressors:
        """Return some of the samples."""
        return Regressors(
            self.terms, {name: values[part] for name, values in self.states.items()}, self.y[part]
        )

    def blocks(self) -> Iterator[tuple[Array, Array]]:
        """Yield the dictionary and the output, block by block."""
        for rows, P in dictionary_blocks(self.terms, self.states, self.samples):
            yield P, self.y[rows]


def regressors(
    records: Sequence[Record], states: StateSet, terms: Sequence[Expression], target: str
) -> Regressors:
    """Return the training samples of all pieces on which every state has a value.

    Raises DataError where there are none, or the output is missing.
    """
    parts: list[tuple[Columns, Array]] = []
    for record in records:
        if target not in record.columns:
            raise DataError(
                f"there is no column `{target}`", f"there are: {', '.join(record.columns)}"
            )
        values = evaluate_states(states, record.columns)
        known = record.training & complete(values.values(), record.size)
        parts.append(
            (
                {name: column[known] for name, column in values.items()},
                record.columns[target][known],
            )
        )
    pooled = {name: np.concatenate([values[name] for values, _ in parts]) for name in states.names}
    y = np.concatenate([output for _, output in parts])
    if not len(y):
        raise DataError(
            "no training sample has a history as long as the delays ask for",
            "use fewer steps of delay, or longer recordings",
        )
    return Regressors(tuple(terms), pooled, y)


FOLDS = 4  # blocks of samples that are left out in turn where the ridge is chosen


@dataclass(frozen=True)
class Choice:
    """Terms of one model: their selection in units of the candidates, and the constant that belongs
    to it.
    """

    selection: Selection
    constant: float
    ridge: float
    forward: IntArray
    substitutes: IntArray
    shares: Array


class _Plain:
    """FROLS on the candidates as they are, in one piece where they fit into memory."""

    def __init__(self, data: Regressors, recipe: MemoryRecipe) -> None:
        self.data, self.recipe, self.all = data, recipe, np.arange(len(data.terms))

    @cached_property
    def _whole(self) -> Array | None:
        if fits_whole(self.data.samples, len(self.all)):
            return dictionary_matrix(self.data.terms, self.data.states, self.data.samples)
        refuse_beyond_memory(len(self.all))
        return None

    @cached_property
    def _largest(self) -> IntArray:
        return self._selected(self.all, self.recipe.max_terms).selection.chosen

    @cached_property
    def ranking(self) -> Regularised:
        """The covariance of all candidates, divided by their root mean squares, by which they are
        ranked beside chosen ones.
        """
        total = moments(standardised(self.data.blocks, uncentred(self.data.blocks)))
        return Regularised(total.products / total.samples, total.samples, LEAST_RIDGE)

    def best(self) -> Choice:
        """Return the model whose number of terms the recipe's rule prefers; the largest where free
        runs decide on it.
        """
        recipe = self.recipe
        if recipe.stop == "free_run":
            return self.of_size(recipe.max_terms)
        return self._selected(self.all, recipe.max_terms, recipe.tolerance, recipe.stop)

    def of_size(self, terms: int) -> Choice:
        """Return the model of so many terms, or of as many as there can be."""
        return self.among(self._largest[:terms])

    def among(self, chosen: IntArray) -> Choice:
        """Return the model of these candidates, in the order of their error reduction."""
        return self._selected(chosen, len(chosen))

    def penalty(self, chosen: IntArray) -> Array:
        """(k,) what the ridge, a part of each candidate's variance, adds to the squared error for
        each squared coefficient.
        """
        return np.zeros(len(chosen))

    def _selected(
        self, among: IntArray, terms: int, tolerance: float = 0.0, stop: Stop = "tolerance"
    ) -> Choice:
        if self._whole is None:
            found = frols_streamed(
                lambda: ((P[:, among], y) for P, y in self.data.blocks()),
                terms,
                tolerance,
                stop=stop,
            )
        else:
            found = frols(self._whole[:, among], self.data.y, terms, tolerance, stop=stop)
        if len(among) < len(self.all):
            found = widened(found, among, len(self.all))
        return Choice(found, 0.0, 0.0, found.chosen, np.empty(0, dtype=np.int64), np.empty(0))


class _Ridged:
    """Regularised FROLS: forward, then backward; everything but PRESS from sums of products, which
    are formed block by block.

    Its methods are those of `_Plain`, its `ranking` goes by standard deviations. The ridge is
    chosen here where the recipe leaves that open. Raises DataError where no candidate explains
    anything.
    """

    def __init__(self, data: Regressors, recipe: MemoryRecipe) -> None:
        refuse_beyond_memory(len(data.terms))
        self.recipe = recipe
        self.standard = standard(data.blocks)
        self.blocks = standardised(data.blocks, self.standard)
        total = moments(self.blocks)
        ridge = recipe.ridge
        if ridge == "auto":
            edges = np.linspace(0, data.samples, min(FOLDS, data.samples) + 1).astype(np.int64)
            parts = [data.rows(slice(begin, end)) for begin, end in pairwise(edges)]
            folds = [moments(standardised(part.blocks, self.standard)) for part in parts]
            ridge = choose_ridge(total, folds, recipe.forward_terms, recipe.max_terms)
        self.ranking = Regularised(total.covariance, total.samples, ridge)
        self.forward = select(self.ranking, recipe.forward_terms).chosen
        if not len(self.forward):
            remedy = "look whether the output and the inputs vary in the training samples"
            raise DataError("no candidate explains anything of the output", remedy)
        self.subsets = prune(self.ranking, self.forward)[: recipe.max_terms]

    def best(self) -> Choice:
        stop, ranking, terms = self.recipe.stop, self.ranking, len(self.subsets)
        if stop == "free_run":
            return self.of_size(terms)
        if stop == "press":
            return self.of_size(fewest(ridge_press(self.blocks, ranking, self.subsets)), stop)
        unexplained = np.array(
            [ranking.unexplained(kept, ranking.coefficients(kept)) for kept in self.subsets]
        )
        if stop != "tolerance":
            return self.of_size(
                fewest(information_criterion(stop, unexplained, ranking.samples)), stop
            )
        enough = np.flatnonzero(unexplained <= self.recipe.tolerance)
        return self.of_size(enough[0] + 1, stop) if len(enough) else self.of_size(terms)

    def of_size(self, terms: int, stop: str = "pruned") -> Choice:
        return self.among(self.subsets[min(terms, len(self.subsets)) - 1], stop)

    def among(self, chosen: IntArray, stop: str = "pruned") -> Choice:
        found = replace(select(self.ranking, len(chosen), chosen), stop=stop)
        best, shares = substitutes(self.ranking, found.chosen)
        selection = in_units(found, self.standard.spread)
        constant = float(
            self.standard.centre[-1] - selection.theta @ self.standard.centre[selection.chosen]
        )
        return Choice(selection, constant, self.ranking.ridge, self.forward, best, shares)

    def penalty(self, chosen: IntArray) -> Array:
        return self.ranking.ridge * self.ranking.samples * self.standard.spread[chosen] ** 2


def selector(data: Regressors, recipe: MemoryRecipe) -> _Plain | _Ridged:
    """Return what gives a model of any number of terms: plain FROLS where the recipe has no ridge,
    else regularised FROLS.
    """
    return _Plain(data, recipe) if recipe.ridge == 0.0 else _Ridged(data, recipe)
