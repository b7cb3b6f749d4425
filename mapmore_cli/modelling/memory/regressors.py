"""Training samples as regressors: states in memory, the dictionary only block by block, and how much memory that would need."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import StateSet
from mapmore_cli.modelling.memory.evaluation import evaluate_states
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.terms import Expression, dictionary_blocks, dictionary_matrix

WORD = 8
"""Bytes of a number."""

SHARE = 0.5
"""Of the installed memory, what one fit may take: other programs need some as well."""

ASSUMED = 4_000_000_000
"""Bytes of memory where the system does not say."""


def dictionary_bytes(samples: int, candidates: int) -> int:
    """Bytes of a whole dictionary, (n, M)."""
    return WORD * samples * candidates


def products_bytes(candidates: int) -> int:
    """Bytes of what selection needs of a dictionary that is built block by block: three matrices (M+1, M+1)."""
    return 3 * WORD * (candidates + 1) ** 2


def usable_memory() -> int:
    """Bytes that one fit may take."""
    try:
        installed = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        installed = ASSUMED
    return int(SHARE * installed)


def fits_whole(samples: int, candidates: int) -> bool:
    """Whether the whole dictionary may be in memory at once; else it is built block by block."""
    return dictionary_bytes(samples, candidates) <= usable_memory()


def refuse_beyond_memory(candidates: int) -> None:
    """Raise DataError where so many candidates are too many even block by block, saying what they would need and what there is."""
    needed, room = products_bytes(candidates), usable_memory()
    if needed > room:
        raise DataError(
            f"a dictionary of {candidates} candidates needs {_size(needed)} of memory for their products alone; {_size(room)} may be used",
            "lower the order of the products, use fewer states, or restrict the products by `with`",
        )


def _size(count: float) -> str:
    return f"{count / 1e9:.3g} GB" if count >= 1e8 else f"{count / 1e6:.3g} MB"


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
        """Some of the samples."""
        return Regressors(self.terms, {name: values[part] for name, values in self.states.items()}, self.y[part])

    def whole(self) -> Array:
        """The dictionary as one matrix, (n, M)."""
        return dictionary_matrix(self.terms, self.states, self.samples)

    def blocks(self) -> Iterator[tuple[Array, Array]]:
        """The dictionary and the output, block by block."""
        for rows, P in dictionary_blocks(self.terms, self.states, self.samples):
            yield P, self.y[rows]


def regressors(records: Sequence[Record], states: StateSet, terms: Sequence[Expression], target: str) -> Regressors:
    """The training samples of all pieces on which every state has a value.

    Raises
    ------
    DataError
        Where there are none, or the output is missing.
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
