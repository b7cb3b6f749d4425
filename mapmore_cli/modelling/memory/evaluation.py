"""Values of states with memory along a piece of a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import StateSet
from mapmore_cli.modelling.memory import operators
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
            return operators.delayed(value_of(source, columns, numbers, known), steps)
        case Operated(operator, source):
            return _OPERATIONS[operator](value_of(source, columns, numbers, known), found, numbers)


def _slow(x: Array, found: Operated, numbers: StateSet) -> Array:
    return operators.slow(x, found.numbers[0], numbers.step)


def _play(x: Array, found: Operated, numbers: StateSet) -> Array:
    return operators.play(x, _width(found, numbers))


def _stop(x: Array, found: Operated, numbers: StateSet) -> Array:
    return operators.stop(x, _width(found, numbers))


def _resonance(x: Array, found: Operated, numbers: StateSet) -> Array:
    return operators.resonance(x, *_oscillator(found, numbers), numbers.step)


def _velocity(x: Array, found: Operated, numbers: StateSet) -> Array:
    return operators.resonance_velocity(x, *_oscillator(found, numbers), numbers.step)


def _saturate(x: Array, found: Operated, numbers: StateSet) -> Array:
    return np.clip(x, *numbers.ranges[found.source.name])


_OPERATIONS: Mapping[str, Callable[[Array, Operated, StateSet], Array]] = MappingProxyType(
    {
        "slow": _slow,
        "play": _play,
        "stop": _stop,
        "resonance": _resonance,
        "resonance_velocity": _velocity,
        "saturate": _saturate,
    }
)


def _width(found: Operated, numbers: StateSet) -> float:
    low, high = numbers.ranges[found.source.name]
    return found.numbers[0] * (high - low)


def _oscillator(found: Operated, numbers: StateSet) -> tuple[float, float]:
    """Frequency and damping: given in the name, else found in training."""
    if found.numbers:
        return found.numbers[0], found.numbers[1]
    return numbers.resonances[found.source.name]
