"""Compute states with memory along a piece of a recording. Also determine the parameters of their
operators from training data.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from types import MappingProxyType

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, Ends, column_in, extremes
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import MemoryModel, StateSet
from mapmore_cli.modelling.expressions.operator import Setting, along
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.parsing import RANGED, candidate
from mapmore_cli.modelling.expressions.ranged import placed
from mapmore_cli.modelling.expressions.states import Lagged, Measured, Operated, State, state
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.selection import MemoryRecipe

Past = dict[str, Array]
"""The last values of each state, by its name, and of the states inside it. A piece that continues
another starts from them.
"""


def evaluate_states(
    states: StateSet, columns: Columns, past: Past | None = None, *, still: bool = False
) -> dict[str, Array]:
    """Return every state along one uninterrupted piece, shape (n,) each. If `states` has training
    ranges (`low` and `high`), each state is scaled by its range and clipped. At the first rows, a
    state that needs earlier values is NaN.

    With `past`, the piece continues an earlier piece. `past` then holds the last values of the
    earlier piece; this function replaces them by the last values of this piece. With `still`, every
    row is treated separately, as if all quantities had always had the values of this row.

    Raises DataError if a quantity is missing.
    """
    known: dict[str, Array] = {}
    values = {
        name: value_of(state(name), columns, states, known, past, still=still)
        for name in states.names
    }
    if past is not None:
        parts = [part for name in states.names for part in state(name).parts]
        most = max([MOST_PAST, *(part.steps for part in parts if isinstance(part, Lagged))])
        for name, column in known.items():
            past[name] = np.concatenate([past.get(name, np.empty(0)), column])[-most:]
    for name, low, high in zip(states.names, states.low, states.high, strict=states.scaled):
        if high > low:
            values[name] = np.clip(
                (values[name] - low) / (high - low), -states.margin, 1 + states.margin
            )
        else:  # the state was constant in training
            values[name] = np.where(np.isnan(values[name]), np.nan, 0.0)
    return values


MOST_PAST = 2
"""Largest number of past values that an operator needs."""


def value_of(
    wanted: State,
    columns: Columns,
    numbers: StateSet,
    known: dict[str, Array],
    past: Past | None = None,
    *,
    still: bool = False,
) -> Array:
    """Return one state in physical units, shape (n,). The state, and all states inside it, are also
    stored in `known` by name. `past` and `still` have the same meaning as in `evaluate_states`.
    """
    before = {} if past is None else past
    if wanted.name in known:
        return known[wanted.name]
    match wanted:
        case Measured(name):
            values = np.asarray(column_in(columns, name), dtype=np.float64)
        case Lagged() | Operated() if still:
            values = value_of(wanted.source, columns, numbers, known, still=True)
            if isinstance(wanted, Operated):
                rule = OPERATORS[wanted.operator].recursion(setting_of(wanted, numbers))
                values = rule.rest(values)
        case Lagged(source, steps):
            x = value_of(source, columns, numbers, known, past)
            values = delayed(x, steps, before.get(source.name, np.empty(0)))
        case Operated(operator, source):
            values = along(
                OPERATORS[operator],
                value_of(source, columns, numbers, known, past),
                setting_of(wanted, numbers),
                (before.get(wanted.name, np.empty(0)), before.get(source.name, np.empty(0))),
            )
    known[wanted.name] = values
    return values


def setting_of(operated: Operated, numbers: StateSet) -> Setting:
    """Return the numbers that determine a state of an operator. They are taken from its name, or
    from the training.
    """
    source = operated.source.name
    match OPERATORS[operated.operator].needs:
        case "range":
            return Setting(operated.numbers, numbers.step, numbers.ranges[source])
        case "oscillator" if not operated.numbers:
            return Setting(numbers.resonances[source], numbers.step)
    return Setting(operated.numbers, numbers.step)


def delayed(x: Array, steps: int, before: Array) -> Array:
    """Return `x[k - steps]`, shape (n,). `before` holds values before x[0]; if a value is not among
    them, the result is NaN.
    """
    return np.concatenate([np.full(steps, np.nan), before, x])[len(before) :][: len(x)]


def memory_inputs(memory: MemoryModel) -> set[str]:
    """Return every quantity from which the states are computed, except the output."""
    return {state(name).quantity for name in memory.states.names} - {memory.output}


def resolve_states(
    names: Iterable[str],
    records: Sequence[Record],
    recipe: MemoryRecipe,
    resonances: Mapping[str, tuple[float, float]] = MappingProxyType({}),
) -> StateSet:
    """Return the states with these names, in alphabetical order, together with all parameters that
    they need.

    `resonances` holds the parameters of oscillators that are already known. For a `resonance`
    without numbers, the frequency and the damping are determined with which the oscillator explains
    most of the recipe's target.

    Raises DataError if a quantity is missing, or no training sample has a value of every state.
    """
    names = tuple(sorted(names))
    ranges: dict[str, Ends] = {}
    found_already = dict(resonances)
    states = StateSet(
        names,
        recipe.step,
        ranges,
        found_already,
        np.empty(0),
        np.empty(0),
        recipe.margin,
        recipe.ordered,
    )
    known: list[dict[str, Array]] = [{} for _ in records]

    def along_records(wanted: State) -> list[Array]:
        return [
            value_of(wanted, record.columns, states, values)
            for record, values in zip(records, known, strict=True)
        ]

    training = [record.training for record in records]
    for part in dict.fromkeys(part for name in names for part in state(name).parts):
        if not isinstance(part, Operated):
            continue
        source = part.source.name
        needs = OPERATORS[part.operator].needs
        if needs == "range" and source not in ranges:
            ranges[source] = _range(_training_values(along_records(part.source), training), source)
        if needs == "oscillator" and not part.numbers and source not in found_already:
            output = [record.columns[recipe.target] for record in records]
            found_already[source] = find_resonance(
                along_records(part.source), output, training, recipe.step
            )
    if recipe.scaling != "range":
        return states
    limits = np.array(
        [_range(_training_values(along_records(state(name)), training), name) for name in names]
    ).reshape(-1, 2)
    return replace(states, low=limits[:, 0], high=limits[:, 1])


def with_ranges(records: Sequence[Record], recipe: MemoryRecipe) -> tuple[str, ...]:
    """Return the terms of the dictionary, in which every call of `unit` is replaced by a linear
    function with numbers from the training ranges. Raises the same errors as `resolve_states`.
    """
    waiting = {
        name for text in recipe.dictionary if RANGED in text for name in candidate(text).names
    }
    resolved = resolve_states(waiting, records, replace(recipe, scaling="range"))
    low = resolved.low.tolist()
    high = resolved.high.tolist()
    if recipe.scaling == "range":
        low, high = [0.0] * len(low), [1.0] * len(high)
    return placed(recipe.dictionary, tuple(zip(resolved.names, low, high, strict=True)))


def _range(values: Array, name: str) -> Ends:
    values = values[np.isfinite(values)]
    if not len(values):
        raise DataError(
            f"`{name}` has no value on any training sample, because all have too few samples "
            "before them",
            "remove the longest delays from the dictionary, or use longer recordings",
        )
    return extremes(values)


def _training_values(values: Sequence[Array], training: Sequence[BoolArray]) -> Array:
    return np.concatenate([column[rows] for column, rows in zip(values, training, strict=True)])


# natural frequencies that are tried, in Hz; a load on a soft muscle has such frequencies
FREQUENCIES = tuple(np.geomspace(1.0, 15.0, 30).tolist())
DAMPINGS = (0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7)


def find_resonance(
    driving: Sequence[Array], output: Sequence[Array], training: Sequence[BoolArray], step: float
) -> tuple[float, float]:
    """Return the frequency (Hz) and the damping ratio of the oscillator that explains the training
    output best. If several oscillators are equally good, return that with the lowest frequency.

    The output is fitted by a linear combination of `[1, x, x^2, s, y, v]`. Here, x is the driving
    quantity, s is a slow state of x (in place of all other memory), and y and v are the position
    and the velocity of the oscillator.

    - `driving`, `output`: (n,) for every piece.
    - `training`: (n,) for every piece, True for training samples.
    """
    # fewer than five samples per period cannot show an oscillation
    frequencies = [frequency for frequency in FREQUENCIES if frequency * step <= 0.2]
    if not frequencies:
        raise DataError(
            f"with {step:g} s between samples, no resonance can be found: the lowest frequency "
            f"that is tried is {FREQUENCIES[0]:g} Hz, and needs five samples per period",
            "give frequency and damping, for example resonance(pressure, 0.1, 0.3), or "
            "sample faster",
        )

    def pooled(operator: str, *numbers: float) -> Array:
        setting = Setting(numbers, step)
        return _training_values(
            [along(OPERATORS[operator], column, setting) for column in driving], training
        )

    x = _training_values(driving, training)
    others = np.column_stack([np.ones(len(x)), x, x**2, pooled("slow", 0.3)])
    known = np.isfinite(others).all(axis=1)
    basis = np.linalg.qr(others[known])[0]
    y = _training_values(output, training)[known]
    left = y - basis @ (basis.T @ y)
    best = (frequencies[0], DAMPINGS[0])
    most = -np.inf
    for numbers in product(frequencies, DAMPINGS):
        moved = np.column_stack(
            [pooled("resonance", *numbers), pooled("resonance_velocity", *numbers)]
        )[known]
        along_basis, products = basis.T @ moved, moved.T @ left
        gram = moved.T @ moved - along_basis.T @ along_basis
        # decrease of the residual sum of squares
        gain = float(products @ np.linalg.lstsq(gram, products, rcond=1e-10)[0])
        if gain > most * (1 + 1e-9):
            best = numbers
            most = gain
    return best
