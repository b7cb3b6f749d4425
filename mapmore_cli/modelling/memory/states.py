"""Values of states with memory along a piece of a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import MemoryModel, StateSet
from mapmore_cli.modelling.expressions.operator import Setting, along
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import Lagged, Measured, Operated, State, state
from mapmore_cli.modelling.memory.records import Record

Known = dict[str, Array]
"""Values that were computed already, by the name of their state."""


def evaluate_states(states: StateSet, columns: Columns) -> dict[str, Array]:
    """Every state along one uninterrupted piece, (n,) each, scaled and clipped as `states` says; NaN before there is history.

    Raises DataError where a quantity is missing.
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
    """Return what an operator's state depends on: numbers of its name, or those that training found."""
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


FREQUENCIES = tuple(np.geomspace(1.0, 15.0, 30).tolist())
"""Hz: what a load on a soft muscle rings with."""

DAMPINGS = (0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7)

FASTEST = 0.2
"""Cycles per sample: a faster oscillation is not resolved."""

TIE = 1e-9
"""An oscillator must explain more than another by this fraction to be preferred."""

RANK = 1e-10
"""Relative to the larger, a direction of the oscillator with so little of its own explains nothing."""

CREEP = 0.3
"""Time constant of the slow state that stands for everything else with memory, s."""


def find_resonance(driving: Sequence[Array], output: Sequence[Array], training: Sequence[BoolArray], step: float) -> tuple[float, float]:
    """Frequency (Hz) and damping ratio of the oscillator that leaves least of the training output, the slowest of equals.

    The output is fitted with `[1, x, x^2, s, y, v]`: the driving quantity x, a slow state s of it, the oscillator's position y and
    velocity v.

    - `driving`, `output`: (n,) for every piece.
    - `training`: (n,) samples that count.
    """
    frequencies = [f for f in FREQUENCIES if f * step <= FASTEST]
    if not frequencies:
        raise DataError(
            f"no resonance can be seen with {step:g} s between samples: the lowest that is looked for has {FREQUENCIES[0]:g} Hz",
            "give frequency and damping, as resonance(pressure, 0.1, 0.3), or sample faster",
        )
    x = _pooled(driving, training)
    creep = [along(OPERATORS["slow"], one, Setting((CREEP,), step)) for one in driving]
    others = np.column_stack([np.ones(len(x)), x, x**2, _pooled(creep, training)])
    known = np.isfinite(others).all(axis=1)
    basis = np.linalg.qr(others[known])[0]
    y = _pooled(output, training)[known]
    left = y - basis @ (basis.T @ y)
    best = (-np.inf, frequencies[0], DAMPINGS[0])
    for frequency in frequencies:
        for damping in DAMPINGS:
            positions = [along(OPERATORS["resonance"], one, Setting((frequency, damping), step)) for one in driving]
            velocities = [np.nan_to_num(np.diff(one, prepend=one[:1])) for one in positions]  # at rest where they begin
            moved = np.column_stack([_pooled(positions, training), _pooled(velocities, training)])[known]
            gain = _explained(left, moved, basis)
            if gain > best[0] * (1 + TIE):
                best = (gain, frequency, damping)
    return best[1], best[2]


def _explained(left: Array, moved: Array, basis: Array) -> float:
    """By how much columns `moved` reduce the sum of squares of `left`, which is orthogonal to `basis`, beside the basis."""
    along, products = basis.T @ moved, moved.T @ left
    gram = moved.T @ moved - along.T @ along
    return float(products @ np.linalg.lstsq(gram, products, rcond=RANK)[0])


def _pooled(values: Sequence[Array], training: Sequence[BoolArray]) -> Array:
    return np.concatenate([one[rows] for one, rows in zip(values, training, strict=True)])


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
    """Return the states of these names, with every number that they need.

    - `names`: texts of states; each once.
    - `target`: the output: `resonance` without numbers is the oscillator that explains most of it.
    - `step`: time between samples, s.
    - `scale`: whether states are scaled to [0, 1] on the training samples and clipped `margin` beyond.
    - `resonances`: those that were found already.

    Raises DataError where a quantity is missing, or no training sample has a value of every state.
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
    """Yield the state and all that it is made of, the innermost first."""
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
