"""Define one axis of a figure that is drawn without Matplotlib: its ends, scale and ticks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array, Ends

SAME = 1e-12
"""Two numbers differ by rounding alone if their difference is at most this fraction of the larger
number.
"""

Place = Callable[[Any], Array]
"""Function that converts values on an axis to positions on the sheet, in points."""


@dataclass
class Axis:
    """Axis of a figure.

    - `margin`: fraction of the range of the data that is added at each end of the axis.
    - `low`, `high`, `least`: smallest, largest, and smallest positive value of the data. A
      logarithmic axis reaches from `least` to `high`, with the margins.
    - `limits`: ends of the axis if they do not follow from the data.
    - `subs`: multiples of the powers of ten that a logarithmic axis labels.
    - `most`: largest number of steps between ticks.
    - `ticks`: label of each tick by its value; None if the ticks follow from the ends.
    """

    margin: float
    low: float = math.inf
    high: float = -math.inf
    least: float = math.inf
    limits: Ends | None = None
    logarithmic: bool = False
    subs: Sequence[float] = (1.0,)
    most: int = 5
    ticks: dict[float, str] | None = None

    def hold(self, values: Any) -> None:
        """Extend the range of the data so that it contains these values."""
        finite = np.asarray(values, dtype=np.float64)
        finite = finite[np.isfinite(finite)]
        self.least = min(self.least, float(finite[finite > 0].min(initial=math.inf)))
        if finite.size:
            self.low = min(self.low, float(finite.min()))
            self.high = max(self.high, float(finite.max()))

    @property
    def ends(self) -> Ends:
        """Start and end of the axis, in the unit of the data."""
        if self.limits is not None:
            return self.limits
        if self.logarithmic:  # a logarithmic axis cannot show values of zero or below
            if not self.least <= self.high:
                return 1.0, 10.0
            margin = (self.high / self.least) ** self.margin if self.high > self.least else 2.0
            return self.least / margin, self.high * margin
        if not self.low <= self.high:
            return 0.0, 1.0
        span = self.high - self.low
        margin = self.margin * span if span > 0 else 0.05 * abs(self.low) or 1.0
        return self.low - margin, self.high + margin

    def set_ends(self, low: float | None, high: float | None) -> None:
        """Set the start of the axis, its end, or both. An end that is None stays where it is."""
        known = self.ends
        self.limits = (known[0] if low is None else low, known[1] if high is None else high)

    def set_ticks(self, at: Iterable[float], names: Sequence[str] | None) -> None:
        """Set the values of the ticks. `names` are the labels of the ticks; without them, the
        labels are the values.
        """
        places = [float(place) for place in at]
        words = [f"{place:g}" for place in places] if names is None else names
        self.hold(places)
        self.ticks = dict(zip(places, words, strict=True))

    def scale(self, start: float, stop: float) -> Place:
        """Return a function that converts values to positions on the sheet, in points. The axis
        reaches from the position `start` to the position `stop`.
        """
        low, high = self.ends

        def place(values: Any) -> Array:
            values = np.asarray(values, dtype=np.float64)
            if self.logarithmic:
                values, ends = np.log(np.maximum(values, 1e-300)), (math.log(low), math.log(high))
            else:
                ends = (low, high)
            shares: Array = (values - ends[0]) / (ends[1] - ends[0])
            return start + shares * (stop - start)

        return place

    def labels(self) -> dict[float, str]:
        """Return the ticks within the axis, each with its label."""
        low, high = sorted(self.ends)
        if self.ticks is not None:
            return {at: words for at, words in self.ticks.items() if low <= at <= high}
        if self.logarithmic:
            powers = 10.0 ** np.arange(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
            every = [power * sub for power in powers for sub in self.subs]
            return {at: f"{at:g}" for at in every if low <= at <= high}
        ticks = nice_ticks(low, high, self.most)
        if len(ticks) > 1 and max(map(abs, ticks)) < 1e6:
            step = ticks[1] - ticks[0]
            digits = max(0, -math.floor(math.log10(step) + 1e-9) + (f"{step:e}"[2] == "5"))
            if digits < 6:
                return {at: f"{at:.{digits}f}".replace("-", "\N{MINUS SIGN}") for at in ticks}
        return {at: f"{at:g}" for at in ticks}


def nice_ticks(low: float, high: float, most: int) -> list[float]:
    """Return at most `most` + 1 evenly spaced values within a range. Their distance is 1, 2, 2.5 or
    5 times a power of ten, and all of them are multiples of this distance.
    """
    span = high - low
    # no ticks fit between two ends that differ only by rounding
    if not (math.isfinite(span) and span > SAME * abs(high)):
        return [low]
    power = 10.0 ** math.floor(math.log10(span / most))
    step = next(step for step in (1, 2, 2.5, 5, 10, 20) if span / (step * power) <= most) * power
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [number * step for number in range(first, last + 1)]


def levels_of(low: float, high: float, most: int) -> list[float]:
    """Return about `most` round numbers at equal distances. The numbers cover a range; the first
    and the last lie at its ends or just outside of them.
    """
    ticks = nice_ticks(low, high, most)
    step = ticks[1] - ticks[0] if len(ticks) > 1 else 1.0
    before = [ticks[0] - step] if ticks[0] > low else []
    return [*before, *ticks, *([ticks[-1] + step] if ticks[-1] < high else [])]
