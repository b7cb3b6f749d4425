"""Two muscles turn a wrist in a closed loop, for the page on W: of the rig, or of a fitted model
behind a lag.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from datasets.rig.air import ClosedMuscle, Regulator
from mapmore_cli.domain.arrays import Array, Columns

Force = Callable[[Array, Array], Array]
"""Pull, N, at pressures (kPa) and strains, `(n,)` each."""

SIGNS = np.array([1.0, -1.0])
"""Of the change of strain with the angle: flexor, extensor."""

KPA = 1e3


@dataclass(frozen=True)
class Wrist:
    """The hand on its pulley, and the loop: pressures `p0 +- dp`, dp fed forward and by a PI
    controller.
    """

    length: float  # of both muscles, m
    radius: float  # of the pulley, m
    inertia: float  # of hand and robot, kg m2
    damping: float  # N m s
    middle: float  # strain of both at the angle zero
    pressure: float  # p0, kPa
    highest: float  # kPa
    reach: float  # of the joint to either side, rad
    period: float  # of the loop, s
    step: float  # of the integration, s
    kp: float  # kPa/rad
    ki: float  # kPa/(rad s)

    def strains(self, angle: Array | float) -> Array:
        """Strains of both muscles, `(2, n)` or `(2,)`."""
        return np.asarray(self.middle + self.radius / self.length * np.multiply.outer(SIGNS, angle))

    def feed(self, force: Force, reference: Array) -> Array:
        """Pressure dp that a model needs along a course of angles `(n,)`, kPa, `(n,)`: of several
        the least, where none the nearest.

        `r (F(p0 + dp, e_1) - F(p0 - dp, e_2)) = J a'' + d a'`.
        """
        rate = np.gradient(reference, self.period)
        torque = self.inertia * np.gradient(rate, self.period) + self.damping * rate
        reach = min(self.pressure, self.highest - self.pressure)
        tried = np.linspace(-reach, reach, 301)
        found = []
        for (first, second), wanted in zip(
            self.strains(reference).T.tolist(), torque.tolist(), strict=True
        ):
            pulls = force(self.pressure + tried, np.full(301, first)) - force(
                self.pressure - tried, np.full(301, second)
            )
            missing = self.radius * pulls - wanted
            k = np.flatnonzero(missing[:-1] * missing[1:] <= 0)
            roots = tried[k] - missing[k] * (tried[k + 1] - tried[k]) / (
                missing[k + 1] - missing[k]
            )
            found.append(
                roots[np.argmin(np.abs(roots))] if len(roots) else tried[np.argmin(np.abs(missing))]
            )
        return np.array(found)


class RigMuscles:
    """Both muscles of the rig behind regulators: air, friction and rubber, by explicit steps."""

    def __init__(self, muscle: ClosedMuscle, regulator: Regulator, wrist: Wrist) -> None:
        self.muscle, self.regulator, self.length = muscle, regulator, wrist.length
        self.states = [muscle.at_rest(wrist.pressure * KPA) for _ in SIGNS]

    def pulls(self, strains: Array, rates: Array, asked: Array, step: float) -> Array:
        """Return the pulls, N, `(2,)`, of now; then the states go on by a step."""
        found = [
            self.muscle.pull(own, float(e)) for own, e in zip(self.states, strains, strict=True)
        ]
        for i, own in enumerate(self.states):
            self.states[i] = own + step * self.muscle.rates(
                own, float(strains[i]), float(rates[i]), self.regulator, float(asked[i]) * KPA
            )
        return np.array(found)

    @property
    def pressures(self) -> Array:
        """Of both muscles, kPa, `(2,)`."""
        return np.array([own[1] for own in self.states]) / KPA


class ModelMuscles:
    """Both muscles by a fitted force at a pressure that lags; a muscle does not push."""

    def __init__(self, force: Force, lag: float, wrist: Wrist) -> None:
        self.force, self.lag, self.pressures = force, lag, np.full(2, wrist.pressure)

    def pulls(self, strains: Array, _rates: Array, asked: Array, step: float) -> Array:
        """Return the pulls, N, `(2,)`, of now; then the pressures go on by a step."""
        found = np.maximum(self.force(self.pressures, strains), 0.0)
        self.pressures = self.pressures + step / self.lag * (asked - self.pressures)
        return found


def followed(
    wrist: Wrist, muscles: RigMuscles | ModelMuscles, reference: Array, feed: Array
) -> Columns:
    """`angle` (rad), what is `asked` of the flexor and its `pressure` (kPa), `(n,)` each, at the
    samples of the loop; from rest at zero.
    """
    angle = rate = total = 0.0
    found = {name: np.empty(len(reference)) for name in ("angle", "asked", "pressure")}
    for k, (aim, fed) in enumerate(zip(reference.tolist(), feed.tolist(), strict=True)):
        error = aim - angle
        wanted = wrist.pressure + SIGNS * (fed + wrist.kp * error + wrist.ki * total)
        asked = np.clip(wanted, 0.0, wrist.highest)
        total += wrist.period * error * bool((asked == wanted).all())
        found["angle"][k], found["asked"][k], found["pressure"][k] = (
            angle,
            asked[0],
            muscles.pressures[0],
        )
        for _ in range(round(wrist.period / wrist.step)):
            strains, rates = wrist.strains(angle), wrist.radius / wrist.length * SIGNS * rate
            pulls = muscles.pulls(strains, rates, asked, wrist.step)
            rate += (
                wrist.step
                / wrist.inertia
                * (wrist.radius * (pulls[0] - pulls[1]) - wrist.damping * rate)
            )
            angle += wrist.step * rate
            if abs(angle) > wrist.reach:  # a stop
                angle, rate = float(np.sign(angle)) * wrist.reach, 0.0
    return found


def lag_of(asked: Array, pressure: Array, period: float) -> float:
    """Time constant (s) of the lag that follows from what was asked for to the pressure with the
    least squares.
    """

    def error(lag: float) -> float:
        memory = np.exp(-period / lag)
        late = asked[0] + lfilter([0.0, 1.0 - memory], [1.0, -memory], asked - asked[0])
        return float(np.sum((late - pressure) ** 2))

    return float(minimize_scalar(error, bounds=(1e-3, 1.0), method="bounded").x)
