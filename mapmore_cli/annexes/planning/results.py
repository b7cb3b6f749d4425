"""Define the results of `tune` and `plan`."""

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
    """A possible measurement. Half widths are half the width of the 95 % interval, in the target's
    unit; NaN if unknown.
    """

    at: Mapping[str, float]  # values of the quantities to set, by name, in the model's units
    # kind of the measurement: a level `between` two others, or a `point` of a map
    kind: Literal["between", "point"]
    gap: float = math.nan  # distance between the two neighbouring levels; NaN for a point
    half_width: float = math.nan  # half width of the interval before the measurement
    after: float = math.nan  # forecast of the half width of the interval after the measurement
    error: float = math.nan  # expected root mean square error at this place before the measurement
    cost: float = 1.0  # cost of the measurement, by the prices that the user gave


@dataclass(frozen=True)
class Until:
    """Forecast of the number of further measurements that reach a `wanted` half width, in the
    target's unit.
    """

    wanted: float
    widest: float  # present half width
    more: int | None  # None if further measurements do not reach the wanted half width
    least: float  # smallest half width that further measurements reach


@dataclass(frozen=True)
class Picture:
    """Half widths of the 95 % interval over the measured range, for the figure of a plan."""

    places: Columns  # coordinates of the points at which half widths are known, by name, (n,) each
    before: Array  # half widths before the measurement, (n,)
    after: Array  # half widths after all points of the plan were measured, (n,)
    measured: Columns  # coordinates of the training samples by name, (m,) each


@dataclass(frozen=True)
class Plan:
    """Result of `plan`: the candidates, the best first, and everything reported with them."""

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
        """The largest half width before the plan is measured; NaN without intervals."""
        known = self.picture.before[np.isfinite(self.picture.before)]
        return float(known.max()) if len(known) else math.nan


@dataclass(frozen=True)
class Trial:
    """One combination of settings, by their paths in the spec, and its errors."""

    settings: Mapping[str, Any]
    parameters: int = 0  # number of free parameters of the model fitted to all training data
    # NRMSE on each fold, of a model fitted without this fold; empty if a fit failed
    errors: tuple[float, ...] = ()
    error: float = math.nan  # geometric mean of `errors`
    excess: float = math.nan  # mean over the folds of ln(error / error of the best combination)
    spread: float = math.nan  # standard error of `excess`
    failure: str = ""  # reason why a fit failed


@dataclass(frozen=True)
class Tuning:
    """All combinations of settings that were tried, and the recommended one."""

    name: str
    left_out: str  # description of the data that each fold leaves out
    full_scale: str  # divisor of errors
    trials: tuple[Trial, ...]
    best: Trial  # the combination with the smallest error
    chosen: Trial  # the simplest combination within one standard error of the best
