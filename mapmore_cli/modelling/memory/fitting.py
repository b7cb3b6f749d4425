"""Fit a model with memory to pieces of recordings: its terms, the free parameters of its operators,
and its coefficients.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import itemgetter

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray, root_mean_square
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import MemoryFit
from mapmore_cli.modelling.expressions import NotFinite
from mapmore_cli.modelling.frols import frols_together
from mapmore_cli.modelling.memory.free_parameters import DIGITS, Unknown, left_open
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.refinement import COARSE, FreeRunProblem, Point, minimise, refine
from mapmore_cli.modelling.memory.selectors import TermChoice, problem_of
from mapmore_cli.modelling.memory.training import TrainingData
from mapmore_cli.modelling.selection import MemoryRecipe

# With `stop: free_run`, free runs over this fraction at the end of the training samples of each
# piece decide how many terms the model has.
LATE = 0.25
STARTS = 3  # number of sets of starting values (of the operators' parameters) that are refined
SHORT = 2048  # number of training samples on which the refined sets of starting values are compared

DIVERGES = (
    "write another `fit.stop`, use fewer delayed outputs in the dictionary, or set `fit.ridge`"
)

Progress = Callable[[int, int], None]


def fit_with_memory(
    records: Sequence[Record],
    recipe: MemoryRecipe,
    progress: Progress = lambda _done, _total: None,
    near: MemoryFit | None = None,
) -> MemoryFit:
    """Choose and fit the terms of one model to the training samples of all pieces.

    If the dictionary leaves operator parameters free, they are estimated first. Then the operator
    parameters and the coefficients are changed together to minimise the error in free run.
    `progress` is called with the number of model sizes that were tried in free run, and the number
    of all sizes. `near` is None or a fit to these and further samples. If it is given, the search
    begins at its parameters and coefficients.

    Raises DataError if a quantity is missing, no sample has enough earlier samples, a state cannot
    be fed back, the dictionary needs more memory than there is, or no model has a finite free run.
    """
    numbers = left_open(records, recipe.dictionary, recipe.step)
    if numbers.states and recipe.loss != "squares":
        raise DataError(
            f"{numbers.states[0].name}: its free parameters can be estimated with `loss: squares` "
            f"only, not with `{recipe.loss}`",
            "write the numbers, for example `slow(pressure, 0.3)`, or remove `fit.loss`",
        )
    start = np.empty(0)
    if numbers.states:
        start = numbers.begun_at(near.identified) if near else _start(records, recipe, numbers)
    training = TrainingData(records, recipe, numbers.numbers(start))
    held_out = None
    if recipe.stop == "free_run":
        chosen, held_out = _sized_in_free_run(records, recipe, numbers.numbers(start), progress)
        choice = training.selector.among(chosen, "free_run")
    else:
        choice = training.selector.best()
    chosen = choice.selection.chosen
    in_chosen = numbers.those_of(training.open_in(chosen))
    if recipe.criterion == "one_step" and not in_chosen.any():
        return replace(training.fit(choice), held_out=held_out)
    problem = training.problem(chosen, search=True)
    point = _refined(problem, choice, start[in_chosen], near)
    if not np.isfinite(point.error):
        raise DataError(
            "the predictions of the chosen terms grow without limit on the training samples, if "
            "the model gets its own predictions as past outputs (free run)",
            DIVERGES,
        )
    vector = point.vector
    if in_chosen.any():
        theta, constant, start[in_chosen] = problem.split(vector)
        training = TrainingData(records, recipe, numbers.numbers(start, DIGITS))
        again = training.selector.among(chosen, choice.selection.stop)
        order = [chosen.tolist().index(term) for term in again.selection.chosen]
        vector = np.array([*theta[order], constant, *start[in_chosen]])
        choice = replace(again, forward=choice.forward)
    return replace(training.fit(choice, vector), held_out=held_out)


def fit_outputs(records: Sequence[Record], recipes: Sequence[MemoryRecipe]) -> list[MemoryFit]:
    """Choose and fit the terms of several outputs to the training samples of all pieces. The
    recipes differ only in their targets. All outputs get the same terms.

    Raises the same DataErrors as `fit_with_memory`, and DataError if operators have free
    parameters.
    """
    if numbers := left_open(records, recipes[0].dictionary, recipes[0].step).states:
        raise DataError(
            f"{numbers[0].name}: its free parameters can be estimated for one target only, and "
            f"this spec has {', '.join(recipe.target for recipe in recipes)}",
            "write the numbers, for example `slow(pressure, 0.3)`, or a separate spec for "
            "each target",
        )
    trained = [TrainingData(records, recipe) for recipe in recipes]
    recipe = recipes[0]
    selections = frols_together(
        [problem_of(training.data, training.recipe) for training in trained],
        recipe.max_terms,
        recipe.tolerance,
        stop=recipe.stop,
    )
    return [
        training.fit(TermChoice(selection, 0.0, 0.0, selection.chosen))
        for training, selection in zip(trained, selections, strict=True)
    ]


def _refined(
    problem: FreeRunProblem, choice: TermChoice, numbers: Array, near: MemoryFit | None
) -> Point:
    """Return the coefficients and operator parameters with the smallest error in free run.

    If the fit `near` has the terms of `choice`, the search begins at the coefficients of `near`,
    with free runs over whole pieces. If there is no such fit, or if these runs diverge, the search
    begins at the coefficients of the one-step-ahead fit.
    """
    chosen = choice.selection.chosen.tolist()
    if near is not None and {*near.selection.chosen.tolist()} == {*chosen}:
        order = [near.selection.chosen.tolist().index(term) for term in chosen]
        before = np.array([*near.model.theta[order], near.model.constant, *numbers])
        point = minimise(problem, before, None, COARSE)
        if np.isfinite(point.error):
            return point
    return refine(problem, _ahead(choice, numbers))


def _ahead(choice: TermChoice, numbers: Sequence[float] | Array = ()) -> Array:
    """Return the coefficients of the one-step-ahead fit, its constant, and the parameters of the
    operators, as one vector.
    """
    return np.array([*choice.selection.theta, choice.constant, *numbers])


def _start(records: Sequence[Record], recipe: MemoryRecipe, numbers: Unknown) -> Array:
    """Return the point from which the search for the free parameters begins. For a few sets of
    starting values, terms are chosen and the parameters are refined on a short part of the data.
    The set with the smallest error in free run is returned.
    """

    def ahead(numbers_tried: tuple[float, ...]) -> float:
        with np.errstate(all="ignore"):
            try:
                return TrainingData(records, recipe, numbers_tried).selector.best().selection.sse
            except NotFinite:
                return np.inf  # a state with these parameters grows without bound

    # the sets of starting values are compared on the first training samples of all pieces
    before = np.cumsum([0, *(record.training.sum() for record in records)])
    short = [
        record.training & (np.cumsum(record.training) <= SHORT - count)
        for record, count in zip(records, before, strict=False)
    ]

    def refined(numbers_tried: tuple[float, ...]) -> tuple[float, Array]:
        training = TrainingData(records, recipe, numbers_tried)
        searched = numbers.searched(numbers_tried)
        choice = training.selector.best()
        chosen = choice.selection.chosen
        part = numbers.those_of(training.open_in(chosen))
        problem = training.problem(chosen, short, search=True)
        point = refine(problem, _ahead(choice, searched[part]))
        if np.isfinite(point.error):
            *_, searched[part] = problem.split(point.vector)
        return point.error, searched

    _, best = min(map(refined, numbers.scan(ahead, STARTS)), key=itemgetter(0))
    return best


def _sized_in_free_run(
    records: Sequence[Record], recipe: MemoryRecipe, numbers: Sequence[float], progress: Progress
) -> tuple[IntArray, Array]:
    """Fit models of every size to the early training samples, and simulate them over the late
    training samples.

    Return the terms of the model with the smallest error, and the RMSE of the models of 1, 2, ...
    terms.
    """
    late, beginnings = [], []
    for record in records:
        rows = np.flatnonzero(record.training)
        late.append(np.isin(np.arange(record.size), rows[len(rows) - int(LATE * len(rows)) :]))
        beginnings.append(Record(record.columns, record.training & ~late[-1]))
    early = TrainingData(beginnings, recipe, numbers)
    sizes, errors = [], []
    for terms, chosen in enumerate(early.selector.sizes, 1):
        choice = early.selector.among(chosen, "free_run")
        sizes.append(choice.selection.chosen)
        vector = _ahead(choice)
        if recipe.criterion == "free_run":
            vector = refine(early.problem(sizes[-1]), vector).vector
        held = early.problem(sizes[-1], late).at(vector)
        errors.append(root_mean_square(held.residuals) if held.runs else np.inf)
        progress(terms, len(early.selector.sizes))
    if not np.isfinite(errors).any():
        raise DataError(
            "fit.stop: `free_run` cannot choose the number of terms, because every candidate model "
            "diverges if it gets its own predictions as past outputs (free run along the training "
            "samples)",
            DIVERGES,
        )
    return sizes[int(np.argmin(errors))], np.array(errors)
