"""How much of a recording is settled: pressure sensors sit at the valve, so that only slow samples show a static force."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.signals.rates import rate

SLOW = 0.04  # of the pressure range per second
SHORTEST = 0.1  # s, width of the window in which the rate is found
SAMPLES = 8  # that the window must hold
MIDDLE = (0.1, 0.9)  # of the pressure range


@dataclass(frozen=True)
class Settling:
    """How a pressure settles.

    Attributes
    ----------
    limit
        Rate per second, a round number, below which a sample counts as settled.
    share
        Part of all samples that is settled.
    share_between
        Part of the samples in the middle of the pressure range that is settled: staircases rest there, and sweeps do not.
    window
        Width of the window in which the rate was found, in s.
    """

    limit: float
    share: float
    share_between: float
    window: float


def settling(records: Sequence[tuple[Array, Array]]) -> Settling | None:
    """Find which share of the samples is settled, of records given as time in s and pressure, each `(n,)`.

    None where the pressure does not move, or the time stamps do not let a rate be found.
    """
    pressures = np.concatenate([pressure for _, pressure in records])
    steps = np.concatenate([np.diff(time) for time, _ in records])
    if not np.ptp(pressures) or not (steps > 0).any() or (steps < 0).any():
        return None
    window = max(SHORTEST, two_digits(SAMPLES * float(np.mean(steps))))
    limit = two_digits(SLOW * float(np.ptp(pressures)))
    try:
        rates = np.concatenate([rate(time, pressure, window, order=2) for time, pressure in records])
    except DataError:  # gaps that are wider than the window
        return None
    settled = np.abs(rates) < limit
    low, high = (pressures.min() + place * np.ptp(pressures) for place in MIDDLE)
    between = settled[(pressures > low) & (pressures < high)]
    return Settling(limit, float(np.mean(settled)), float(np.mean(between)) if between.size else 0.0, window)


def two_digits(value: float) -> float:
    """A positive number, rounded to two digits, as a person would choose it."""
    return float(f"{round(value, 1 - math.floor(math.log10(value))):.6g}")
