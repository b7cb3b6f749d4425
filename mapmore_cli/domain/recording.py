"""What was measured: recordings as read, and the curves made from them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from mapmore_cli.domain.arrays import BoolArray, Columns, IntArray

STATIC_FORCE, DAMPING = "static_force", "damping"
"""What a static model says of a step response, and what it leaves (M2 eq 1)."""

DIRECTION = "direction"
"""The quantity that tells rise (+1) from fall (-1), by the name that formulas and segments know it."""


@dataclass(frozen=True)
class Quantity:
    """A measured or modelled quantity: canonical name and unit (as `kPa`, `1`, `N`)."""

    name: str
    unit: str


@dataclass(frozen=True)
class BaseUnits:
    """A unit by the base units of the SI: `x` of it are `factor x + offset` of their product.

    `powers` of the base units, by their names: kg, m, s, A, K, mol, cd, rad.
    """

    factor: float
    offset: float
    powers: Mapping[str, int]


@dataclass(frozen=True)
class Recording:
    """One file as read, in the units of the model.

    `columns` holds the samples that were kept; `dropped` counts the others by reason, so that
    `rows_read == kept + sum(dropped.values())` holds for a recording that was not resampled. `log` is the id of the log that this is a
    piece of, where that was cut at gaps; empty where it is the whole log.
    """

    id: str
    source: str  # POSIX path as the spec names it, relative to the spec's folder
    columns: Columns
    rows_read: int
    dropped: Mapping[str, int]
    log: str = ""

    @property
    def rows_kept(self) -> int:
        """Samples that remain, n."""
        return len(next(iter(self.columns.values()))) if self.columns else 0


@dataclass(frozen=True)
class Curve:
    """Samples at one value of the level quantity (or of one recording, where there are no levels).

    Attributes
    ----------
    id
        `pressure=150`, or the recording's id where the study has no levels.
    level
        Value of the level quantity in the model's unit; None without levels.
    columns
        Quantities by name, each `(n,)`.
    held_out
        `(n,)`; True where a sample belongs to the validation data.
    recordings
        The ids of the recordings that the samples come from.
    at_rest
        `(n,)`; True on the plateau of a step response, which is scored but not trained on. None where nothing is said of plateaus.
    origin
        `(n,)` number of each sample's recording among `recordings`, the samples of one in order of time; None where it is not known.
    measured
        Range of each quantity over the training recordings, where the samples are not those that were measured but branches resampled.
    """

    id: str
    level: float | None
    columns: Columns
    held_out: BoolArray
    recordings: tuple[str, ...]
    at_rest: BoolArray | None = None
    origin: IntArray | None = None
    measured: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of samples, n."""
        return len(self.held_out)

    @property
    def training(self) -> BoolArray:
        """`(n,)`; True where a sample trains."""
        return ~self.held_out if self.at_rest is None else ~(self.held_out | self.at_rest)

    def limits(self, name: str) -> tuple[float, float]:
        """Range of a quantity over the training samples, and over what was measured for them."""
        x = self.columns[name][self.training]
        low, high = self.measured.get(name, (x.min(), x.max()))
        return min(float(x.min()), low), max(float(x.max()), high)

    @property
    def logs(self) -> tuple[IntArray, ...]:
        """Row numbers of the samples of each recording, in order of time."""
        if self.origin is None:
            return (np.arange(self.size),)
        return tuple(np.flatnonzero(self.origin == number) for number in np.unique(self.origin))


def united(ranges: Iterable[Mapping[str, tuple[float, float]]]) -> dict[str, tuple[float, float]]:
    """The least range of each quantity that holds all given ones."""
    whole: dict[str, tuple[float, float]] = {}
    for one in ranges:
        for name, (low, high) in one.items():
            least, greatest = whole.get(name, (low, high))
            whole[name] = min(least, low), max(greatest, high)
    return whole


@dataclass(frozen=True)
class Dataset:
    """Everything that `ingest` hands on.

    `target` names the column of the curves that is modelled; `quantities` gives the unit of every
    column; `level` names the quantity that is constant within a curve.
    """

    target: str
    level: str | None
    quantities: Mapping[str, Quantity]
    recordings: tuple[Recording, ...]
    curves: tuple[Curve, ...]
    notes: tuple[str, ...] = ()

    @property
    def logs(self) -> Mapping[str, str]:
        """The log that each recording is a piece of, by the id of the recording."""
        return {recording.id: recording.log or recording.id for recording in self.recordings}

    def unit(self, name: str) -> str:
        """Unit of a column."""
        return self.quantities[name].unit


@dataclass(frozen=True)
class Signal:
    """An input that follows from another one over time: a `rate`, or the `direction` of motion that a rate tells.

    A rate is `factor` times the derivative by the time in seconds, over a `window` in seconds by polynomials of `order`, where the time
    comes in units of so many `seconds`; the direction has a `dead_band` in the unit of the rate. Numbers that a kind does not have are 0.
    """

    name: str
    kind: str  # rate | direction
    of: str
    window: float = 0.0
    order: int = 0
    factor: float = 1.0
    seconds: float = 1.0
    dead_band: float = 0.0
