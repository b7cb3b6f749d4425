"""From names of states to numbers: ranges, resonances and scales, from the training samples alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import MemoryModel, StateSet
from mapmore_cli.modelling.memory.evaluation import Known, value_of
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.resonances import find_resonance
from mapmore_cli.modelling.terms.operators import OPERATORS
from mapmore_cli.modelling.terms.states import Measured, Operated, State, state


def resolve(
    names: Sequence[str],
    records: Sequence[Record],
    target: str,
    step: float,
    *,
    scale: bool,
    margin: float,
    resonances: Mapping[str, tuple[float, float]] | None = None,
) -> StateSet:
    """The states of these names, with every number that they need.

    Parameters
    ----------
    names
        Texts of states; each once.
    target
        The output: `resonance` without numbers is the oscillator that explains most of it.
    step
        Time between samples, s.
    scale
        Whether states are scaled to [0, 1] on the training samples and clipped `margin` beyond.
    resonances
        Those that were found already.

    Raises
    ------
    DataError
        Where a quantity is missing, or no training sample has a value of every state.
    """
    states = StateSet(tuple(names), step, {}, dict(resonances or {}), np.empty(0), np.empty(0), margin)
    known: list[Known] = [{} for _ in records]
    for found in dict.fromkeys(part for name in names for part in _parts(state(name))):
        if isinstance(found, Operated):
            states = _numbered(found, records, target, states, known)
    if not scale:
        return states
    limits = [_range(_training_values(state(name), records, states, known), name) for name in names]
    return replace(states, low=np.array([low for low, _ in limits]), high=np.array([high for _, high in limits]))


def _parts(found: State) -> Iterator[State]:
    """The state and all that it is made of, the innermost first."""
    if not isinstance(found, Measured):
        yield from _parts(found.source)
    yield found


def _numbered(found: Operated, records: Sequence[Record], target: str, states: StateSet, known: list[Known]) -> StateSet:
    name, needs = found.source.name, OPERATORS[found.operator].needs
    if needs == "range" and name not in states.ranges:
        return replace(states, ranges={**states.ranges, name: _range(_training_values(found.source, records, states, known), name)})
    if needs == "oscillator" and not found.numbers and name not in states.resonances:
        driving = [value_of(found.source, record.columns, states, own) for record, own in zip(records, known, strict=True)]
        oscillator = find_resonance(driving, [record.columns[target] for record in records], [r.training for r in records], states.step)
        return replace(states, resonances={**states.resonances, name: oscillator})
    return states


def _training_values(found: State, records: Sequence[Record], states: StateSet, known: list[Known]) -> Array:
    return np.concatenate(
        [value_of(found, record.columns, states, own)[record.training] for record, own in zip(records, known, strict=True)]
    )


def _range(values: Array, name: str) -> tuple[float, float]:
    values = values[np.isfinite(values)]
    if not len(values):
        raise DataError(f"`{name}` has no value on any training sample", "use fewer steps of delay, or longer recordings")
    return float(values.min()), float(values.max())


def memory_inputs(memory: MemoryModel) -> tuple[str, ...]:
    """Every quantity that the states are made of, besides the output."""
    return tuple(sorted({state(name).quantity for name in memory.states.names} - {memory.output}))
