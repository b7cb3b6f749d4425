"""Choose the next points of a map of two or more inputs.

Several models, each with a Gaussian process for its residual, form a committee. The value of
measuring a point is called its worth: the spread of the committee at this point times the standard
deviation of the Gaussian processes. The worth is multiplied by `SLACK` if the expected force is
below 2 % of the largest force. Points are chosen one after the other: after each choice, the point
is treated as if it had been measured, with the value that the committee expects there
(docs/planning.md).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, KDTree, QhullError

from mapmore_cli.annexes.planning.results import Candidate, Picture, Until
from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.modelling.validation.gaussian_process import GaussianProcess, most_likely
from mapmore_cli.modelling.validation.intervals import NORMAL

# weight of points whose expected |target| is small, that is, below the fraction `LITTLE` of the
# largest |target|
SLACK, LITTLE = (
    0.15,
    0.02,
)
# largest number of measured points to which the Gaussian processes are fitted
MOST_MEASURED = 150
MOST_POINTS = 100  # largest number of further points for which a forecast is made


@dataclass(frozen=True)
class MeasuredMap:
    """Measured points of a map: the names of the d inputs, the points `x`, (n, d), and the target
    `y`, (n,).
    """

    names: tuple[str, ...]
    x: Array
    y: Array

    def scaled(self, at: Array) -> Array:
        """Return points, (m, d), scaled so that the measured range of each of the d inputs is the
        interval from 0 to 1.
        """
        return np.asarray((at - self.x.min(axis=0)) / np.ptp(self.x, axis=0))

    def grid(self, steps: int) -> Array:
        """Return the points of a grid within the convex hull of the measured points, (m, d)."""
        every = np.array(
            list(itertools.product(np.linspace(0.0, 1.0, steps), repeat=len(self.names)))
        )
        with suppress(QhullError):  # points along a line have no convex hull
            if len(self.names) > 1:
                every = every[Delaunay(self.scaled(self.x)).find_simplex(every, tol=1e-9) >= 0]
        return np.asarray(self.x.min(axis=0) + every * np.ptp(self.x, axis=0))

    def unmeasured(self, places: Array, samples: Array, steps: int) -> BoolArray:
        """Return True for the points of a grid that have not been measured, (m,). A point has been
        measured if a sample lies within half a step of it along every input. `samples`, (n, d),
        include held-out samples.
        """
        nearest, _ = KDTree(self.scaled(samples)).query(self.scaled(places), p=np.inf)
        return np.asarray(nearest > 0.5 / (steps - 1))


def spread_out(x: Array, y: Array) -> tuple[Array, Array]:
    """Return at most `MOST_MEASURED` of the points, spread evenly. Each next point is the point
    that is farthest from all points chosen before (maximin). Every column of `x` varies.
    """
    if len(y) <= MOST_MEASURED:
        return x, y
    scaled = (x - x.min(axis=0)) / np.ptp(x, axis=0)
    chosen, distance = [0], np.full(len(y), np.inf)
    for _ in range(MOST_MEASURED - 1):
        distance = np.minimum(distance, np.sum((scaled - scaled[chosen[-1]]) ** 2, axis=1))
        if distance.max() <= 0:
            break
        chosen.append(int(np.argmax(distance)))
    return x[chosen], y[chosen]


class Committee:
    """Gaussian processes for the residual of each formula, evaluated at a fixed set of candidate
    points. Measured values are added one by one. `places` are the candidates, (m, d). For each
    formula, `formulas` holds by name the predictions at the measured points, (n,), and at the
    candidates, (m,).
    """

    def __init__(
        self, measured: MeasuredMap, places: Array, formulas: Mapping[str, tuple[Array, Array]]
    ) -> None:
        self.places, self.scaled = places, measured.scaled(places)
        self.largest = float(np.abs(measured.y).max())
        x = measured.scaled(measured.x)
        self._base = [elsewhere for _, elsewhere in formulas.values()]
        self._own: list[GaussianProcess] = [
            most_likely(x, measured.y - here) for here, _ in formulas.values()
        ]
        self.noise = float(np.mean([process.noise for process in self._own]))
        self._update()

    def _update(self) -> None:
        means, deviations = zip(
            *(process.predict(self.scaled) for process in self._own), strict=True
        )
        predictions = np.add(self._base, means)
        self.expected, self.spread = predictions.mean(axis=0), predictions.std(axis=0)
        self.deviation = np.sqrt(np.mean(np.square(deviations), axis=0))

    @property
    def error(self) -> Array:
        """Expected error of a prediction at every candidate point, (m,). It combines the spread of
        the committee and the standard deviation of the Gaussian processes.
        """
        return np.asarray(np.hypot(self.spread, self.deviation))

    @property
    def half(self) -> Array:
        """Half the width of the 95 % interval at every candidate point, (m,), including noise."""
        return np.asarray(NORMAL * np.hypot(self.error, self.noise))

    @property
    def score(self) -> Array:
        """Worth of a measurement at every candidate point, (m,). A committee with one member has no
        spread; the worth is then the variance of its Gaussian process.
        """
        spread = self.spread if len(self._own) > 1 else self.deviation
        return np.asarray(
            spread
            * self.deviation
            * np.where(np.abs(self.expected) < LITTLE * self.largest, SLACK, 1.0)
        )

    def add(self, number: int) -> None:
        """Treat a candidate point as measured, with the value that the committee expects there."""
        expected = float(self.expected[number])
        self._own = [
            process.with_point(self.scaled[number], expected - float(base[number]))
            for process, base in zip(self._own, self._base, strict=True)
        ]
        self._update()


def next_points(
    committee: Committee,
    names: Sequence[str],
    count: int,
    prices: Mapping[str, float],
    free: BoolArray,
) -> tuple[tuple[Candidate, ...], tuple[Array, Array]]:
    """Return the next points, in the order in which they are chosen, and the half widths of the
    interval at all candidates before and after these points are measured.

    The next point is the candidate with the largest ratio of worth to cost. The cost of a candidate
    is the sum of the prices of those quantities whose value differs from the values at all points
    chosen before; it is at least the lowest price. Only candidates at which `free`, (m,), is True
    are chosen.
    """
    before, places = committee.half, committee.places
    next_ones, chosen = list[Candidate](), list[int]()
    each = np.array([prices.get(name, 1.0) for name in names])
    for _ in range(count):
        known = zip(places.T, places[chosen].T, strict=True)
        new = np.column_stack([~np.isin(column, values) for column, values in known])
        cost = np.maximum(new @ each, each.min()) if prices else np.ones(len(places))
        worth = committee.score / cost
        number = int(np.argmax(np.where(free, worth, -np.inf)))
        chosen.append(number)
        half, error = float(committee.half[number]), float(committee.error[number])
        committee.add(number)
        at = dict(zip(names, places[number].tolist(), strict=True))
        after = float(committee.half[number])
        next_ones.append(Candidate(at, "point", math.nan, half, after, error, float(cost[number])))
    return tuple(next_ones), (before, committee.half)


def until(committee: Committee, wanted: float) -> Until:
    """Return a forecast of how many more points are needed to reduce the widest half width to
    `wanted`. The forecast adds points to `committee`, so that it cannot be used afterwards.
    """
    widest = float(committee.half.max())
    more, least = 0, widest
    while least > wanted and more < MOST_POINTS:
        committee.add(int(np.argmax(committee.half)))
        more += 1
        least = min(least, float(committee.half.max()))
        if least <= NORMAL * committee.noise * 1.001:
            break
    return Until(wanted, widest, more if least <= wanted else None, least)


def picture(committee: Committee, measured: MeasuredMap, halves: tuple[Array, Array]) -> Picture:
    """Return the half widths at all candidate points before and after the plan, for the figure."""
    places = {name: committee.places[:, column] for column, name in enumerate(measured.names)}
    known = {name: measured.x[:, column] for column, name in enumerate(measured.names)}
    return Picture(places, *halves, known)
