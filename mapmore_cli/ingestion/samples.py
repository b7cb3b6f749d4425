"""Represent the samples of a table, with a record of everything that is left out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray, by_blocks, picked
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import RawTable
from mapmore_cli.study.sections.data import Data, MissingRule
from mapmore_cli.study.sections.logs import Logs
from mapmore_cli.study.units import convert


@dataclass(frozen=True)
class Samples(RawTable):
    """Samples of one table. `columns` holds the values of each quantity in the model's unit.

    - `left_out`: rows of samples that were left out, by reason.
    - `merged`: the number of samples by which resampling reduced the table.
    - `notes`: findings and corrections, for the reader of the report.
    """

    left_out: Mapping[str, IntArray] = field(default_factory=dict)
    merged: int = 0
    notes: tuple[str, ...] = ()

    def keep(self, mask: BoolArray, reason: str) -> Samples:
        """Return the samples for which `mask`, (n,), is True. The rows of the other samples are
        recorded in `left_out` with the given `reason`.
        """
        if mask.all():
            return self
        before = self.left_out.get(reason, np.zeros(0, dtype=np.int64))
        return replace(
            self,
            columns={name: picked(x, mask) for name, x in self.columns.items()},
            rows=picked(self.rows, mask),
            left_out={**self.left_out, reason: np.concatenate([before, picked(self.rows, ~mask)])},
        )

    def some(self) -> Samples:
        """Return the samples unchanged. Raises DataError if there are none, because all were left
        out.
        """
        if self.size:
            return self
        losses = "; ".join(f"{len(rows)}: {reason}" for reason, rows in self.left_out.items())
        raise DataError(
            f"{self.label}: no sample is left ({losses})",
            "Loosen `keep` or `missing`, or leave the file out. If every row lacks some columns, "
            "for example because two sampling rates alternate, name the columns of one rate in "
            "`columns`, and those of the other rate, with the time, in `join`, with the same file "
            "and `missing: drop`.",
        )

    def with_columns(self, columns: Mapping[str, Array]) -> Samples:
        """Return the samples with quantities added or replaced."""
        return replace(self, columns={**self.columns, **columns})

    def cut(self, parts: Sequence[slice]) -> list[Samples]:
        """Cut the samples into consecutive parts, and return the parts. A sample that was left out
        earlier is recorded in the part in which its row lies. The notes and warnings go to the
        first part only.
        """
        owners = {
            reason: np.searchsorted([self.rows[part.start] for part in parts[1:]], rows)
            for reason, rows in self.left_out.items()
        }
        return [
            replace(
                self,
                rows=self.rows[part],
                columns={name: values[part] for name, values in self.columns.items()},
                left_out={
                    reason: rows[owners[reason] == i]
                    for reason, rows in self.left_out.items()
                    if (owners[reason] == i).any()
                },
                notes=() if i else self.notes,
                doubts=() if i else self.doubts,
            )
            for i, part in enumerate(parts)
        ]


@contextmanager
def located(label: str) -> Iterator[None]:
    """Put `label`, for example the name of a file, before the message of a DataError."""
    try:
        yield
    except DataError as error:
        raise DataError(f"{label}: {error.message}", error.remedy) from error


def without_missing(samples: Samples, table: Logs, missing: str | MissingRule) -> Samples:
    """Leave out samples with NaN or infinity, or raise DataError for them if `missing` is `error`.
    Raises DataError also if no sample is left.
    """
    complete = by_blocks(
        lambda *columns: np.logical_and.reduce([np.isfinite(values) for values in columns]),
        *samples.columns.values(),
    )
    if missing == "error" and not complete.all():
        sample = int(np.argmin(complete))
        name = next(
            name for name, values in samples.columns.items() if not np.isfinite(values[sample])
        )
        place = ""
        if name in table.columns:
            place = f", column {samples.titles.get(name, table.columns[name].column)}"
        raise DataError(
            f"{samples.at(sample)}{place}: the value of {name} is missing",
            f"Set `missing: drop` to leave out such samples ({np.count_nonzero(~complete)} of "
            f"{len(complete)} in this file).",
        )
    return samples.keep(complete, "missing value").some()


def recordings_apart(
    samples: Samples, data: Data, units: Mapping[str, str], texts: Mapping[str, Mapping[str, float]]
) -> list[Samples]:
    """Return the samples of each recording in a table, without missing values. Rows with the same
    value of `recordings.of` are one recording, in the order of first occurrence. Without
    `recordings.of`, the whole table is one recording. `texts` holds, for each quantity whose column
    contains texts, the number that represents each text.

    Raises DataError for missing values if the spec does not allow them, and if no sample is left.
    """
    samples = without_missing(samples, data, data.missing)
    if data.recordings is None:
        return [samples]
    names = data.recordings.quantities
    values = np.column_stack([samples.columns[name] for name in names])
    kinds, first, member = np.unique(values, axis=0, return_index=True, return_inverse=True)
    spelt = {name: {number: text for text, number in texts.get(name, {}).items()} for name in names}
    parts: list[Samples] = []
    for kind in np.argsort(first):
        pairs = zip(names, kinds[kind].tolist(), strict=True)
        label = ",".join(f"{name}={spelt[name].get(x, f'{x:.15g}')}" for name, x in pairs)
        element = label if samples.element is None else f"{samples.element}:{label}"
        mask = member.ravel() == kind
        part = replace(
            samples,
            rows=picked(samples.rows, mask),
            columns={name: picked(x, mask) for name, x in samples.columns.items()},
            left_out=samples.left_out if not parts else {},
            notes=samples.notes if not parts else (),
            doubts=samples.doubts if not parts else (),
            element=element,
        )
        if data.sample_time is not None:
            step = data.every * convert(data.sample_time, "s", units["time"])
            part = part.with_columns({"time": step * np.arange(part.size, dtype=np.float64)})
        parts.append(part)
    return parts
