"""Compute prediction intervals for a new curve, from the errors of models on parts of the training
data that were left out of their fits.

The samples of one curve have common errors, because for example a sensor error or a temperature
affects the whole curve. So the width depends on the number of curves, not on the number of samples.
Half of the width has three parts.

*Differences from sample to sample*, with the variance `s_w^2`: s_w is the root mean square training
residual without the differences between recordings. The part that neighbouring samples share (their
mean product) is an error of the model with few degrees of freedom, and is counted with the next
part.

*Differences from curve to curve* (`Offsets`), with the variance `c s_b^2`. If recordings of a level
repeat each other with f = sum (n_k - 1) degrees of freedom, s_b is computed from them. Otherwise it
is computed from the levels that were left out: with K of them, `s_b^2 = (A^2 - s_w^2)/c'`, where A
is the root mean square error of the left-out inner levels, and f = .6 (K - 1), because second
differences of neighbours are correlated. For a new curve, `c = 1 + (1-t)^2/n + t^2/n'`, where t is
its place in the gap between levels with n and n' recordings; c' is the mean of c over the left-out
levels. At a level that was measured once, `c = 2`, because its own offset was fitted exactly. Below
f = 1.5 (two or three levels without repeats), the data do not determine s_b, and there is no
interval.

Let V be the sum of both variances. If s_b is computed from repeats, half of the width is `t_g
sqrt(V)`, with Student's t for `g = f V / (c s_b^2)` degrees of freedom: g is about f if curves
differ by far more than samples, and large if they do not. If s_b is computed from left-out levels,
it depends on s_w, and half of the width is `sqrt(z^2 s_w^2 + t_f^2 c s_b^2)`, with the normal
quantile z.

*Errors of the model between levels*, in addition. They are included if A^2 exceeds the value
explained by noise and curves by more than a quarter. If s_b is computed from repeats, A^2 must also
exceed the value that chance exceeds in a fifth of all cases (an F test with K - 2 and f degrees of
freedom).

- Three to six levels (`between_levels`): a rule that was calibrated on measured and simulated
  muscles (docs/intervals.md). Let H be the gap divided by the range of all levels, and let A and s
  (the root mean square training residual) be at least a thousandth of the largest training
  |target|. Then `c_K (A s^2)^(1/3) max(4t(1 - t), .05)^.6 (H (K - 1))^.75` is a lower bound of half
  the width.
- More levels: the excess of A^2 times t^2 is added, and half of the width is at least the quantile
  of the left-out errors, whatever their distribution.

For recordings, specimens and blocks (`many_curves`), half of the width is the larger of

- `t_{K-1} sqrt(s_b^2 (1 + 1/K) + s_w^2)`, where s_b is the root mean square of the offsets of the
  left-out parts, s_w that of the scatter within them, and t is Student's t;
- `q (1 + 1/K)`, where q is the quantile of the absolute residuals, with the same weight for each
  part. It is the larger one if there are many curves and heavy tails.

Blocks belong to the same recordings, so they do not show the differences from one recording to the
next.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray, row_count
from mapmore_cli.domain.errors import DataError, FitError, UsageError
from mapmore_cli.domain.models import LeftOut, LeftOutKind, Model
from mapmore_cli.modelling.kinds import outside_range, predict
from mapmore_cli.modelling.validation.offsets import NEIGHBOURS, offsets_of

INTERVAL = 0.95  # probability of the intervals in score tables and figures
# probabilities of the quantiles of the absolute residuals that are stored for each left-out part
SHARES = np.linspace(0.0, 1.0, 101)

FEW: Mapping[int, float] = {3: 5.06, 4: 4.03, 5: 3.23}
"""c_K by the number of levels K, from a calibration on simulated and measured muscles.
`docs/intervals.md` shows the values that the present program gives. Six levels use the value of
five.
"""

# errors that are smaller than this fraction of the largest |target| are set to this limit
LEAST = 1e-3
# quantile of the normal distribution for which the constants in `FEW` were computed
NORMAL = 1.959964
# A sample is treated as at a level if their distance is below this fraction of the gap of levels.
AT_LEVEL = 0.02

MANY = 7  # smallest number of levels for which the rule for few levels is not needed
# Each recording is divided into this number of parts, to compare repeated recordings.
# The mean of each part is compared with the means of the same part in the other recordings.
BLOCKS = 4

SAME_RECORDINGS = (
    "parts of the same recordings were left out, so that the intervals hold for these "
    "recordings only; they do not contain the variation from one recording to the next. "
    "Make three or more recordings"
)

ASTRAY = 0.25
"""Limit for predictions of left-out parts. If such a prediction is outside the range of the
training output by more than this fraction of the range, there are no intervals, because the model
cannot be trusted between levels.
"""


def left_out_summary(
    kind: LeftOutKind, curves: int, residuals: Mapping[str, Sequence[Array]]
) -> LeftOut:
    """Summarise the residuals (measured minus predicted) of every left-out part. Intervals are
    computed from this summary. `curves` is the number of levels, recordings or other parts of the
    training data.

    Raises FitError if the model that was fitted without a part cannot predict this part, for
    example because its free run diverges.
    """
    pooled = {part: np.concatenate(list(arrays)) for part, arrays in residuals.items()}
    for part, values in pooled.items():
        if not len(values) or not np.isfinite(values).all():
            raise FitError(
                f"the model that was fitted without {part} cannot predict it, or its prediction "
                "is not finite",
                "remove `validate.intervals`",
            )
    parts = list(pooled.values())
    return LeftOut(
        kind=kind,
        curves=curves,
        parts=tuple(pooled),
        samples=np.array([len(r) for r in parts]),
        offset=np.array([r.mean() for r in parts]),
        scatter=np.array([r.std() for r in parts]),
        sizes=np.array([np.quantile(np.abs(r), SHARES) for r in parts]),
    )


def with_levels(
    left_out: LeftOut, training: Mapping[float | None, Sequence[Array]], parameters: int
) -> LeftOut:
    """Add statistics of the training residuals to the summary, and return it. `training` holds the
    residuals of each training recording, by level (None without levels).

    The root mean square of the training residuals is multiplied by `sqrt((n + p)/(n - p))` for n
    samples and p parameters, if n is larger than p. The product is an estimate of the error on new
    samples, which is larger than the residuals of the fit (Akaike's final prediction error).
    """
    every = np.concatenate(
        [recording for level in training.values() for recording in level] or [np.zeros(1)]
    )
    n = len(every)
    p = parameters if parameters < len(every) else 0
    pairs = [recording[1:] * recording[:-1] for level in training.values() for recording in level]
    products = np.concatenate([*pairs, np.zeros(0)])
    smooth = max(float(products.mean()), 0.0) if len(products) else 0.0
    residual = float(np.sqrt(np.mean(every**2) * (n + p) / (n - p)))
    if left_out.kind not in ("levels", "blocks") or None in training:
        return replace(left_out, residual=residual)
    places = sorted(level for level in training if level is not None)
    return replace(
        left_out,
        residual=residual,
        places=tuple(places),
        repeats=tuple(len(training[level]) for level in places),
        smooth=math.sqrt(smooth),
        apart=scatter_of_recordings(list(training.values())),
    )


def scatter_of_recordings(levels: Sequence[Sequence[Array]]) -> float:
    """Return the standard deviation between recordings of one level, from the training residuals of
    each recording of each level; NaN if no level has several recordings.

    A recording is represented by the means of `BLOCKS` parts, so that not only offsets between
    recordings but also different slopes are found. The contribution of the noise of the samples is
    subtracted.
    """
    squares = 0.0
    freedom = 0
    noise = list[float]()
    for level in levels:
        if len(level) > 1:
            count = BLOCKS if min(map(len, level)) >= BLOCKS else 1
            parts = [np.array_split(recording, count) for recording in level]
            means = np.array([[part.mean() for part in recording] for recording in parts])
            squares += float(np.sum((means - means.mean(axis=0)) ** 2)) / count
            freedom += len(level) - 1
            noise += [part.var() / len(part) for recording in parts for part in recording]
    if not freedom:
        return math.nan
    return math.sqrt(max(squares / freedom - float(np.mean(noise)), 0.0))


def interval_limits(left_out: LeftOut) -> str | None:
    """Return a text for the reader if there is no interval, or if the interval does not include all
    errors. The text gives the reason, and the measurements that would help. Return None if the
    interval is complete.
    """
    if left_out.astray > ASTRAY:
        return (
            "with one of its levels left out, the prediction is beyond the measured values "
            f"by {100 * left_out.astray:.0f} % of their range, so that there are no "
            "intervals"
        )
    if not left_out.places:
        return SAME_RECORDINGS if left_out.kind == "blocks" else None
    count = len(left_out.places)
    levels = f"{count} level{'s' if count > 1 else ''}"
    if offsets_of(left_out) is None:
        return (
            f"the recordings of {levels} do not show how much curves of one level differ, so that "
            "there are no intervals. Record every level at least twice, or four or more levels"
        )
    if count == 2:
        return (
            "no level between the two could be left out, so that intervals exist at the "
            "two levels only. Record a third level between them"
        )
    return None


def half_widths(left_out: LeftOut, at: Array, level: float) -> Array:
    """Return half of the width of the interval that contains a sample of a new curve with
    probability `level`, shape (n,).

    `at`, (n,), holds the value of the level quantity at each sample. If the model has no levels,
    `at` is not used. The result is NaN if there are no intervals.
    """
    if left_out.astray > ASTRAY:
        return np.full(len(at), np.nan)
    if left_out.places:
        return of_levels(left_out, at, level)
    return np.full(len(at), many_curves(left_out, level))


def of_levels(left_out: LeftOut, at: Array, level: float) -> Array:
    """Return half of the width of the interval for a model with levels, (n,). `at`, (n,), holds the
    value of the level quantity at each sample. The result is NaN if the data do not determine the
    width.
    """
    # imported here, because the import is slow and most runs do not need it
    from scipy.special import stdtrit

    offsets = offsets_of(left_out)
    count = len(left_out.places)
    if offsets is None:
        return np.full(len(at), np.nan)
    gap, t, _ = gaps(left_out, at)
    n = np.array(left_out.repeats)
    share = 1 + (1 - t) ** 2 / n[gap] + t**2 / n[np.minimum(gap + 1, count - 1)]
    half = offsets.half_width(share, level)
    between = np.minimum(t, 1 - t) >= AT_LEVEL
    if count == 2:
        return np.where(between, np.nan, half)
    least = np.zeros(len(at))
    if count >= MANY:
        least += np.quantile(left_out.sizes, level)
        if offsets.repeated and offsets.errs_between:
            model = stdtrit(NEIGHBOURS * (count - 1), 0.5 + level / 2) ** 2
            extra = model * (offsets.missed - offsets.explained)
            half = np.sqrt(half**2 + np.where(between, extra, 0.0))
    elif offsets.errs_between:
        least = between_levels(left_out, at, level)
    return np.maximum(half, np.where(between, least, 0.0))


def gaps(left_out: LeftOut, at: Array) -> tuple[IntArray, Array, Array]:
    """Return, for each value of the level quantity `at`, the index of the gap between two levels in
    which it lies, its position in the gap from 0 to 1, and the width of the gap, shape (n,) each.
    """
    places = np.array(left_out.places)
    gap = np.clip(np.searchsorted(places, at, side="right") - 1, 0, max(len(places) - 2, 0))
    if len(places) == 1:
        return gap, np.zeros(len(at)), np.zeros(len(at))
    width = np.diff(places)[gap]
    t = (at - places[gap]) / np.diff(places)[gap]
    return gap, np.where(np.isnan(t), 0.5, np.clip(t, 0.0, 1.0)), width


def between_levels(
    left_out: LeftOut, at: Array, level: float, scales: Mapping[int, float] = FEW
) -> Array:
    """Return the lower bound of half of the width of the interval, (n,), for a model with three to
    six levels. `at`, (n,), holds the value of the level quantity at each sample. With so few
    levels, the errors of the model between levels follow a separate rule (see the module).
    """
    from scipy.special import ndtri

    count = len(left_out.places)
    _, t, width = gaps(left_out, at)
    missed = math.sqrt(float(np.mean(left_out.offset**2 + left_out.scatter**2)))
    errors = np.maximum([missed, left_out.residual], LEAST * left_out.largest)
    between = (
        scales[min(count, 5)]
        * np.cbrt(errors[0] * errors[1] ** 2)
        * (width / np.ptp(left_out.places) * (count - 1)) ** 0.75
    )
    between = between * np.maximum(4 * t * (1 - t), 0.05) ** 0.6
    half = np.maximum(NORMAL * left_out.residual, between)
    return np.asarray(half * float(ndtri(0.5 + level / 2)) / NORMAL)


def many_curves(left_out: LeftOut, level: float) -> float:
    """Return half of the width of the interval if the left-out parts are recordings, specimens or
    blocks. Two values are computed: one from Student's t distribution over the parts, and one from
    the quantile of the absolute residuals. The larger value is returned.
    """
    from scipy.special import stdtrit

    new = 1 + 1 / left_out.curves
    t = float(stdtrit(left_out.curves - 1, 0.5 + level / 2))
    normal = t * math.sqrt(
        float(np.mean(left_out.offset**2)) * new + float(np.mean(left_out.scatter**2))
    )
    return max(normal, float(np.quantile(left_out.sizes, level)) * new)


def half_widths_of(model: Model, columns: Columns, level: float) -> Array:
    """Return half of the width of a model's intervals at every row, shape (n,); NaN if no interval
    can be computed. Raises the same errors as `intervals_of`.
    """
    left_out = intervals_of(model, level)
    at = np.full(row_count(columns), np.nan) if model.level is None else columns[model.level]
    return half_widths(left_out, at, level)


def intervals_of(model: Model, level: float) -> LeftOut:
    """Return the summary of left-out errors from which the intervals of a model are computed.

    Raises UsageError if the probability `level` is not between 0 and 1; DataError for a model
    without left-out residuals.
    """
    if not 0 < level < 1:
        raise UsageError(
            f"an interval with a probability of {level:g} is not possible",
            "give a number between 0 and 1, for example 0.95",
        )
    if model.left_out is None:
        remedy = "add `validate: {intervals: true}` to its spec, and run `mapmore run` again"
        raise DataError(
            f"the model {model.name} has no errors on left-out data, so it has no intervals",
            remedy,
        )
    return model.left_out


def interval(model: Model, columns: Columns, level: float) -> tuple[Array, Array]:
    """Return the lower and the upper end of the interval at every row, shape (n,) each; NaN without
    an interval. Raises the same errors as `intervals_of`.
    """
    half = half_widths_of(model, columns, level)
    return ends(predict(model, columns), outside_range(model, columns), half)


def ends(predicted: Array, outside: BoolArray, half: Array) -> tuple[Array, Array]:
    """Return the lower and the upper end of the interval around every prediction, shape (n,) each;
    NaN outside the training range.
    """
    middle = np.where(outside, np.nan, predicted)
    return middle - half, middle + half
