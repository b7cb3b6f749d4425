"""Intervals for a new curve, from what models of the rest said of each part of the training data that was left out of them.

The samples of one curve err together: a sensor, a temperature, a place between two levels belong to the whole curve. So curves count, not
samples. With K curves, half of the interval's width is the larger of

- `t_{K-1} sqrt(s_b^2 (1 + 1/K) + s_w^2)`: s_b is the root mean square of the offsets of the left-out parts, s_w that of the scatter within
  them, t Student's. It takes residuals for nearly normal.
- `q (1 + 1/K)`: q is the quantile of the absolute residuals, each part counting alike, of whatever distribution. It counts where there are
  many curves, and tails are heavy.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.errors import DataError, FitError, UsageError
from mapmore_cli.domain.models import LeftOut, LeftOutKind, Model
from mapmore_cli.modelling.kinds import outside_range, predict

SHARES = np.linspace(0.0, 1.0, 101)
"""Of a part's samples: where the quantiles of its residuals are kept."""


def summary(kind: LeftOutKind, curves: int, residuals: Mapping[str, Sequence[Array]]) -> LeftOut:
    """What intervals need of the residuals (measured minus predicted) of each left-out part, where so many `curves` train.

    Raises
    ------
    FitError
        Where a model of the rest has no prediction for a part, as where its free run diverges.
    """
    joined = {part: np.concatenate(list(arrays)) for part, arrays in residuals.items()}
    for part, values in joined.items():
        if not len(values) or not np.isfinite(values).all():
            raise FitError(f"without {part}, the model of the rest has no prediction for it", "leave out `validate.intervals`")
    parts = list(joined.values())
    return LeftOut(
        kind=kind,
        curves=curves,
        parts=tuple(joined),
        samples=np.array([len(r) for r in parts]),
        offset=np.array([r.mean() for r in parts]),
        scatter=np.array([r.std() for r in parts]),
        sizes=np.array([np.quantile(np.abs(r), SHARES) for r in parts]),
    )


def half_width(left_out: LeftOut, level: float) -> float:
    """Half of the width of the interval that holds a sample of a new curve with probability `level`."""
    from scipy.special import stdtrit

    new = 1 + 1 / left_out.curves
    t = float(stdtrit(left_out.curves - 1, 0.5 + level / 2))
    between, within = float(np.mean(left_out.offset**2)), float(np.mean(left_out.scatter**2))
    return max(t * math.sqrt(between * new + within), float(np.quantile(left_out.sizes, level)) * new)


def interval(model: Model, columns: Columns, level: float) -> tuple[Array, Array]:
    """The ends of the interval at every row, (n,) each: NaN where there is no prediction, and outside of the training range.

    Raises
    ------
    UsageError
        For a level that is not between 0 and 1.
    DataError
        For a model that holds no left-out residuals.
    """
    half = half_width_of(model, level)
    return ends(predict(model, columns), outside_range(model, columns), half)


def half_width_of(model: Model, level: float) -> float:
    """Half of the width of a model's intervals; raises as `interval`."""
    if not 0 < level < 1:
        raise UsageError(f"there is no interval of level {level:g}", "give a number between 0 and 1, as 0.95")
    if model.left_out is None:
        remedy = "add `validate: {intervals: true}` to its spec, and run `mapmore run` again"
        raise DataError(f"the model {model.name} holds no left-out residuals, from which intervals are made", remedy)
    return half_width(model.left_out, level)


def ends(predicted: Array, outside: BoolArray, half: float) -> tuple[Array, Array]:
    """Low and high end around every prediction, (n,) each; NaN outside of the training range, of which left-out data say nothing."""
    middle = np.where(outside, np.nan, predicted)
    return middle - half, middle + half
