"""Lehr's damping coefficient: the share of a load cycle's energy that hysteresis takes (M2 eq 21-23).

At one pressure, Sárosi's force (M2 eq 14) is `F(x) = A exp(c x) + B x + C` of the strain x, which is integrated exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray

SHORTEST = 1.0  # strain of a muscle without length, where the search for the free strain ends
BISECTIONS = 60  # halve a strain of one down to rounding


@dataclass(frozen=True)
class ForceCurve:
    """`A exp(c x) + B x + C` at n pressures: A, B, C are `(n,)`."""

    A: Array
    B: Array
    C: Array
    c: float

    def __call__(self, strain: Array) -> Array:
        """Force at one strain for each pressure, `(n,)`."""
        return np.asarray(self.A * np.exp(self.c * strain) + self.B * strain + self.C)

    def mean(self, start: float, end: Array) -> Array:
        """Mean force from strain `start` to each `end`, `(n,)`; the force itself where they are one."""
        z = self.c * (end - start)
        ratio = np.where(z == 0.0, 1.0, np.expm1(z) / np.where(z == 0.0, 1.0, z))
        return np.asarray(self.A * np.exp(self.c * start) * ratio + self.B * (start + end) / 2 + self.C)

    def turning_point(self, start: float) -> Array:
        """Strain of least force where the curve is bent upwards, else `SHORTEST`; from `start` to `SHORTEST`, `(n,)`."""
        turns = (self.A > 0.0) & (self.A * self.c * self.B < 0.0)
        place = np.log(-self.B / (self.A * self.c)) / self.c
        return np.where(turns, np.clip(place, start, SHORTEST), SHORTEST)


@dataclass(frozen=True)
class Stroke:
    """The strain to which the muscle contracts at n pressures, and whether it is known, `(n,)` each.

    Attributes
    ----------
    end
        The free strain; `strain_min` where the muscle is slack.
    slack
        The upper curve does not pull, even at `strain_min`.
    endless
        It pulls at every strain: `end` is where it turns up again, or `SHORTEST`.
    """

    end: Array
    slack: BoolArray
    endless: BoolArray


def sarosi_at(parameters: Mapping[str, float], branch: str, pressure: Array) -> ForceCurve:
    """Sárosi's force with the parameters `a{branch}1` ... `a{branch}6` at each `pressure`, `(n,)`."""
    a1, a2, a3, a4, a5, a6 = (parameters[f"a{branch}{i}"] for i in range(1, 7))
    return ForceCurve(a1 * pressure + a2, a4 * pressure, a5 * pressure + a6, a3)


@np.errstate(all="ignore")
def stroke(upper: ForceCurve, strain_min: float) -> Stroke:
    """Where the upper curve first falls to zero, by bisection."""
    low, high = np.full_like(upper.A, strain_min), upper.turning_point(strain_min)
    slack, endless = upper(low) <= 0.0, upper(high) > 0.0
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        pulls = upper(middle) > 0.0
        low, high = np.where(pulls, middle, low), np.where(pulls, high, middle)
    return Stroke(np.where(slack, strain_min, low), slack, endless & ~slack)


@np.errstate(all="ignore")
def lehr(upper: ForceCurve, lower: ForceCurve, strain_min: float) -> tuple[Array, Stroke]:
    """`zeta = (U_u - U_l)/U_u` (M2 eq 21), `(n,)`, and the stroke over which the energies are taken.

    It is not limited to [0, 1]: towards a slack muscle the energy U_u of the stroke vanishes, and there zeta is infinite, as where U_u
    overflows.
    """
    travelled = stroke(upper, strain_min)
    whole, kept = upper.mean(strain_min, travelled.end), lower.mean(strain_min, travelled.end)
    return np.where((whole > 0.0) & (whole < np.inf), (whole - kept) / whole, np.inf), travelled
