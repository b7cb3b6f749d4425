"""Models of 1, 2, ... terms from the same regressors: plain FROLS, or regularised FROLS with pruning."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Selection, StateSet
from mapmore_cli.modelling.expressions import Expression, dictionary_blocks, dictionary_matrix
from mapmore_cli.modelling.expressions.families import fits_whole, refuse_beyond_memory
from mapmore_cli.modelling.frols import frols, frols_streamed
from mapmore_cli.modelling.frols.moments import Moments, Standard, moments, standard, standardised, uncentred
from mapmore_cli.modelling.frols.ridge import LEAST_RIDGE, Regularised, choose_ridge, prune, ridge_press, select, substitutes
from mapmore_cli.modelling.frols.select import fewest, information_criterion
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.states import evaluate_states
from mapmore_cli.modelling.selection import MemoryRecipe, Stop


@dataclass(frozen=True)
class Regressors:
    """States and output on the n training samples that have a history, (n,) each, in the order of the recordings."""

    terms: tuple[Expression, ...]
    states: Columns
    y: Array

    @property
    def samples(self) -> int:
        """Number of samples, n."""
        return len(self.y)

    def rows(self, part: slice) -> Regressors:
        """Return some of the samples."""
        return Regressors(self.terms, {name: values[part] for name, values in self.states.items()}, self.y[part])

    def whole(self) -> Array:
        """Return the dictionary as one matrix, (n, M)."""
        return dictionary_matrix(self.terms, self.states, self.samples)

    def blocks(self) -> Iterator[tuple[Array, Array]]:
        """Yield the dictionary and the output, block by block."""
        for rows, P in dictionary_blocks(self.terms, self.states, self.samples):
            yield P, self.y[rows]


def regressors(records: Sequence[Record], states: StateSet, terms: Sequence[Expression], target: str) -> Regressors:
    """Return the training samples of all pieces on which every state has a value.

    Raises DataError where there are none, or the output is missing.
    """
    parts = [_part(record, states, target) for record in records]
    pooled = {name: np.concatenate([values[name] for values, _ in parts]) for name in states.names}
    y = np.concatenate([output for _, output in parts])
    if not len(y):
        raise DataError("no training sample has a history as long as the delays ask for", "use fewer steps of delay, or longer recordings")
    return Regressors(tuple(terms), pooled, y)


def _part(record: Record, states: StateSet, target: str) -> tuple[dict[str, Array], Array]:
    if target not in record.columns:
        raise DataError(f"there is no column `{target}`", f"there are: {', '.join(record.columns)}")
    values = evaluate_states(states, record.columns)
    known = np.logical_and.reduce([record.training, *(np.isfinite(column) for column in values.values())])
    return {name: column[known] for name, column in values.items()}, record.columns[target][known]


FOLDS = 4
"""Blocks of samples that are left out in turn where the ridge is chosen."""


@dataclass(frozen=True)
class Choice:
    """Terms of one model: their selection in units of the candidates, and the constant that belongs to it."""

    selection: Selection
    constant: float
    ridge: float
    forward: IntArray
    substitutes: IntArray
    shares: Array


class Selector(Protocol):
    """Gives a model of any number of terms."""

    def best(self, stop: Stop, tolerance: float) -> Choice:
        """Return the model whose number of terms the rule prefers."""
        ...

    def of_size(self, terms: int) -> Choice:
        """Return the model of so many terms, or of as many as there can be."""
        ...

    def among(self, chosen: IntArray) -> Choice:
        """Return the model of these candidates, in the order of their error reduction."""
        ...

    def penalty(self, chosen: IntArray) -> Array:
        """(k,) what the ridge adds to the sum of squared errors for each squared coefficient of these candidates."""
        ...

    @property
    def ranking(self) -> Regularised:
        """The covariance of all candidates by which they are ranked beside chosen ones."""
        ...


def selector(data: Regressors, recipe: MemoryRecipe) -> Selector:
    """Plain where the recipe has no ridge."""
    return Plain(data, recipe) if recipe.ridge == 0.0 else Ridged(data, recipe)


@dataclass(frozen=True)
class Plain:
    """FROLS on the candidates as they are, in one piece where they fit into memory."""

    data: Regressors
    recipe: MemoryRecipe

    @cached_property
    def _whole(self) -> Array | None:
        if fits_whole(self.data.samples, len(self.data.terms)):
            return self.data.whole()
        refuse_beyond_memory(len(self.data.terms))
        return None

    @cached_property
    def _largest(self) -> Selection:
        return self._selection(np.arange(len(self.data.terms)), self.recipe.most_terms)

    @cached_property
    def ranking(self) -> Regularised:
        """See `Selector`: of candidates divided by their root mean squares."""
        total = moments(standardised(self.data.blocks, uncentred(self.data.blocks)))
        return Regularised(total.products / total.samples, total.samples, LEAST_RIDGE)

    def best(self, stop: Stop, tolerance: float) -> Choice:
        """See `Selector`."""
        return _plain(self._selection(np.arange(len(self.data.terms)), self.recipe.most_terms, tolerance, stop))

    def of_size(self, terms: int) -> Choice:
        """See `Selector`."""
        return self.among(self._largest.chosen[:terms])

    def among(self, chosen: IntArray) -> Choice:
        """See `Selector`."""
        return _plain(self._selection(chosen, len(chosen)))

    def penalty(self, chosen: IntArray) -> Array:
        """See `Selector`: there is none."""
        return np.zeros(len(chosen))

    def _selection(self, among: IntArray, terms: int, tolerance: float = 0.0, stop: Stop = "tolerance") -> Selection:
        if self._whole is None:
            found = frols_streamed(lambda: ((P[:, among], y) for P, y in self.data.blocks()), terms, tolerance, stop=stop)
        else:
            found = frols(self._whole[:, among], self.data.y, terms, tolerance, stop=stop)
        return found if len(among) == len(self.data.terms) else _widened(found, among, len(self.data.terms))


class Ridged:
    """Regularised FROLS: forward, then backward; everything but PRESS from sums of products, which are formed block by block.

    The ridge is chosen here where the recipe leaves that open. Raises DataError where no candidate explains anything.
    """

    def __init__(self, data: Regressors, recipe: MemoryRecipe) -> None:
        refuse_beyond_memory(len(data.terms))
        self.standard = standard(data.blocks)
        self.blocks = standardised(data.blocks, self.standard)
        total = moments(self.blocks)
        ridge = recipe.ridge
        if ridge == "auto":
            ridge = choose_ridge(total, _folds(data, self.standard), recipe.forward_terms, recipe.most_terms)
        self.problem = Regularised(total.covariance, total.samples, ridge)
        self.forward = select(self.problem, recipe.forward_terms).chosen
        if not len(self.forward):
            raise DataError(
                "no candidate explains anything of the output", "look whether the output and the inputs vary in the training samples"
            )
        self.subsets = prune(self.problem, self.forward)[: recipe.most_terms]

    def best(self, stop: Stop, tolerance: float) -> Choice:
        """See `Selector`."""
        if stop == "press":
            return self._choice(fewest(ridge_press(self.blocks, self.problem, self.subsets)), stop)
        unexplained = np.array([self.problem.unexplained(kept, self.problem.coefficients(kept)) for kept in self.subsets])
        if stop != "tolerance":
            return self._choice(fewest(information_criterion(stop, unexplained, self.problem.samples)), stop)
        enough = np.flatnonzero(unexplained <= tolerance)
        return self._choice(int(enough[0]) + 1, stop) if len(enough) else self.of_size(len(self.subsets))

    def of_size(self, terms: int) -> Choice:
        """See `Selector`."""
        return self._choice(min(terms, len(self.subsets)), "pruned")

    def among(self, chosen: IntArray) -> Choice:
        """See `Selector`."""
        return self._of(chosen, "pruned")

    def penalty(self, chosen: IntArray) -> Array:
        """See `Selector`: the ridge is a part of each candidate's variance."""
        return self.problem.ridge * self.problem.samples * self.standard.spread[chosen] ** 2

    @property
    def ranking(self) -> Regularised:
        """See `Selector`."""
        return self.problem

    def _choice(self, terms: int, stop: str) -> Choice:
        return self._of(self.subsets[terms - 1], stop)

    def _of(self, chosen: IntArray, stop: str) -> Choice:
        found = replace(select(self.problem, len(chosen), chosen), stop=stop)
        best, shares = substitutes(self.problem, found.chosen)
        selection = _in_units(found, self.standard)
        constant = float(self.standard.centre[-1] - selection.theta @ self.standard.centre[selection.chosen])
        return Choice(selection, constant, self.problem.ridge, self.forward, best, shares)


def _plain(found: Selection) -> Choice:
    return Choice(found, 0.0, 0.0, found.chosen, np.empty(0, dtype=np.int64), np.empty(0))


def _widened(found: Selection, among: IntArray, candidates: int) -> Selection:
    """Return a selection among some candidates as one among all; the tables are empty (NaN) for all others."""
    tables = np.full((2, len(found.chosen), candidates), np.nan)
    tables[:, :, among] = found.g_all, found.err_all
    runner_up = np.where(found.runner_up >= 0, among[found.runner_up], -1)
    return replace(found, chosen=among[found.chosen], g_all=tables[0], err_all=tables[1], runner_up=runner_up)


def _folds(data: Regressors, by: Standard) -> list[Moments]:
    edges = np.linspace(0, data.samples, min(FOLDS, data.samples) + 1).astype(np.int64)
    return [moments(standardised(data.rows(slice(begin, end)).blocks, by)) for begin, end in pairwise(edges)]


def _in_units(found: Selection, by: Standard) -> Selection:
    """Return a selection of standardised candidates as one of centred candidates."""
    y, columns = float(by.spread[-1]), by.spread[:-1]
    chosen = columns[found.chosen]
    return replace(
        found,
        g=found.g * y / chosen,
        theta=found.theta * y / chosen,
        theta_error=found.theta_error * y / chosen,
        a=found.a * chosen / chosen[:, None],
        g_all=found.g_all * y / columns,
        sse=found.sse * y**2,
        yy=found.yy * y**2,
    )
