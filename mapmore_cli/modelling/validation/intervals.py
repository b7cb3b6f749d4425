"""Intervals for a new curve, from what models of the rest said of each part of the training data
that was left out of them.

The samples of one curve err together: a sensor, a temperature, a place between two levels belong to
the whole curve. So curves count, not samples. Two rules give half of the width, by the number K of
levels, recordings or blocks that train.

Three to six levels (`few_levels`): a rule that was calibrated on measured and simulated muscles,
docs/intervals.md. With A the root mean square error of the left-out inner levels, s_w the root mean
square training residual, both no less than a thousandth of the largest training |target|, t the
place in the gap between two levels, and H that gap over the range of all:

    half = max(1.96 s_w, c_K (A s_w^2)^(1/3) max(4t(1 - t), .05)^.6 (H (K - 1))^.75)

At a level that was measured in n >= 2 recordings it is that of the repeats, `t_f s_w sqrt(1 +
1/n)`. s_w is of all levels, so that their degrees of freedom add up, f = sum (n_k - 1).

Otherwise (`many_curves`) it is the larger of

- `t_{K-1} sqrt(s_b^2 (1 + 1/K) + s_w^2)`: s_b is the root mean square of the offsets of the
  left-out parts, s_w that of the scatter within
  them, t Student's. It takes residuals for nearly normal.
- `q (1 + 1/K)`: q is the quantile of the absolute residuals, each part counting alike, of whatever
  distribution. It counts where there are
  many curves, and tails are heavy.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, row_count
from mapmore_cli.domain.errors import DataError, FitError, UsageError
from mapmore_cli.domain.models import LeftOut, LeftOutKind, Model
from mapmore_cli.modelling.kinds import outside_range, predict

INTERVAL = 0.95  # the level of the intervals of scores and figures
# of a part's samples: where the quantiles of its residuals are kept
SHARES = np.linspace(0.0, 1.0, 101)

FEW: Mapping[int, float] = {3: 5.06, 4: 4.03, 5: 3.23}
"""c_K by the number of levels, of all families: `python docs/interval_tables.py`; six levels take
that of five.
"""

LEAST = 1e-3  # errors count as no smaller than this share of the largest |target|
NORMAL = 1.959964  # the quantile of the normal distribution that the constants of `FEW` are for
AT_LEVEL = 0.02  # a sample nearer to a level than this share of the gap is at the level

ASTRAY = 0.25
"""Left-out predictions further beyond the training data than this share of their range: the model
is not to be trusted between levels.
"""


def left_out_summary(
    kind: LeftOutKind, curves: int, residuals: Mapping[str, Sequence[Array]]
) -> LeftOut:
    """Return what intervals need of the residuals (measured minus predicted) of each left-out part,
    where so many `curves` train.

    Raises FitError where a model of the rest has no prediction for a part, as where its free run
    diverges.
    """
    joined = {part: np.concatenate(list(arrays)) for part, arrays in residuals.items()}
    for part, values in joined.items():
        if not len(values) or not np.isfinite(values).all():
            raise FitError(
                f"without {part}, the model of the rest has no prediction for it",
                "leave out `validate.intervals`",
            )
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


def interval_refusal(left_out: LeftOut) -> str | None:
    """Say why there is no interval; None where there is one."""
    beyond = (
        f"the model lies beyond the measured values by {100 * left_out.astray:.0f} % of their range"
    )
    return (
        f"without one of its levels, {beyond}: there are no intervals"
        if left_out.astray > ASTRAY
        else None
    )


def half_widths(left_out: LeftOut, at: Array, level: float) -> Array:
    """Return half of the width of the interval that holds a sample of a new curve with probability
    `level`, (n,).

    `at` (n,) is the level quantity of each sample; it has no effect but with few levels. NaN where
    intervals are refused.
    """
    if interval_refusal(left_out) is not None:
        return np.full(len(at), np.nan)
    if (
        left_out.kind == "levels"
        and len(left_out.places) == left_out.curves
        and left_out.curves < 7
    ):
        return few_levels(left_out, at, level)
    return np.full(len(at), many_curves(left_out, level))


def few_levels(
    left_out: LeftOut, at: Array, level: float, scales: Mapping[int, float] = FEW
) -> Array:
    """Return the half widths at the levels `at`, (n,), by the rule for three to six levels."""
    # here and below: loading it takes a third of an up-to-date run
    from scipy.special import (
        ndtri,
        stdtrit,
    )

    places, count = np.array(left_out.places), left_out.curves
    gap = np.clip(np.searchsorted(places, at, side="right") - 1, 0, count - 2)
    width = np.diff(places)[gap]
    missed = math.sqrt(float(np.mean(left_out.offset**2 + left_out.scatter**2)))
    errors = np.maximum([missed, left_out.residual], LEAST * left_out.largest)
    t = np.clip((at - places[gap]) / width, 0.0, 1.0)
    between = (
        scales[min(count, 5)]
        * np.cbrt(errors[0] * errors[1] ** 2)
        * (width / np.ptp(places) * (count - 1)) ** 0.75
    )
    between = between * np.maximum(4 * t * (1 - t), 0.05) ** 0.6
    half = np.maximum(NORMAL * left_out.residual, between) * float(ndtri(0.5 + level / 2)) / NORMAL
    repeats = np.array(left_out.repeats)
    n, freedom = repeats[gap + (t > 0.5)], max(int(np.sum(repeats - 1)), 1)
    repeated = (n >= 2) & (np.minimum(t, 1 - t) < AT_LEVEL)
    own = stdtrit(freedom, 0.5 + level / 2) * left_out.residual * np.sqrt(1 + 1 / n)
    return np.asarray(np.where(repeated, own, half))


def many_curves(left_out: LeftOut, level: float) -> float:
    """Return half of the width by Student's t over curves, or by the quantile of the absolute
    residuals where that is larger.
    """
    from scipy.special import stdtrit

    new, t = 1 + 1 / left_out.curves, float(stdtrit(left_out.curves - 1, 0.5 + level / 2))
    normal = t * math.sqrt(
        float(np.mean(left_out.offset**2)) * new + float(np.mean(left_out.scatter**2))
    )
    return max(normal, float(np.quantile(left_out.sizes, level)) * new)


def half_widths_of(model: Model, columns: Columns, level: float) -> Array:
    """Return half of the width of a model's intervals at every row, (n,); NaN where they are
    refused. Raises as `checked`.
    """
    left_out = intervals_of(model, level)
    at = np.full(row_count(columns), np.nan) if model.level is None else columns[model.level]
    return half_widths(left_out, at, level)


def intervals_of(model: Model, level: float) -> LeftOut:
    """Return what intervals are made of.

    Raises UsageError for a level that is not between 0 and 1; DataError for a model that holds no
    left-out residuals.
    """
    if not 0 < level < 1:
        raise UsageError(
            f"there is no interval of level {level:g}", "give a number between 0 and 1, as 0.95"
        )
    if model.left_out is None:
        remedy = "add `validate: {intervals: true}` to its spec, and run `mapmore run` again"
        raise DataError(
            f"the model {model.name} holds no left-out residuals, from which intervals are made",
            remedy,
        )
    return model.left_out


def interval(model: Model, columns: Columns, level: float) -> tuple[Array, Array]:
    """Return the ends of the interval at every row, (n,) each; NaN where there is none. Raises as
    `checked`.
    """
    half = half_widths_of(model, columns, level)
    return ends(predict(model, columns), outside_range(model, columns), half)


def ends(predicted: Array, outside: BoolArray, half: Array) -> tuple[Array, Array]:
    """Return the low and high end around every prediction, (n,) each; NaN outside of the training
    range.
    """
    middle = np.where(outside, np.nan, predicted)
    return middle - half, middle + half
