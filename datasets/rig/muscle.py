"""What every synthetic muscle has: a static force, a strain at which it pulls no more, and in
motion friction and rubber.

The rig computes in SI units: Pa, N, m, s, and strain as a fraction of the starting length, positive
in contraction. What specs give in other units is marked, and converted when a spec is read; the
bounds before a mark are in the spec's unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, NamedTuple, Protocol

import numpy as np
from annotated_types import Interval, Len
from scipy.optimize import brentq

from datasets.rig.marks import After, NonNegative, Positive
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.declared import Settings
from mapmore_cli.domain.errors import SpecError

IN_KPA = After(lambda pressure: pressure * 1e3)
"""Marks a pressure, Pa, that specs give in kPa."""

Pressure = Annotated[float, Interval(ge=0, le=2000), IN_KPA]
"""Gauge, Pa; above the bound, the geometry of the muscles means nothing."""

PositiveKpa = Annotated[Positive, IN_KPA]
NonNegativeKpa = Annotated[NonNegative, IN_KPA]

GRAVITY = 9.81
"""m/s2."""

STRAIN_RANGE = (-0.02, 0.36)
"""Strains between which a force is looked for: a little stretch, to just short of the geometric
limit of both muscles.
"""

SLACK_WIDTH = 0.5
"""Force, N, over which a slack muscle's pull fades out: it buckles, and cannot push on the load
cell.
"""


class StaticMuscle(Protocol):
    """A muscle at rest."""

    def force(self, pressure: Array | float, strain: Array | float) -> Array:
        """Pull in N at `pressure` >= 0 (Pa, gauge) and `strain`; the two are broadcast against each
        other.
        """
        ...


class Response(NamedTuple):
    """Of a muscle full of water, at one pressure and strain."""

    tension: float  # static pull, N
    filling: float  # dV/dP at constant strain, m3/Pa
    displacement: float  # dV/de at constant pressure, m3


class FilledMuscle(StaticMuscle, Protocol):
    """The same with its fluid."""

    @property
    def length(self) -> float:
        """L0, m, of which strain is the fraction."""
        ...

    def respond(self, pressure: float, strain: float) -> Response:
        """Pull and volume slopes at `pressure` (Pa; slightly negative while water is sucked out)
        and `strain`.
        """
        ...


def softplus(x: Array | float, width: float) -> Array:
    """`width ln(1 + exp(x / width))`: zero far below 0, x far above, rounded over `width`."""
    return np.asarray(width * np.logaddexp(0.0, np.divide(x, width)), dtype=np.float64)


def effective_pressure(pressure: Array | float, threshold: float, width: float) -> Array:
    """Pressure left after the muscle's wall has been unfolded, Pa: `softplus(P - P_th; w) -
    softplus(-P_th; w)`, zero at P = 0.
    """
    return softplus(np.asarray(pressure) - threshold, width) - softplus(-threshold, width)


def effective_pressure_slope(pressure: float, threshold: float, width: float) -> float:
    """`dP_e/dP = 1/(1 + exp(-(P - P_th)/w))`."""
    return 0.5 * (1.0 + math.tanh(0.5 * (pressure - threshold) / width))


def zero_force_strain(force: Callable[[float], float], lowest: float = STRAIN_RANGE[0]) -> float:
    """Strain between `lowest` and the end of `STRAIN_RANGE` at which a force that falls with strain
    vanishes.

    Raises `SpecError` for a muscle that still pulls at the end of the range, or pushes at its
    beginning.
    """
    highest = STRAIN_RANGE[1]
    first, last = force(lowest), force(highest)
    if not first >= 0.0 >= last:
        raise SpecError(
            f"the simulated muscle's force does not vanish between strains {lowest:g} and "
            f"{highest:g}: "
            f"it goes from {first:.3g} N to {last:.3g} N",
            "lower the pressure, or bring the parameters of `muscle` nearer to their defaults",
        )
    return float(brentq(force, lowest, highest, xtol=1e-12))


@dataclass(frozen=True)
class Stop(Settings):
    """One elasto-slide element: it yields after `yield_strain` and carries `share` of the
    friction.
    """

    yield_strain: Positive
    share: Positive


@dataclass(frozen=True)
class Hysteresis(Settings):
    """Friction of fibres and fabric, which a moving muscle has to overcome; `m` springs in
    parallel, each behind a slider.

    `h(P, e) = (base + per_pressure P) sum_j shares_j s_j(e)`, where s_j is a stop operator of yield
    strain `yield_strains_j`.
    """

    base: NonNegative  # half-width of the full loop at no pressure, N
    # its growth, N/Pa; in specs N/kPa
    per_pressure: Annotated[NonNegative, After(lambda growth: growth / 1e3)]
    stops: Annotated[Sequence[Stop], Len(1)]

    def __post_init__(self) -> None:
        """Refuse shares that are not those of one whole."""
        total = sum(stop.share for stop in self.stops)
        if abs(total - 1.0) > 1e-9:
            raise ValueError(f"the shares of the stops must add up to 1, not {total:g}")

    @cached_property
    def yield_strains(self) -> Array:
        """Of the stops, `(m,)`."""
        return np.array([stop.yield_strain for stop in self.stops])

    @cached_property
    def shares(self) -> Array:
        """Of the stops, `(m,)`."""
        return np.array([stop.share for stop in self.stops])

    def half_width(self, pressure: Array | float) -> Array:
        """Largest |h|, N, at `pressure` (Pa)."""
        return self.base + self.per_pressure * np.asarray(pressure)

    def force(self, pressure: Array | float, strain: Array) -> Array:
        """Force h, N, `(n,)`, along a path that starts relaxed: positive in contraction, where it
        takes from the muscle's pull.
        """
        return self.half_width(pressure) * (stop(strain, self.yield_strains) @ self.shares)


def stop(path: Array, yields: Array) -> Array:
    """States `(n, m)` of m stop operators along a path of n inputs; relaxed (zero) at its first
    sample.

    `s_j[k] = min(1, max(-1, s_j[k-1] + (x[k] - x[k-1])/y_j))`: only the order of the inputs counts,
    not their timing.
    """
    states = np.zeros((len(path), len(yields)))
    for k, step in enumerate(np.diff(path), start=1):
        states[k] = np.minimum(1.0, np.maximum(-1.0, states[k - 1] + step / yields))
    return states


def stop_rates(states: Array, yields: Array, rate: float) -> Array:
    """Rates `(m,)`, 1/s, of the same operators while their input moves at `rate`: `x'/y_j`, zero
    where they slide.
    """
    return np.where((np.abs(states) >= 1.0) & (states * rate > 0.0), 0.0, rate / yields)


@dataclass(frozen=True)
class Rubber(Settings):
    """Maxwell element beside the muscle: `s' = E e' - s/tau`, s in N."""

    stiffness: NonNegative  # E, N per strain
    relaxation_time: Positive  # tau, s


@dataclass(frozen=True)
class MovingMuscle:
    """A muscle with friction and rubber; their `(1 + m,)` states, the losses, are the rubber's s
    (N), then the m stop operators.
    """

    muscle: FilledMuscle
    hysteresis: Hysteresis
    rubber: Rubber

    @property
    def relaxed(self) -> Array:
        """The losses at rest."""
        return np.zeros(1 + len(self.hysteresis.yield_strains))

    @property
    def scales_of_losses(self) -> Array:
        """Size of each loss, for the tolerance of an integration."""
        return np.array([10.0, *np.ones(len(self.hysteresis.yield_strains))])

    def left_of(self, tension: float, losses: Array, pressure: float) -> float:
        """Return what is left of a static `tension` (N) at a pressure (Pa)."""
        stops = np.clip(losses[1:], -1.0, 1.0)  # an integration may overstep by its tolerance
        return (
            tension
            - float(
                self.hysteresis.half_width(max(pressure, 0.0)) * (stops @ self.hysteresis.shares)
            )
            - float(losses[0])
        )

    def rates_of_losses(self, losses: Array, strain_rate: float) -> Array:
        """Return the rates of the losses while the muscle moves at `strain_rate` (1/s): `s' = E e'
        - s/tau`, and those of the stops.
        """
        relaxing = (
            self.rubber.stiffness * strain_rate - float(losses[0]) / self.rubber.relaxation_time
        )
        return np.array(
            [
                relaxing,
                *stop_rates(
                    np.clip(losses[1:], -1.0, 1.0), self.hysteresis.yield_strains, strain_rate
                ),
            ]
        )
