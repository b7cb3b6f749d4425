"""What to measure next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.recording import Quantity


@dataclass(frozen=True)
class Candidate:
    """A measurement that could be made.

    - `at`: values of the quantities to set, by name, in the model's units.
    - `kind`: `between` two levels, a `repeat` of a level, or a `point` of a map.
    - `half_width`, `after`: half of the width of the 95 % interval there before the measurement, and the forecast for after it, in the
      target's unit; NaN where unknown.
    - `error`: expected root mean square error there before the measurement; NaN where unknown.
    - `cost`: what it costs, by the user's prices of a change of each quantity.
    """

    at: Mapping[str, float]
    kind: Literal["between", "repeat", "point"]
    half_width: float
    after: float
    error: float
    cost: float = 1.0


@dataclass(frozen=True)
class Until:
    """The forecast of how many more measurements are needed for a `wanted` half width, in the target's unit.

    `widest` is the widest half width now. `more` is None where more measurements do not get there; `least` is then what they reach.
    """

    wanted: float
    widest: float
    more: int | None
    least: float


@dataclass(frozen=True)
class Picture:
    """Half widths over the range that was measured, for the figure.

    - `places`: coordinates of the half widths by name, (n,) each.
    - `before`, `after`: half widths now, and with all of the plan's points or with its first level measured, (n,).
    - `measured`: coordinates of what trains, by name, (m,) each.
    """

    places: Columns
    before: Array
    after: Array
    measured: Columns


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
    notes: tuple[str, ...] = field(default=())

    @property
    def widest(self) -> float:
        """The widest half width now; NaN where there are no intervals."""
        known = self.picture.before[np.isfinite(self.picture.before)]
        return float(known.max()) if len(known) else float("nan")
