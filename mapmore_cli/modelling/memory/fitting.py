"""From pieces of recordings to a model with memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import MemoryFit
from mapmore_cli.modelling.expressions import NotFinite
from mapmore_cli.modelling.memory.beam import Member, Tick, beam, trials
from mapmore_cli.modelling.memory.identification import DIGITS, Unknown, scan, unknown
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.refinement import THOROUGH, Coefficients, minimise, refine
from mapmore_cli.modelling.memory.selectors import Choice
from mapmore_cli.modelling.memory.training import Training
from mapmore_cli.modelling.selection import MemoryRecipe

LATE = 0.25
"""Share of each piece's training samples on which free runs compete, where they decide on the number of terms."""

STARTS = 3
"""Sets of numbers of operators that are refined."""

SHORT = 2048
"""Training samples on which they compete."""

DIVERGES = "use another `fit.stop`, fewer delayed outputs, or a ridge"

Progress = Callable[[int, int], None]
"""Called with how many models were tried in free run, and of how many at most."""


def fit_with_memory(records: Sequence[Record], recipe: MemoryRecipe, progress: Progress = lambda _done, _total: None) -> MemoryFit:
    """Choose and fit the terms of one model to the training samples of all pieces.

    Numbers of operators that the dictionary leaves open are found first; they and the coefficients minimise the error in free run.

    Raises DataError where a quantity is missing, no sample has enough history, a state cannot be fed back, the dictionary needs more memory
    than there is, or no model's free run stays finite.
    """
    longest = recipe.step * max((int(record.training.sum()) for record in records), default=1)
    numbers = unknown(recipe.dictionary, recipe.step, longest)
    tick = _counted(recipe, progress, refines=recipe.criterion == "free_run" or bool(numbers.states))
    start = _start(records, recipe, numbers) if numbers.states else np.empty(0)
    filled = replace(recipe, dictionary=numbers.filled(recipe.dictionary, numbers.numbers(start)))
    best = _best_in_free_run(records, filled, tick) if recipe.stop == "free_run" else None
    training = Training(records, filled)
    if best is None:
        choice = training.selector.best(recipe.stop, recipe.tolerance)
    else:
        choice = training.selector.among(np.array(best.member.chosen))
        choice = replace(choice, selection=replace(choice.selection, stop="free_run"))
        if recipe.select == "free_run":
            choice = replace(choice, forward=choice.selection.chosen)  # nothing else was chosen and pruned
    held_out = None if best is None else best.errors
    open_terms = [recipe.dictionary[term] for term in choice.selection.chosen]
    own = _of_terms(numbers, training.unknown(open_terms), start)
    if recipe.criterion == "one_step" and not len(own):
        return replace(training.fit(choice), held_out=held_out)
    problem = training.problem(choice.selection.chosen, open_terms=open_terms)
    points = [refine(problem, _ahead(choice, own), THOROUGH)]
    if best is not None:
        points.append(minimise(problem, replace(_ordered(best.member, choice), numbers=own), None, THOROUGH))
    tick()
    point = min(points, key=lambda point: point.error)
    if not np.isfinite(point.error):
        raise DataError("the free run of the chosen terms diverges on the training samples", DIVERGES)
    if len(own):
        start = _with_own(numbers, training.unknown(open_terms), start, point.numbers)
        filled = replace(recipe, dictionary=numbers.filled(recipe.dictionary, numbers.numbers(start, DIGITS)))
        training = Training(records, filled)
        again = training.selector.among(choice.selection.chosen)
        kept = choice.selection.chosen.tolist()
        places = [kept.index(term) for term in again.selection.chosen.tolist()]
        point = replace(point, theta=point.theta[places])
        choice = replace(again, selection=replace(again.selection, stop=choice.selection.stop), forward=choice.forward)
        open_terms = [recipe.dictionary[term] for term in choice.selection.chosen]
    return replace(training.refined(choice, point, open_terms), held_out=held_out)


def _start(records: Sequence[Record], recipe: MemoryRecipe, numbers: Unknown) -> Array:
    """Where the search for open numbers begins: the best of a few sets, refined on a short part with the terms that each set prefers."""

    def of(own: tuple[float, ...]) -> tuple[Training, Choice]:
        training = Training(records, replace(recipe, dictionary=numbers.filled(recipe.dictionary, own)))
        if recipe.stop == "free_run":
            return training, training.selector.of_size(recipe.most_terms)
        return training, training.selector.best(recipe.stop, recipe.tolerance)

    def ahead(own: tuple[float, ...]) -> float:
        with np.errstate(all="ignore"):
            try:
                return of(own)[1].selection.sse
            except NotFinite:
                return np.inf  # these numbers make the state grow without bound

    best, least = np.empty(0), np.inf
    short = _short(records)
    for own in scan(numbers, ahead, STARTS):
        training, choice = of(own)
        open_terms = [recipe.dictionary[term] for term in choice.selection.chosen]
        searched, part = numbers.searched(own), training.unknown(open_terms)
        if not len(best):
            best = searched  # what is left where no set's free run stays finite, or none is chosen
        problem = training.problem(choice.selection.chosen, short, open_terms)
        point = refine(problem, _ahead(choice, _of_terms(numbers, part, searched)), THOROUGH)
        if point.error < least:
            best, least = _with_own(numbers, part, searched, point.numbers), point.error
    return best


def _short(records: Sequence[Record]) -> list[BoolArray]:
    """Return the first training samples, up to `SHORT` of all pieces together."""
    left, short = SHORT, []
    for record in records:
        rows = np.flatnonzero(record.training)[:left]
        short.append(np.isin(np.arange(record.size), rows))
        left -= len(rows)
    return short


def _of_terms(numbers: Unknown, part: Unknown, searched: Array) -> Array:
    """Those of the numbers that belong to the states of `part`."""
    return searched[[place.state in part.states for place in numbers.places]] if len(searched) else searched


def _with_own(numbers: Unknown, part: Unknown, searched: Array, own: Array) -> Array:
    """Return the numbers with those of `part` in their places."""
    changed = searched.copy()
    changed[[place.state in part.states for place in numbers.places]] = own
    return changed


def _counted(recipe: MemoryRecipe, progress: Progress, *, refines: bool) -> Tick:
    """Return what counts the models that are tried."""
    sizes = trials(recipe.most_terms) if recipe.select == "free_run" else recipe.most_terms
    total = (sizes if recipe.stop == "free_run" else 0) + refines
    numbers = iter(range(1, total + 1))
    return lambda: progress(next(numbers), total)


def _ahead(choice: Choice, numbers: Array) -> Coefficients:
    """Coefficients of one step ahead, and the operators' numbers that go with them."""
    return Coefficients(choice.selection.theta, choice.constant, numbers=numbers)


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
        point = _ahead(choice, np.empty(0))
        if recipe.criterion == "free_run":
            point = refine(training.problem(choice.selection.chosen), point, THOROUGH)
        members.append(Member(tuple(choice.selection.chosen.tolist()), point))
        tick()
    return members


def _late(record: Record) -> BoolArray:
    """Return the last training samples of a piece."""
    rows = np.flatnonzero(record.training)
    held = np.zeros(record.size, dtype=np.bool_)
    held[rows[len(rows) - int(LATE * len(rows)) :]] = True
    return held
