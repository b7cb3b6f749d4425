"""From pieces of recordings to a model with memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import BoolArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import MemoryFit, MemoryModel, StateSet
from mapmore_cli.modelling.memory.feedback import parted
from mapmore_cli.modelling.memory.free_run import free_run
from mapmore_cli.modelling.memory.recipe import MemoryRecipe
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.regressors import regressors
from mapmore_cli.modelling.memory.resolution import output_lags, resolve
from mapmore_cli.modelling.memory.selectors import Choice, selector
from mapmore_cli.modelling.terms import parse

LATE = 0.25
"""Share of each piece's training samples on which free runs compete, where they decide on the number of terms."""


def fit_with_memory(records: Sequence[Record], recipe: MemoryRecipe) -> MemoryFit:
    """Choose and fit the terms of one model to the training samples of all pieces.

    Raises
    ------
    DataError
        Where a quantity is missing, no sample has enough history, a state cannot be fed back, or the dictionary needs more memory than
        there is.
    """
    if recipe.stop != "free_run":
        return _Training(records, recipe).fit(None)
    fit = _Training(records, replace(recipe, stop="tolerance")).fit(_terms_by_free_run(records, recipe))
    return replace(fit, selection=replace(fit.selection, stop="free_run"))


class _Training:
    """Regressors of one set of training samples, and the models of any size that they give."""

    def __init__(self, records: Sequence[Record], recipe: MemoryRecipe) -> None:
        terms = [parse(text) for text in recipe.dictionary]
        names = sorted(frozenset[str]().union(*(term.names for term in terms)))
        self.recipe = recipe
        self.states = resolve(names, records, recipe.target, recipe.step, scale=recipe.scale, margin=recipe.margin)
        fed_back = output_lags(self.states, recipe.target)
        for term in terms:
            parted(term, fed_back)  # refuses what no free run could feed back
        data = regressors(records, self.states, terms, recipe.target)
        if data.samples <= recipe.max_terms:
            raise DataError(
                f"{data.samples} training sample(s) with a history, too few for {recipe.max_terms} term(s)",
                "keep more samples, or lower fit.max_terms",
            )
        self.limits = (float(data.y.min()), float(data.y.max()))
        self.selector = selector(data, recipe)

    def fit(self, terms: int | None) -> MemoryFit:
        """The model of so many terms, or of as many as the recipe's rule prefers."""
        recipe = self.recipe
        choice = self.selector.best(recipe.stop, recipe.tolerance) if terms is None else self.selector.of_size(terms)
        return MemoryFit(
            self._model(choice), recipe.dictionary, choice.selection, choice.ridge, choice.forward, choice.substitutes, choice.shares
        )

    def _model(self, choice: Choice) -> MemoryModel:
        terms = tuple(self.recipe.dictionary[i] for i in choice.selection.chosen)
        used = frozenset[str]().union(*(parse(term).names for term in terms))
        states = _restricted(self.states, used)
        selection = choice.selection
        return MemoryModel(self.recipe.target, states, terms, selection.theta, selection.theta_error, choice.constant, self.limits)


def _restricted(states: StateSet, used: frozenset[str]) -> StateSet:
    """The states that a model needs, with their numbers."""
    places = [place for place, name in enumerate(states.names) if name in used]
    scales = (states.low[places], states.high[places]) if states.scaled else (states.low, states.high)
    return replace(states, names=tuple(states.names[place] for place in places), low=scales[0], high=scales[1])


def _terms_by_free_run(records: Sequence[Record], recipe: MemoryRecipe) -> int:
    """The number of terms whose free run over the late training samples errs least, the smaller of equals; runs that diverge lose."""
    late = [_late(record) for record in records]
    early = [Record(record.columns, record.training & ~held) for record, held in zip(records, late, strict=True)]
    training = _Training(early, replace(recipe, stop="tolerance"))
    models = (training.fit(terms).model for terms in range(1, recipe.max_terms + 1))
    errors = [_error_of_runs(model, records, late) for model in models]
    if not np.isfinite(errors).any():
        raise DataError(
            "the free run of every model diverges, or has no history, on the last quarter of the training samples",
            "use another `fit.stop`, fewer delayed outputs, or a ridge",
        )
    return int(np.argmin(errors)) + 1


def _error_of_runs(model: MemoryModel, records: Sequence[Record], rows: Sequence[BoolArray]) -> float:
    """Mean squared error over those of some rows of every piece that have a prediction; infinite where a run diverges, or none has one."""
    runs = [free_run(model, record.columns) for record in records]
    misses = np.concatenate(
        [(run.values - record.columns[model.output])[held] for run, record, held in zip(runs, records, rows, strict=True)]
    )
    if any(run.diverged for run in runs) or np.isnan(misses).all():
        return np.inf
    return float(np.nanmean(misses**2))


def _late(record: Record) -> BoolArray:
    """The last training samples of a piece."""
    rows = np.flatnonzero(record.training)
    held = np.zeros(record.size, dtype=np.bool_)
    held[rows[len(rows) - int(LATE * len(rows)) :]] = True
    return held
