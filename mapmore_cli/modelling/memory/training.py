"""Prepare training data for models with memory: free parameters of operators, regressors for
one-step-ahead prediction, and pieces for free runs.

If the name of an operator contains no parameters, for example `wen(force[k-1])`, training estimates
them. Sets of starting values are taken from a grid. For every set, FROLS chooses the terms, and the
one-step-ahead error is computed. The sets with the smallest errors are then refined, together with
all coefficients, in free run. Most of these searches end at the best model. Of searches from
random starting values, few would end there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import chain, product

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray, extremes
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Identified, MemoryFit, MemoryModel, Selection, StateSet
from mapmore_cli.modelling.expressions import Name, parse, substitute, to_text
from mapmore_cli.modelling.expressions.operator import Parameter
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import Measured, Operated, State, state
from mapmore_cli.modelling.expressions.syntax import names_in
from mapmore_cli.modelling.frols.correlated import MOST, correlated_errors
from mapmore_cli.modelling.memory.feedback import Feedback, fed_back_states, parted
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

DIGITS = 10  # number of significant digits to which estimated parameters are rounded
ALL = 64  # if there are at most this many sets of starting values, all are tried
# A parameter within this fraction of its range from a bound counts as being at the bound.
AT_BOUND = 1e-6


Numbers = tuple[tuple[float, ...], ...]  # the numbers of each operator


@dataclass(frozen=True)
class Unknown:
    """The m parameters of operators that are not written in the terms, and are therefore estimated.
    For a parameter that must be positive, the search coordinate is its logarithm.

    - `states`: operators without parameters, without repetitions and the innermost first.
      Operators that occur in two sets of terms have the same order in both sets.
    - `step`, `longest`: time between samples and duration of the longest piece, s.
    """

    states: tuple[Operated, ...]
    step: float
    longest: float

    @cached_property
    def places(self) -> list[tuple[Operated, Parameter]]:
        """Pairs of a state and one of its parameters, one pair for each of the m parameters."""
        return [
            (operated, parameter)
            for operated in self.states
            for parameter in OPERATORS[operated.operator].parameters
        ]

    @cached_property
    def limits(self) -> Array:
        """Smallest and largest value of each parameter, (2, m)."""
        ends = [
            parameter.between(self.step, self.longest)
            for _, parameter in self.places
            if parameter.between is not None
        ]
        return np.array(ends).reshape(-1, 2).T

    @property
    def bounds(self) -> Array:
        """Bounds of the search coordinates, (2, m)."""
        return np.array([self._place(end) for end in self.limits])

    def _place(self, numbers: Array) -> Array:
        positive = self.limits[0] > 0
        return np.where(positive, np.log(np.where(positive, numbers, 1.0)), numbers)

    def searched(self, numbers: Sequence[float]) -> Array:
        """Return the search coordinates of parameters, (m,)."""
        return self._place(np.clip(numbers, *self.limits))

    def numbers(self, searched: Array, digits: int = 17) -> tuple[float, ...]:
        """Return the parameters that belong to search coordinates, rounded to `digits` significant
        digits.
        """
        positive = self.limits[0] > 0
        values = np.where(positive, np.exp(np.where(positive, searched, 0.0)), searched)
        return tuple(float(f"{value:.{digits}g}") + 0.0 for value in values)

    def those_of(self, part: Unknown) -> BoolArray:
        """Return a mask, (m,), of the parameters that occur in `part`, the unknown parameters of
        some of the terms.
        """
        return np.array([operated in part.states for operated, _ in self.places], dtype=np.bool_)

    def filled(self, texts: Sequence[str], numbers: Sequence[float]) -> tuple[str, ...]:
        """Return the terms with the parameters inserted in the names of their states."""
        rest, by_state = list(numbers), {}
        for operated in self.states:
            count = len(OPERATORS[operated.operator].parameters)
            by_state[operated], rest = tuple(rest[:count]), rest[count:]
        return tuple(
            to_text(
                substitute(
                    term, {name: Name(_with(state(name), by_state).name) for name in term.names}
                )
            )
            for term in map(parse, texts)
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the m parameters."""
        return tuple(f"{parameter.key} of {operated.name}" for operated, parameter in self.places)

    def begun_at(self, before: Identified | None) -> Array:
        """Return search coordinates, (m,). For parameters that were estimated `before`, they are
        the earlier estimates; for all other parameters, they are the middle between the bounds.
        """
        at: Array = self.bounds.mean(axis=0)
        if before is not None:
            known = dict(zip(before.names, before.numbers, strict=True))
            own = np.array([name in known for name in self.names])
            at[own] = self.searched([known.get(name, 1.0) for name in self.names])[own]
        return at

    def identified(self, searched: Array, errors: Array) -> Identified:
        """Return the parameters with their standard errors, computed from the standard errors of
        the search coordinates.
        """
        numbers = np.array(self.numbers(searched, DIGITS))
        scale = np.where(self.limits[0] > 0, numbers, 1.0)
        low, high = self.bounds
        near = AT_BOUND * (high - low)
        held = (searched <= low + near) | (searched >= high - near)
        return Identified(self.names, numbers, np.where(held, np.nan, errors * scale), held)

    def scan(
        self, error: Callable[[tuple[float, ...]], float], keep: int
    ) -> list[tuple[float, ...]]:
        """Return the `keep` sets of starting values with the smallest one-step-ahead `error`, the
        best set first.

        If there are few sets, all are tried. Otherwise, the grids of the states are tried one after
        the other, and all other states have the best parameters so far.
        """
        grids = [
            starts(self.step, self.longest)
            for operated in self.states
            if (starts := OPERATORS[operated.operator].starts) is not None
        ]

        def ranked(sets: Iterable[Numbers]) -> list[Numbers]:
            return sorted(sets, key=lambda numbers: error(tuple(chain(*numbers))))

        if math.prod(map(len, grids)) <= ALL:
            best = ranked(product(*grids))
        else:
            best = [tuple(grid[len(grid) // 2] for grid in grids)]
            for place, grid in enumerate(grids):
                best = ranked(
                    (*best[0][:place], numbers, *best[0][place + 1 :]) for numbers in grid
                )
        return [tuple(chain(*numbers)) for numbers in best[:keep]]


def left_open(records: Sequence[Record], terms: Sequence[str], step: float) -> Unknown:
    """Return the operators' parameters that are not written in the terms. `step` is the time
    between samples in s.
    """
    parts = {
        part
        for text in terms
        for name in parse(text).names
        for part in state(name).parts
        if isinstance(part, Operated)
    }
    open_states = [
        part for part in parts if not part.numbers and OPERATORS[part.operator].starts is not None
    ]
    longest = step * max((int(record.training.sum()) for record in records), default=1)
    return Unknown(
        tuple(sorted(open_states, key=lambda operated: (len(operated.name), operated.name))),
        step,
        longest,
    )


def _with(wanted: State, numbers: dict[Operated, tuple[float, ...]]) -> State:
    """Return the state with numbers in place of its free parameters."""
    if isinstance(wanted, Measured):
        return wanted
    inner = _with(wanted.source, numbers)
    return (
        replace(wanted, source=inner, numbers=numbers[wanted])
        if wanted in numbers
        else replace(wanted, source=inner)
    )


class TrainingData:
    """One set of training samples. `numbers` holds the parameters of those operators for which the
    recipe's dictionary gives no parameters.

    Raises DataError if a quantity is missing, too few samples have enough earlier samples, or a
    state cannot be fed back.
    """

    def __init__(
        self, records: Sequence[Record], recipe: MemoryRecipe, numbers: Sequence[float] = ()
    ) -> None:
        self.records, self.recipe = records, recipe
        self.dictionary = left_open(records, recipe.dictionary, recipe.step).filled(
            recipe.dictionary, numbers
        )
        self.terms = tuple(map(parse, self.dictionary))
        self.states = resolve_states(sorted(names_in(self.terms)), records, recipe)
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
        selection, constant, identified = choice.selection, choice.constant, None
        chosen = selection.chosen
        if vector is None:
            selection = self._with_errors(selection, choice)
        else:
            problem, numbers = self.problem(chosen, search=True), self.open_in(chosen)
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
        data, k = self.data, len(selection.chosen)
        weighed = self.recipe.loss != "squares" or data.uncertainty is not None
        if weighed or not k or k * len(data.y) > MOST:
            return selection
        P, y = map(np.concatenate, zip(*data.blocks(selection.chosen), strict=True))
        residual, ridge = y - P @ selection.theta - choice.constant, np.zeros(k)
        if choice.ridge:
            P, ridge = P - P.mean(axis=0), choice.ridge * len(y) * P.var(axis=0)
        errors, worth = correlated_errors(P, residual, data.lengths, ridge)
        return replace(selection, theta_error=errors, worth=worth)

    def open_in(self, chosen: IntArray) -> Unknown:
        """Return the operators' parameters that are not written in the chosen candidates."""
        return left_open(
            self.records, [self.recipe.dictionary[i] for i in chosen], self.recipe.step
        )

    def problem(
        self, chosen: IntArray, counted: Sequence[BoolArray] | None = None, *, search: bool = False
    ) -> FreeRunProblem:
        """Return the simulation error of some candidates as a problem to be minimised.

        The error is computed from all training samples, or only from the samples in the masks
        `counted`, (n,) for each record. The variables of the problem are the coefficients, the
        constant and, with `search`, the free parameters of operators.

        Raises DataError if no sample has enough earlier samples, or if a measured output from which
        a run starts is missing.
        """
        wanted = [record.training for record in self.records] if counted is None else counted
        parts = []  # runs stop at the last sample that counts
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
            terms, states = tuple(self.dictionary[i] for i in chosen), self._states_of(chosen)
            if at:
                terms = numbers.filled(texts, numbers.numbers(np.array(at)))
                resonances = self.states.resonances
                states = resolve_states(
                    sorted(names_in(map(parse, terms))), self.records, self.recipe, resonances
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
        states, used = self.states, names_in(self.terms[i] for i in chosen)
        places = [place for place, name in enumerate(states.names) if name in used]
        kept = replace(states, names=tuple(states.names[place] for place in places))
        return (
            replace(kept, low=states.low[places], high=states.high[places])
            if states.scaled
            else kept
        )
