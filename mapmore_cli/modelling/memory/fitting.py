"""From pieces of recordings to a model with memory: its terms, the open numbers of its operators,
its coefficients.

Where free runs choose the terms, a beam of the best few models of each size is carried on, forward,
then backward.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import MemoryFit
from mapmore_cli.modelling.expressions import NotFinite
from mapmore_cli.modelling.frols.ridge import Regularised
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.refinement import (
    EMPTY,
    QUICK,
    THOROUGH,
    Coefficients,
    minimise,
    refine,
)
from mapmore_cli.modelling.memory.selectors import Choice
from mapmore_cli.modelling.memory.training import DIGITS, Training, Unknown, left_open
from mapmore_cli.modelling.selection import MemoryRecipe

# share of each piece's training samples on which free runs compete, where they decide on the number
# of terms
LATE = 0.25
STARTS = 3  # sets of numbers of operators that are refined
SHORT = 2048  # training samples on which they compete
WIDTH = 3  # models of each size that the beam carries on
SHORTLIST = 5  # candidates that are tried beside each of them: the best of a step one step ahead

DIVERGES = "use another `fit.stop`, fewer delayed outputs, or a ridge"

Tick = Callable[[], None]  # called for every model that is tried in free run


@dataclass(frozen=True)
class Member:
    """A model that competes: indices of its terms, in the order in which they were taken, and its
    coefficients.
    """

    chosen: tuple[int, ...]
    point: Coefficients


def fit_with_memory(
    records: Sequence[Record],
    recipe: MemoryRecipe,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> MemoryFit:
    """Choose and fit the terms of one model to the training samples of all pieces.

    Numbers of operators that the dictionary leaves open are found first; they and the coefficients
    minimise the error in free run. `progress` is told how many models were tried in free run, and
    of how many at most.

    Raises DataError where a quantity is missing, no sample has enough history, a state cannot be
    fed back, the dictionary needs more memory than there is, or no model's free run stays finite.
    """
    numbers = left_open(records, recipe.dictionary, recipe.step)
    tick = _counter(
        recipe, progress, refines=recipe.criterion == "free_run" or bool(numbers.states)
    )
    start = _start(records, recipe, numbers) if numbers.states else EMPTY
    best, held_out = (
        _best_in_free_run(records, recipe, numbers.numbers(start), tick)
        if recipe.stop == "free_run"
        else (None, None)
    )
    training = Training(records, recipe, numbers.numbers(start))
    choice = (
        training.selector.best() if best is None else training.selector.among(np.array(best.chosen))
    )
    if best is not None:
        selection = replace(choice.selection, stop="free_run")
        choice = replace(
            choice,
            selection=selection,
            forward=choice.forward if recipe.select == "one_step" else selection.chosen,
        )
    chosen = choice.selection.chosen
    own = numbers.those_of(training.open_in(chosen))
    if recipe.criterion == "one_step" and not own.any():
        return replace(training.fit(choice), held_out=held_out)
    problem = training.problem(chosen, search=True)
    points = [refine(problem, _ahead(choice, start[own]), THOROUGH)]
    if best is not None:
        points.append(
            minimise(
                problem,
                replace(best.point.ordered(best.chosen, chosen), numbers=start[own]),
                None,
                THOROUGH,
            )
        )
    tick()
    point = min(points, key=lambda point: point.error)
    if not np.isfinite(point.error):
        raise DataError(
            "the free run of the chosen terms diverges on the training samples", DIVERGES
        )
    if own.any():
        start[own] = point.numbers
        training = Training(records, recipe, numbers.numbers(start, DIGITS))
        again = training.selector.among(chosen)
        point = point.ordered(chosen, again.selection.chosen)
        choice = replace(
            again,
            selection=replace(again.selection, stop=choice.selection.stop),
            forward=choice.forward,
        )
    return replace(training.refined(choice, point), held_out=held_out)


def _counter(recipe: MemoryRecipe, progress: Callable[[int, int], None], *, refines: bool) -> Tick:
    """Return what counts the models that are tried."""
    sizes = recipe.max_terms
    of_beam = SHORTLIST + (sizes - 1) * WIDTH * SHORTLIST + sizes * (sizes + 1) // 2 - 1
    total = refines + (
        0 if recipe.stop != "free_run" else of_beam if recipe.select == "free_run" else sizes
    )
    numbers = iter(range(1, total + 1))
    return lambda: progress(next(numbers), total)


def _ahead(choice: Choice, numbers: Array = EMPTY) -> Coefficients:
    """Coefficients of one step ahead, and the operators' numbers that go with them."""
    return Coefficients(choice.selection.theta, choice.constant, numbers=numbers)


def _start(records: Sequence[Record], recipe: MemoryRecipe, numbers: Unknown) -> Array:
    """Where the search for open numbers begins: the best of a few sets, refined on a short part
    with the terms that each set prefers.
    """

    def ahead(own: tuple[float, ...]) -> float:
        with np.errstate(all="ignore"):
            try:
                return Training(records, recipe, own).selector.best().selection.sse
            except NotFinite:
                return np.inf  # these numbers make the state grow without bound

    best, least = EMPTY, np.inf
    before = np.cumsum(
        [0, *(record.training.sum() for record in records)]
    )  # the first training samples of all pieces together compete
    short = [
        one.training & (np.cumsum(one.training) <= SHORT - taken)
        for one, taken in zip(records, before, strict=False)
    ]
    for own in numbers.scan(ahead, STARTS):
        training, searched = Training(records, recipe, own), numbers.searched(own)
        choice = training.selector.best()
        chosen = choice.selection.chosen
        if not len(best):
            best = searched  # what is left where no set's free run stays finite, or none is chosen
        part = numbers.those_of(training.open_in(chosen))
        point = refine(
            training.problem(chosen, short, search=True), _ahead(choice, searched[part]), THOROUGH
        )
        if point.error < least:
            best, least = searched, point.error
            best[part] = point.numbers
    return best


def _best_in_free_run(
    records: Sequence[Record], recipe: MemoryRecipe, numbers: Sequence[float], tick: Tick
) -> tuple[Member, Array]:
    """Fit models of every size to the early training samples, and run them over the late ones.

    Returns the model of the least error, and the RMSE of the models of 1, 2, ... terms.
    """
    late = []
    for record in records:
        rows = np.flatnonzero(record.training)
        late.append(np.isin(np.arange(record.size), rows[len(rows) - int(LATE * len(rows)) :]))
    early = Training(
        [
            Record(record.columns, record.training & ~held)
            for record, held in zip(records, late, strict=True)
        ],
        recipe,
        numbers,
    )
    members = beam(early, tick) if recipe.select == "free_run" else _one_step(early, tick)
    problems = [early.problem(np.array(member.chosen), late) for member in members]
    errors = np.array(
        [
            np.sqrt(one.at(member.point).sse / one.samples)
            for one, member in zip(problems, members, strict=True)
        ]
    )
    if not np.isfinite(errors).any():
        raise DataError(
            "the free run of every model diverges, or has no history, on the last quarter of "
            "the training samples",
            DIVERGES,
        )
    return members[int(np.argmin(errors))], errors


def _one_step(training: Training, tick: Tick) -> list[Member]:
    """Models of 1, 2, ... terms that were chosen one step ahead."""
    members = []
    for terms in range(1, training.recipe.max_terms + 1):
        choice = training.selector.of_size(terms)
        point = _ahead(choice)
        if training.recipe.criterion == "free_run":
            point = refine(training.problem(choice.selection.chosen), point, THOROUGH)
        members.append(Member(tuple(choice.selection.chosen.tolist()), point))
        tick()
    return members


def beam(training: Training, tick: Tick) -> list[Member]:
    """Return the best model of 1, 2, ... terms, up to the recipe's number; models whose free run
    diverges are left out.

    Forward, each of the `WIDTH` best models of a size is tried with each of the best few candidates
    of the next step of FROLS. Backward, the largest gives up the term whose loss its free run feels
    least, and so on.
    """
    best: list[Member] = []
    members = [Member((), Coefficients(EMPTY, 0.0))]
    for _ in range(training.recipe.max_terms):
        tried: dict[frozenset[int], Member] = {}
        for member in members:
            for candidate in _shortlist(
                training.selector.ranking, np.array(member.chosen, dtype=np.int64)
            ):
                chosen = (*member.chosen, candidate)
                if frozenset(chosen) not in tried:
                    tried[frozenset(chosen)] = _grown(training, member, chosen)
                    tick()
        members = _best_of(tried.values())
        if not members:
            break
        best.append(members[0])
    return _pruned(training, best, tick)


def _shortlist(data: Regularised, chosen: IntArray) -> list[int]:
    """Return the candidates that reduce the regularised error one step ahead most beside the chosen
    ones, the best first.
    """
    gains = data.reductions(chosen)
    gains[chosen] = 0.0
    return [
        int(place) for place in np.argsort(-gains, kind="stable")[:SHORTLIST] if gains[place] > 0
    ]


def _grown(training: Training, member: Member, chosen: tuple[int, ...]) -> Member:
    """One more term, from two starts: the coefficients of the smaller model, and those of one step
    ahead.
    """
    problem = training.problem(np.array(chosen))
    smaller = Coefficients(np.append(member.point.theta, 0.0), member.point.constant)
    found = training.selector.among(np.array(chosen))
    ahead = _ahead(found).ordered(found.selection.chosen, chosen)
    points = [minimise(problem, smaller, None, QUICK), refine(problem, ahead, QUICK)]
    return Member(chosen, min(points, key=lambda point: point.error))


def _best_of(members: Iterable[Member]) -> list[Member]:
    return sorted(
        (one for one in members if np.isfinite(one.point.error)), key=lambda one: one.point.error
    )[:WIDTH]


def _pruned(training: Training, best: list[Member], tick: Tick) -> list[Member]:
    """Return the best of each size, forward or by deletion from the next larger."""
    for size in range(len(best) - 1, 0, -1):
        larger = best[size]
        tried = [best[size - 1]]
        for place in range(len(larger.chosen)):
            chosen = tuple(np.delete(larger.chosen, place).tolist())
            point = Coefficients(np.delete(larger.point.theta, place), larger.point.constant)
            tried.append(
                Member(chosen, minimise(training.problem(np.array(chosen)), point, None, QUICK))
            )
            tick()
        best[size - 1] = _best_of(tried)[0]
    return best
