"""Define measurements: recordings as they were read, and the curves that are made from
recordings.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from mapmore_cli.domain.arrays import (
    Array,
    BoolArray,
    Columns,
    Ends,
    IntArray,
    Number,
    Ranges,
    extremes,
    picked,
    row_count,
)
from mapmore_cli.domain.declared import Count, Label, Notes, QuantityName, one_of

STATIC_FORCE, DAMPING = "static_force", "damping"
"""Name of the column with the prediction of a static model for a step response, and name of the
column with the residual (M2 eq 1).
"""

DIRECTION = "direction"
"""Name of the quantity that distinguishes rise (+1) from fall (-1), in formulas and segments."""


def uncertainty_of(name: str) -> str:
    """Return the name of the column with the standard deviation of each sample of a quantity."""
    return f"{name}_uncertainty"


@dataclass(frozen=True)
class Quantity:
    """A measured or modelled quantity: its name and its unit."""

    name: Annotated[QuantityName, "its name, such as `force`"]
    unit: Annotated[Label, "its unit, such as `kPa`, `1` or `N`"]

    @property
    def label(self) -> str:
        """Name and unit, for example `pressure [kPa]`."""
        return f"{self.name} [{self.unit}]"


@dataclass(frozen=True)
class BaseUnits:
    """A unit, expressed in base units of the SI. The value x in this unit is `factor x + offset` in
    the product of the base units.

    `powers` holds the powers of the base units by name: kg, m, s, A, K, mol, cd, rad.
    """

    factor: float
    offset: float
    powers: Mapping[str, int]


@dataclass(frozen=True)
class Recording:
    """One source file as read, in the units of the model.

    `dropped` gives the number of samples that were read but are not in `columns`, for each reason.
    Without resampling, `rows_read == rows_kept + sum(dropped.values())`. If a log was cut at gaps
    into several recordings, `log` is the id of this log.
    """

    id: Annotated[Label, "identifier of the recording"]
    source: Annotated[str, "POSIX path of the source file, relative to the spec"]
    columns: Annotated[Columns, "(n) samples that were kept", "[*]"]
    rows_read: Annotated[Count, "samples in the source file"]
    dropped: Annotated[Mapping[str, Count], "samples left out, by reason", "1"]
    log: Annotated[
        Label, "identifier of the log that this is a piece of; empty if it is the whole log"
    ] = ""
    first_row: Annotated[
        Count, "row of the first sample in the file, from 1; 0 if samples are not stored row by row"
    ] = 0

    @property
    def name(self) -> str:
        """Name of the recording in messages: the file name. If the id contains more than the file
        name, for example the sheet of a workbook, the id follows in brackets.
        """
        by_file = re.fullmatch(
            rf"(.*-)?{re.escape(self.id)}(\.\w+)*", self.source.replace("/", "-")
        )
        return self.source if by_file else f"{self.source} ({self.id})"

    @property
    def rows_kept(self) -> int:
        """Number of samples in `columns`, n."""
        return row_count(self.columns)

    def at(self, rows: IntArray) -> Recording:
        """Return the recording with the samples in `rows` only."""
        columns = {name: picked(x, rows) for name, x in self.columns.items()}
        return replace(self, columns=columns, first_row=0)


@dataclass(frozen=True)
class CurveRange:
    """Training range of every input within one training curve."""

    curve: Annotated[Label, "identifier of the curve"]
    level: Annotated[Number | None, "value of the level quantity", "[level]"]
    limits: Annotated[Ranges, "smallest and largest training value of each input", "[*]"]

    def of(self, names: Iterable[str]) -> CurveRange:
        """Return the training ranges of only the inputs with these names."""
        return CurveRange(self.curve, self.level, {name: self.limits[name] for name in names})


@dataclass(frozen=True)
class Curve:
    """Samples of a curve, that is, of one level, or of one recording if there are no levels.

    Without levels, `level` is None and `id` is the id of the recording. `at_rest` is None for
    curves without plateaus. `origin` is None if it is unknown which recording each sample belongs
    to. The samples of one recording are in the order of time.
    """

    id: Annotated[Label, "identifier of the curve, for example `pressure=150`"]
    level: Annotated[Number | None, "value of the level quantity", "[level]"]
    columns: Annotated[Columns, "(n) samples, row for row", "[*]"]
    held_out: Annotated[BoolArray, "(n) 1 if a sample is held out", "1"]
    recordings: Annotated[
        tuple[Label, ...], "identifiers of the recordings that the samples come from"
    ]
    at_rest: Annotated[
        BoolArray | None,
        "(n) 1 on the plateau of a step response, whose samples are scored but not trained with",
        "1",
    ] = None
    origin: Annotated[
        IntArray | None, "(n) number of each sample's recording among `recordings`, from 0", "-"
    ] = None
    measured: Annotated[
        Ranges,
        "range of each quantity over the training recordings, if samples are means of branches",
        "[*]",
    ] = field(default_factory=dict)
    raw_target: Annotated[
        Array | None, "(n) target before the effects of groups were removed", "[target]"
    ] = None
    raw_uncertainty: Annotated[
        Array | None, "(n) uncertainty of this target, before gains were removed", "[target]"
    ] = None

    @property
    def size(self) -> int:
        """Number of samples, n."""
        return len(self.held_out)

    @property
    def training(self) -> BoolArray:
        """Return a mask, (n,), of the training samples. These are the samples that are neither held
        out nor at rest.
        """
        return ~self.held_out if self.at_rest is None else ~(self.held_out | self.at_rest)

    def at(self, rows: IntArray | BoolArray) -> Curve:
        """Return the curve with only the given rows. If a recording has none of these rows, it is
        also removed from `recordings`.
        """
        origin, recordings = None, self.recordings
        if self.origin is not None:
            left, origin = np.unique(self.origin[rows], return_inverse=True)
            recordings = tuple(self.recordings[number] for number in left)
        return replace(
            self,
            columns={name: picked(x, rows) for name, x in self.columns.items()},
            held_out=self.held_out[rows],
            recordings=recordings,
            at_rest=None if self.at_rest is None else self.at_rest[rows],
            origin=origin,
            raw_target=None if self.raw_target is None else picked(self.raw_target, rows),
            raw_uncertainty=(
                None if self.raw_uncertainty is None else picked(self.raw_uncertainty, rows)
            ),
        )

    def raw(self, target: str) -> Curve:
        """Return the curve with the target as it was measured, before the gains and offsets of
        groups were removed from it and from its uncertainty.
        """
        if self.raw_target is None:
            return self
        columns = {**self.columns, target: self.raw_target}
        if self.raw_uncertainty is not None:
            columns[uncertainty_of(target)] = self.raw_uncertainty
        return replace(self, columns=columns, raw_target=None, raw_uncertainty=None)

    def limits(self, name: str) -> Ends:
        """Return the smallest and the largest value of a quantity over the training samples. If
        these samples are means of two branches, the range of the measured samples is included.
        """
        least, largest = extremes(self.columns[name], self.training)
        low, high = self.measured.get(name, (least, largest))
        return min(least, low), max(largest, high)

    @property
    def stretches(self) -> tuple[slice | IntArray, ...]:
        """Row numbers of the samples of each recording. If the recordings of the samples are
        unknown, the only element is a slice with all rows.
        """
        return (slice(None),) if self.origin is None else self.logs

    def together(self, parts: Sequence[Array]) -> Array:
        """Return one column of the curve, (n,). `parts` holds the values of the samples of each
        recording, in the order of `stretches`.
        """
        if self.origin is None:
            return parts[0]
        whole = np.empty(self.size)
        for rows, part in zip(self.stretches, parts, strict=True):
            whole[rows] = part
        return whole

    @property
    def logs(self) -> tuple[IntArray, ...]:
        """For each recording, the row numbers of its samples in the order of time."""
        if self.origin is None:
            return (np.arange(self.size),)
        return tuple(np.flatnonzero(self.origin == number) for number in np.unique(self.origin))


def united(ranges: Iterable[Ranges]) -> dict[str, Ends]:
    """Return, for each quantity, the smallest range that contains all its ranges. `ranges` are
    several mappings from quantities to ranges.
    """
    whole: dict[str, Ends] = {}
    for limits in ranges:
        for name, (low, high) in limits.items():
            least, greatest = whole.get(name, (low, high))
            whole[name] = min(least, low), max(greatest, high)
    return whole


@dataclass(frozen=True)
class Grouping:
    """Groups of samples, for example sessions. For each group, an offset, a gain or both are
    estimated and removed from the target.
    """

    target: Annotated[QuantityName, "the quantity from which the effects are removed"]
    of: Annotated[QuantityName, "the quantity that distinguishes the groups"]
    offset: Annotated[bool, "whether offsets are subtracted"] = False
    gain: Annotated[bool, "whether the target is divided by gains"] = False
    outputs: Annotated[
        tuple[QuantityName, ...],
        "outputs and quantities computed from them, at which groups are not compared",
    ] = ()


@dataclass(frozen=True)
class Dataset:
    """Recordings as they were read, and the curves that were made from them."""

    target: Annotated[QuantityName, "the modelled column of the curves"]
    level: Annotated[QuantityName | None, "the quantity that is constant within a curve"]
    quantities: Annotated[Mapping[QuantityName, Quantity], "every column's quantity"]
    recordings: Annotated[tuple[Recording, ...], "files as read"]
    curves: Annotated[tuple[Curve, ...], "curves to model"]
    notes: Notes = ()
    also: Annotated[
        tuple[QuantityName, ...], "further modelled columns, of a model of several outputs"
    ] = ()
    grouping: Annotated[Grouping | None, "effects of groups that are removed from the target"] = (
        None
    )

    @property
    def raw_curves(self) -> tuple[Curve, ...]:
        """The curves with the target as it was measured, before the gains and offsets of groups
        were removed from it.
        """
        if self.grouping is None:
            return self.curves
        return tuple(curve.raw(self.grouping.target) for curve in self.curves)

    @property
    def each(self) -> tuple[Dataset, ...]:
        """A dataset for each output. Each contains only one of the outputs, so that the other
        outputs cannot be inputs.
        """
        return tuple(replace(self, target=name, also=()) for name in (self.target, *self.also))

    @property
    def logs(self) -> Mapping[str, str]:
        """Mapping from the id of each recording to the id of the log from which it was cut, or to
        its own id if it was not cut.
        """
        return {recording.id: recording.log or recording.id for recording in self.recordings}

    def unit(self, name: str) -> str:
        """Return the unit of a column of the dataset."""
        return self.quantities[name].unit


@dataclass(frozen=True)
class Signal:
    """An input that is computed from the course of another quantity over time: its rate, or its
    direction of motion.

    A rate is `factor` times the derivative with respect to the time in seconds. `seconds` is the
    number of seconds in one unit of the recorded time.
    """

    name: Annotated[QuantityName, "name of the input"]
    kind: Annotated[str, "`rate` or `direction`", one_of("rate", "direction")]
    of: Annotated[QuantityName, "the quantity from which it is computed"]
    window: Annotated[Number, "width of the window of a rate; 0 for a direction", "s"] = 0.0
    order: Annotated[Count, "order of the polynomials of a rate; 0 for a direction"] = 0
    factor: Annotated[Number, "unit of the quantity per second, in the unit of the rate"] = 1.0
    seconds: Annotated[Number, "seconds in one unit of the time", "s"] = 1.0
    dead_band: Annotated[
        Number,
        "largest rate at which the last direction is kept; 0 for a rate",
        "that of the rate",
    ] = 0.0
