"""Values of states with memory along a piece of a recording."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import StateSet
from mapmore_cli.modelling.terms.operator import Setting
from mapmore_cli.modelling.terms.operators import OPERATORS
from mapmore_cli.modelling.terms.recursion import along
from mapmore_cli.modelling.terms.states import Lagged, Measured, Operated, State, state

Known = dict[str, Array]
"""Values that were computed already, by the name of their state."""


def evaluate_states(states: StateSet, columns: Columns) -> dict[str, Array]:
    """Every state along one uninterrupted piece, (n,) each, scaled and clipped as `states` says; NaN before there is history.

    Raises
    ------
    DataError
        Where a quantity is missing.
    """
    known: Known = {}
    values = {name: value_of(state(name), columns, states, known) for name in states.names}
    if not states.scaled:
        return values
    return {name: scaled(values[name], low, high, states.margin) for name, low, high in zip(values, states.low, states.high, strict=True)}


def scaled(values: Array, low: float, high: float, margin: float) -> Array:
    """`(values - low)/(high - low)`, clipped to `[-margin, 1 + margin]`; a state that stood still in training is zero."""
    width = high - low
    return np.clip((values - low) / width, -margin, 1 + margin) if width > 0 else np.where(np.isnan(values), np.nan, 0.0)


def value_of(found: State, columns: Columns, numbers: StateSet, known: Known) -> Array:
    """One state in physical units, (n,); intermediate states are kept in `known`."""
    name = found.name
    if name not in known:
        known[name] = _computed(found, columns, numbers, known)
    return known[name]


def _computed(found: State, columns: Columns, numbers: StateSet, known: Known) -> Array:
    match found:
        case Measured(name):
            if name not in columns:
                raise DataError(f"there is no column `{name}`", f"there are: {', '.join(columns) or 'none'}")
            return np.asarray(columns[name], dtype=np.float64)
        case Lagged(source, steps):
            return delayed(value_of(source, columns, numbers, known), steps)
        case Operated(operator, source):
            return along(OPERATORS[operator], value_of(source, columns, numbers, known), setting_of(found, numbers))


def setting_of(found: Operated, numbers: StateSet) -> Setting:
    """What an operator's state depends on: numbers of its name, or those that training found."""
    source = found.source.name
    match OPERATORS[found.operator].needs:
        case "range":
            return Setting(found.numbers, numbers.step, numbers.ranges[source])
        case "oscillator" if not found.numbers:
            return Setting(numbers.resonances[source], numbers.step)
    return Setting(found.numbers, numbers.step)


def delayed(x: Array, steps: int) -> Array:
    """`x[k - steps]`, (n,); NaN before there is history."""
    values = np.full(len(x), np.nan)
    values[steps:] = x[: max(len(x) - steps, 0)]
    return values
