"""Estimate free parameters of operators. An example is the term `wen(force[k-1])`, which does not
give the numbers p and q of the operator `wen`.

Sets of starting values are taken from a grid. For every set, FROLS chooses the terms, and the
one-step-ahead error is computed. The sets with the smallest errors are then refined, together with
all coefficients, in free run. Most of these searches end at the best model. If a search begins at
random starting values, it rarely ends at the best model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, product

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.fits import Identified
from mapmore_cli.modelling.expressions import Name, parse, substitute, to_text
from mapmore_cli.modelling.expressions.operator import Parameter
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import Measured, Operated, State, state
from mapmore_cli.modelling.memory.records import Record

DIGITS = 10  # number of significant digits to which estimated parameters are rounded
ALL = 64  # if there are at most this many sets of starting values, all are tried
# a parameter is at a bound if its distance from the bound is at most this fraction of its range
AT_BOUND = 1e-6


Numbers = tuple[tuple[float, ...], ...]  # for each operator, a value of each free parameter


@dataclass(frozen=True)
class Unknown:
    """The m free parameters: parameters of operators that are not written in the terms, so that
    they must be estimated. For a parameter that must be positive, the search coordinate is its
    logarithm.

    - `states`: states of the operators whose parameters are not written, each once. A state comes
      after the states from which it is computed. The order depends only on the names, so that it is
      the same for any other set of terms.
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
        """Return the search coordinates, (m,), of the parameter values `numbers`."""
        return self._place(np.clip(numbers, *self.limits))

    def numbers(self, searched: Array, digits: int = 17) -> tuple[float, ...]:
        """Return the parameters that belong to search coordinates, rounded to `digits` significant
        digits.
        """
        positive = self.limits[0] > 0
        values = np.where(positive, np.exp(np.where(positive, searched, 0.0)), searched)
        return tuple(float(f"{value:.{digits}g}") + 0.0 for value in values)

    def those_of(self, part: Unknown) -> BoolArray:
        """Return a mask, (m,), that is True for the parameters in `part`. `part` holds the free
        parameters of a subset of the terms.
        """
        return np.array([operated in part.states for operated, _ in self.places], dtype=np.bool_)

    def filled(self, texts: Sequence[str], numbers: Sequence[float]) -> tuple[str, ...]:
        """Return the terms with the parameters inserted in the names of their states."""
        rest = list(numbers)
        by_state = {}
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
        """Return starting values of the search coordinates, (m,). For parameters that were
        estimated `before`, these are the earlier estimates. For all other parameters, they are the
        middle between the bounds.
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

        If there are few sets, all are tried. Otherwise, the states are treated one after the other:
        all starting values of one state are tried, and all other states have the best parameters so
        far.
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
    """Return the free parameters, which are the operators' parameters that are not written in the
    terms. `step` is the time between samples in s.
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
