"""From pieces of recordings to a model with memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import MemoryFit
from mapmore_cli.modelling.memory.beam import Member, Tick, beam, trials
from mapmore_cli.modelling.memory.recipe import MemoryRecipe
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.refinement import THOROUGH, Coefficients, minimise, refine
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
    best = _best_in_free_run(records, recipe, tick) if recipe.stop == "free_run" else None
    training = Training(records, recipe)
    if best is None:
        choice = training.selector.best(recipe.stop, recipe.tolerance)
    else:
        choice = training.selector.among(np.array(best.member.chosen))
        choice = replace(choice, selection=replace(choice.selection, stop="free_run"))
        if recipe.select == "free_run":
            choice = replace(choice, forward=choice.selection.chosen)  # nothing else was chosen and pruned
    held_out = None if best is None else best.errors
    if recipe.criterion == "one_step":
        return replace(training.fit(choice), held_out=held_out)
    problem = training.problem(choice.selection.chosen)
    points = [refine(problem, _ahead(choice), THOROUGH)]
    if best is not None:
        points.append(minimise(problem, _ordered(best.member, choice), None, THOROUGH))
    tick()
    point = min(points, key=lambda point: point.error)
    if not np.isfinite(point.error):
        raise DataError("the free run of the chosen terms diverges on the training samples", DIVERGES)
    return replace(training.refined(choice, point), held_out=held_out)


def _counted(recipe: MemoryRecipe, progress: Progress) -> Tick:
    """What counts the models that are tried."""
    sizes = trials(recipe.most_terms) if recipe.select == "free_run" else recipe.most_terms
    total = (sizes if recipe.stop == "free_run" else 0) + (recipe.criterion == "free_run")
    numbers = iter(range(1, total + 1))
    return lambda: progress(next(numbers), total)


def _ahead(choice: Choice) -> Coefficients:
    """Coefficients of one step ahead."""
    return Coefficients(choice.selection.theta, choice.constant)


def _ordered(member: Member, choice: Choice) -> Coefficients:
    """Coefficients of a member in the order of the same terms of a choice."""
    places = [member.chosen.index(int(term)) for term in choice.selection.chosen]
    return Coefficients(member.point.theta[places], member.point.constant)


@dataclass(frozen=True)
class _Best:
    """The model of the least error over the late training samples, and the RMSE there of the models of 1, 2, ... terms."""

    member: Member
    errors: Array


def _best_in_free_run(records: Sequence[Record], recipe: MemoryRecipe, tick: Tick) -> _Best:
    """Fit models of every size to the early training samples, and run them over the late ones."""
    late = [_late(record) for record in records]
    early = Training([Record(record.columns, record.training & ~held) for record, held in zip(records, late, strict=True)], recipe)
    members = beam(early, recipe.most_terms, tick) if recipe.select == "free_run" else _one_step(early, recipe, tick)
    problems = [early.problem(np.array(member.chosen), late) for member in members]
    errors = np.array([np.sqrt(one.at(member.point).sse / one.samples) for one, member in zip(problems, members, strict=True)])
    if not np.isfinite(errors).any():
        raise DataError("the free run of every model diverges, or has no history, on the last quarter of the training samples", DIVERGES)
    return _Best(members[int(np.argmin(errors))], errors)


def _one_step(training: Training, recipe: MemoryRecipe, tick: Tick) -> list[Member]:
    """Models of 1, 2, ... terms that were chosen one step ahead."""
    choices = [training.selector.of_size(terms) for terms in range(1, recipe.most_terms + 1)]
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
