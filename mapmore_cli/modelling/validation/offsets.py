"""Estimate the variances between samples and between curves of one level. Intervals are computed
from these variances; the module `intervals` gives the formulas.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.models import LeftOut

NEIGHBOURS = 0.6
"""Degrees of freedom of K left-out levels, divided by K - 1: with this value, Student's t covers 90
to 99 % of new curves at 4 to 20 levels (`docs/interval_tables.py`).
"""

# with fewer degrees of freedom, the variance between curves is treated as unknown
LEAST_FREEDOM = 1.5
CLEAR, CHANCE = 1.25, 0.2
"""Limits for the mean square error of left-out levels. The model is wrong between levels if this
error is more than `CLEAR` times the value that noise and differences between curves explain. If
repeated recordings determine these differences, the ratio must also be larger than the value that
chance alone exceeds with the probability `CHANCE`.
"""


@dataclass(frozen=True)
class Offsets:
    """Variances between samples and between curves of one level, and the errors of left-out levels.

    - `noise`: mean square of the training residuals, without the differences between recordings.
    - `smooth`: the part of `noise` that neighbouring samples have in common, for example because a
      model does not bend enough.
    - `square`: mean square of the differences between curves, with `freedom` degrees of freedom.
    - `repeated`: True if `square` is computed from repeated recordings.
    - `missed`: mean square error of the `left_out` levels, 0 if no level was left out.
    - `explained`: the value of `missed` for a model without errors between levels. It is `noise`,
      plus the differences between curves if `square` is computed from repeated recordings.
    """

    noise: float
    smooth: float
    square: float
    freedom: float
    repeated: bool
    left_out: int
    missed: float
    explained: float

    @property
    def errs_between(self) -> bool:
        """Return True if the model is wrong between levels: the errors of left-out levels are
        clearly larger than the variances between samples and between curves explain.
        """
        from scipy.special import fdtri

        chance = fdtri(self.left_out, self.freedom, 1 - CHANCE) if self.repeated else 0.0
        return bool(self.missed > max(CLEAR, chance) * self.explained)

    def half_width(self, share: Array, level: float) -> Array:
        """Return half of the width of the interval that contains a sample of a new curve with
        probability `level`. The variance between curves is multiplied by `share`, (n,), which is c
        in the module `intervals`.
        """
        from scipy.special import ndtri, stdtrit

        of_curves = self.square * share + self.smooth * (share if self.repeated else 1.0)
        of_samples, quantile = self.noise - self.smooth, 0.5 + level / 2
        if not self.repeated:
            squares = ndtri(quantile) ** 2 * of_samples
            return np.asarray(np.sqrt(squares + stdtrit(self.freedom, quantile) ** 2 * of_curves))
        both = of_samples + of_curves
        part = of_curves / np.maximum(both, np.finfo(float).tiny)
        freedom = self.freedom / np.maximum(part, 1e-6)
        return np.asarray(stdtrit(freedom, quantile) * np.sqrt(both))


def offsets_of(left_out: LeftOut) -> Offsets | None:
    """Compute the variances between samples and between curves of one level, and return them with
    the errors of left-out levels. Return None if the data do not determine the variances.
    """
    n = np.array(left_out.repeats)
    count = len(left_out.places)
    known = math.isfinite(left_out.apart)
    between_curves, repeats = (left_out.apart**2, float(np.sum(n - 1))) if known else (0.0, 0.0)
    noise = max(left_out.residual**2 - between_curves * float(np.mean(1 - 1 / n)), 0.0)
    smooth = min(max(left_out.smooth**2 - between_curves * float(np.mean(1 - 1 / n)), 0.0), noise)
    inner = count - 2  # levels that can be left out
    missed = share = others = 0.0
    if left_out.kind == "levels" and inner > 0:
        missed = float(np.mean(left_out.offset**2 + left_out.scatter**2))
        width = np.diff(left_out.places)
        t = width[:-1] / (width[:-1] + width[1:])
        share = 1 + float(np.mean((1 - t) ** 2 / n[:-2] + t**2 / n[2:]))
        others = NEIGHBOURS * (count - 1)
    if repeats >= max(others, LEAST_FREEDOM):
        explained = noise + between_curves * share
        return Offsets(noise, smooth, between_curves, repeats, True, inner, missed, explained)
    if others < LEAST_FREEDOM:
        return None
    square = max(missed - noise, 0.0) / share
    return Offsets(noise, smooth, square, others, False, inner, missed, noise)
