"""Samples on their way from a file to a recording, with everything that is left out kept in mind."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.errors import DataError


@dataclass(frozen=True)
class Samples:
    """Samples of one table.

    Attributes
    ----------
    label, place, rows
        Where they stand, for messages: the file (and part of it), and `(n,)` rows or indices in it.
    columns
        Quantities by name, each `(n,)`.
    left_out
        The rows of samples that were left out, by reason.
    element
        Number of the recording in its file; None where the file holds a single one.
    merged
        How many samples fewer there are since resampling.
    """

    label: str
    place: str
    rows: IntArray
    columns: Mapping[str, Array]
    left_out: Mapping[str, IntArray]
    element: int | None = None
    merged: int = 0

    @property
    def size(self) -> int:
        """Number of samples, n."""
        return len(self.rows)

    @property
    def rows_read(self) -> int:
        """Number of samples that there were, those left out included."""
        return self.size + self.merged + sum(len(rows) for rows in self.left_out.values())

    @property
    def losses(self) -> str:
        """How many samples were left out and why, in one line."""
        return "; ".join(f"{len(rows)}: {reason}" for reason, rows in self.left_out.items())

    def at(self, sample: int) -> str:
        """Where a sample stands: `a.csv:row 17`."""
        return f"{self.label}:{self.place} {self.rows[sample]}"

    def keep(self, mask: BoolArray, reason: str) -> Samples:
        """Return the samples where `mask`, the others noted under `reason`."""
        if mask.all():
            return self
        rows = np.concatenate([self.left_out.get(reason, np.zeros(0, dtype=np.int64)), self.rows[~mask]])
        columns = {name: values[mask] for name, values in self.columns.items()}
        return replace(self, columns=columns, rows=self.rows[mask], left_out={**self.left_out, reason: rows})

    def some(self) -> Samples:
        """Return the samples; DataError where none is left."""
        if self.size:
            return self
        raise DataError(f"{self.label}: no sample is left ({self.losses})", "Loosen `keep` or `missing`, or leave the file out.")

    def with_columns(self, columns: Mapping[str, Array]) -> Samples:
        """Return the samples with quantities added or replaced."""
        return replace(self, columns={**self.columns, **columns})

    def cut(self, parts: Sequence[slice]) -> list[Samples]:
        """Return the samples of each part; what was left out before belongs to the part that it stands in."""
        owners = {reason: np.searchsorted(self.rows[[part.start for part in parts[1:]]], rows) for reason, rows in self.left_out.items()}
        return [
            replace(
                self,
                rows=self.rows[part],
                columns={name: values[part] for name, values in self.columns.items()},
                left_out={reason: rows[owners[reason] == i] for reason, rows in self.left_out.items() if (owners[reason] == i).any()},
            )
            for i, part in enumerate(parts)
        ]


@contextmanager
def located(label: str) -> Iterator[None]:
    """Put the file's name before the message of a DataError from within."""
    try:
        yield
    except DataError as error:
        raise DataError(f"{label}: {error.message}", error.remedy) from error
