"""What `tune` tried, and what `plan` proposes to measure next."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.recording import Quantity


@dataclass(frozen=True)
class Candidate:
    """A measurement that could be made; half widths are those of the 95 % interval, in the target's
    unit, NaN where unknown.
    """

    at: Mapping[str, float]  # values of the quantities to set, by name, in the model's units
    kind: Literal["between", "point"]  # `between` two levels, or a `point` of a map
    gap: float = math.nan  # distance of the two levels
    half_width: float = math.nan  # there, before the measurement
    after: float = math.nan  # its forecast for after the measurement
    error: float = math.nan  # expected root mean square error there before the measurement
    cost: float = 1.0  # by the user's prices of a change of each quantity


@dataclass(frozen=True)
class Until:
    """The forecast of how many more measurements are needed for a `wanted` half width, in the
    target's unit.
    """

    wanted: float
    widest: float  # half width now
    more: int | None  # None if more measurements do not get there
    least: float  # what they then reach


@dataclass(frozen=True)
class Picture:
    """Half widths over the range that was measured, for the figure."""

    places: Columns  # coordinates of the half widths by name, (n,) each
    before: Array  # half widths now, (n,)
    after: Array  # with all of the plan's points measured, (n,)
    measured: Columns  # coordinates of what trains, by name, (m,) each


@dataclass(frozen=True)
class Plan:
    """Candidates, the best first, and what a reader has to know of them."""

    name: str
    target: Quantity
    quantities: Mapping[str, Quantity]
    largest: float
    candidates: tuple[Candidate, ...]
    picture: Picture
    until: Until | None = None
    notes: tuple[str, ...] = ()

    @property
    def widest(self) -> float:
        """The widest half width now; NaN where there are no intervals."""
        known = self.picture.before[np.isfinite(self.picture.before)]
        return float(known.max()) if len(known) else math.nan


@dataclass(frozen=True)
class Trial:
    """One combination of settings, by their place in the spec."""

    settings: Mapping[str, Any]
    parameters: int = 0  # free numbers of its model of all training data
    errors: tuple[
        float, ...
    ] = ()  # NRMSE on each fold of a model without it; empty if a fit failed
    error: float = math.nan  # their geometric mean
    excess: float = math.nan  # mean over the folds of ln(error / that of the best combination)
    spread: float = math.nan  # standard error of that mean
    failure: str = ""  # why a fit failed


@dataclass(frozen=True)
class Tuning:
    """All combinations that were tried."""

    name: str
    left_out: str  # by each fold
    full_scale: str  # what errors are divided by
    trials: tuple[Trial, ...]
    best: Trial  # errs least
    chosen: Trial  # the simplest within one standard error of the best
