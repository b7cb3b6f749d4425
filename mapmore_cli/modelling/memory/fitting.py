"""From pieces of recordings to a model with memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import BoolArray, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import MemoryFit
from mapmore_cli.modelling.memory.beam import Member, Tick, beam, trials
from mapmore_cli.modelling.memory.recipe import MemoryRecipe
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.refinement import THOROUGH, Coefficients, refine
from mapmore_cli.modelling.memory.selectors import Choice
from mapmore_cli.modelling.memory.training import Training

LATE = 0.25
"""Share of each piece's training samples on which free runs compete, where they decide on the number of terms."""

DIVERGES = "use another `fit.stop`, fewer delayed outputs, or a ridge"

Progress = Callable[[int, int], None]
"""Called with how many models were tried in free run, and of how many at most."""


def fit_with_memory(records: Sequence[Record], recipe: MemoryRecipe, progress: Progress = lambda _done, _total: None) -> MemoryFit:
    """Choose and fit the terms of one model to the training samples of all pieces.

    Raises
    ------
    DataError
        Where a quantity is missing, no sample has enough history, a state cannot be fed back, the dictionary needs more memory than there
        is, or no model's free run stays finite.
    """
    tick = _counted(recipe, progress)
    if recipe.stop != "free_run":
        training = Training(records, recipe)
        choice = training.selector.best(recipe.stop, recipe.tolerance)
    else:
        chosen = _chosen_by_free_run(records, recipe, tick)
        training = Training(records, recipe)
        choice = training.selector.among(chosen)
        choice = replace(choice, selection=replace(choice.selection, stop="free_run"))
    if recipe.criterion == "one_step":
        return training.fit(choice)
    point = refine(training.problem(choice.selection.chosen), _ahead(choice), THOROUGH)
    tick()
    if not np.isfinite(point.error):
        raise DataError("the free run of the chosen terms diverges on the training samples", DIVERGES)
    return training.refined(choice, point)


def _counted(recipe: MemoryRecipe, progress: Progress) -> Tick:
    """What counts the models that are tried."""
    sizes = trials(recipe.max_terms) if recipe.select == "free_run" else recipe.max_terms
    total = (sizes if recipe.stop == "free_run" else 0) + (recipe.criterion == "free_run")
    numbers = iter(range(1, total + 1))
    return lambda: progress(next(numbers), total)


def _ahead(choice: Choice) -> Coefficients:
    """Coefficients of one step ahead."""
    return Coefficients(choice.selection.theta, choice.constant)


def _chosen_by_free_run(records: Sequence[Record], recipe: MemoryRecipe, tick: Tick) -> IntArray:
    """The terms of the model, of those fitted to the early training samples, whose free run errs least over the late ones."""
    late = [_late(record) for record in records]
    early = Training([Record(record.columns, record.training & ~held) for record, held in zip(records, late, strict=True)], recipe)
    members = beam(early, recipe.max_terms, tick) if recipe.select == "free_run" else _one_step(early, recipe, tick)
    errors = [early.problem(np.array(one.chosen), late).at(one.point).sse for one in members]
    if not np.isfinite(errors).any():
        raise DataError("the free run of every model diverges, or has no history, on the last quarter of the training samples", DIVERGES)
    return np.array(members[int(np.argmin(errors))].chosen)


def _one_step(training: Training, recipe: MemoryRecipe, tick: Tick) -> list[Member]:
    """Models of 1, 2, ... terms that were chosen one step ahead."""
    choices = [training.selector.of_size(terms) for terms in range(1, recipe.max_terms + 1)]
    members = []
    for choice in choices:
        point = _ahead(choice)
        if recipe.criterion == "free_run":
            point = refine(training.problem(choice.selection.chosen), point, THOROUGH)
        members.append(Member(tuple(choice.selection.chosen.tolist()), point))
        tick()
    return members


def _late(record: Record) -> BoolArray:
    """The last training samples of a piece."""
    rows = np.flatnonzero(record.training)
    held = np.zeros(record.size, dtype=np.bool_)
    held[rows[len(rows) - int(LATE * len(rows)) :]] = True
    return held
