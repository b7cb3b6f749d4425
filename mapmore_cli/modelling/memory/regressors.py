"""Training samples as regressors: states in memory, the dictionary only block by block."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import StateSet
from mapmore_cli.modelling.expressions import Expression, dictionary_blocks, dictionary_matrix
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.states import evaluate_states


@dataclass(frozen=True)
class Regressors:
    """States and output on the n training samples that have a history, (n,) each, in the order of the recordings."""

    terms: tuple[Expression, ...]
    states: Columns
    y: Array

    @property
    def samples(self) -> int:
        """Number of samples, n."""
        return len(self.y)

    def rows(self, part: slice) -> Regressors:
        """Return some of the samples."""
        return Regressors(self.terms, {name: values[part] for name, values in self.states.items()}, self.y[part])

    def whole(self) -> Array:
        """Return the dictionary as one matrix, (n, M)."""
        return dictionary_matrix(self.terms, self.states, self.samples)

    def blocks(self) -> Iterator[tuple[Array, Array]]:
        """Yield the dictionary and the output, block by block."""
        for rows, P in dictionary_blocks(self.terms, self.states, self.samples):
            yield P, self.y[rows]


def regressors(records: Sequence[Record], states: StateSet, terms: Sequence[Expression], target: str) -> Regressors:
    """Return the training samples of all pieces on which every state has a value.

    Raises DataError where there are none, or the output is missing.
    """
    parts = [_part(record, states, target) for record in records]
    pooled = {name: np.concatenate([values[name] for values, _ in parts]) for name in states.names}
    y = np.concatenate([output for _, output in parts])
    if not len(y):
        raise DataError("no training sample has a history as long as the delays ask for", "use fewer steps of delay, or longer recordings")
    return Regressors(tuple(terms), pooled, y)


def _part(record: Record, states: StateSet, target: str) -> tuple[dict[str, Array], Array]:
    if target not in record.columns:
        raise DataError(f"there is no column `{target}`", f"there are: {', '.join(record.columns)}")
    values = evaluate_states(states, record.columns)
    known = np.logical_and.reduce([record.training, *(np.isfinite(column) for column in values.values())])
    return {name: column[known] for name, column in values.items()}, record.columns[target][known]
