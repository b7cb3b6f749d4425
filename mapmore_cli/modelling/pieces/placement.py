"""Scale the inputs and the output of a segment (M1 step 1, M2 (i)).

With the rule `unit_square`, the origin of the scaled coordinates lies on the curve, at one end of
the range of each input. This point is called the anchor. Its output is computed from several
samples, so that the scaling does not depend on the noise of a single sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from mapmore_cli.domain.arrays import Array, extremes
from mapmore_cli.domain.fits import Scaling
from mapmore_cli.modelling.signals.sampling import even_share

# The output at the anchor is computed from this fraction of all samples, the nearest ones.
END_FRACTION = 0.05
FEWEST = 3  # smallest number of samples from which the output at the anchor is computed
# Up to this number v of inputs, all `2^v` corners of their ranges are tried as the anchor.
# With more than 3 inputs, two corners are tried: the left ends and the right ends of all inputs.
EVERY_CORNER_UP_TO = 3
# In the fit of the parabola, singular values below this fraction of the largest are set to zero.
FLAT = 1e-3
ALIKE = 1e-12  # weights with a smaller relative difference are treated as equal
EXTRA = 1  # If weights are not equal, the parabola is fitted to this number of additional samples.
ROUNDING = 1e-9  # relative rounding error of a sum of weights


def placements(
    rule: str,
    inputs: Sequence[Array],
    y: Array,
    variables: Sequence[str],
    weights: Array | None = None,
) -> tuple[Scaling, ...]:
    """Return all scalings of the samples of v `inputs` and of `y`, (n,) each, that the `rule`
    allows. The caller chooses the scaling with the smallest error.

    - `unit_square`: the ranges of x and y have the width 1, and the curve passes through the
      origin. The origin lies at the left or at the right end of each variable, so that scaled data
      lie in [0, 1] or [-1, 0]. The two ends give different one-term fits. For a falling curve, a
      power with its origin on the left is concave, and a power with its origin on the right is
      convex.
    - `max_abs`: division by the largest magnitude, no offset.
    - `none`: no scaling.

    `weights` of the samples, (n,), are used for the anchor (`end_of_trend`); None for equal
    weights.
    """
    names = tuple(variables)
    count = len(variables)
    ends = np.array([extremes(x) for x in (*inputs, y)])
    if rule == "unit_square":
        every = (
            product((False, True), repeat=count)
            if count <= EVERY_CORNER_UP_TO
            else [(False,) * count, (True,) * count]
        )
        shares = list(map(even_share, (*inputs, y)))
        shares.append(np.ones(len(shares[-1])) if weights is None else even_share(weights))
        return tuple(_anchored(shares, names, right, ends) for right in every)
    slope = np.ones(count)
    y_slope = 1.0
    if rule == "max_abs":
        sizes = span(np.abs(ends).max(axis=1))
        slope = 1 / sizes[:-1]
        y_slope = float(sizes[-1])
    elif rule != "none":
        raise ValueError(f"unknown scaling rule {rule!r}: unit_square, max_abs or none")
    return (Scaling(rule, "-", names, slope, np.zeros(count), y_slope, 0.0),)


def _anchored(
    samples: Sequence[Array], variables: tuple[str, ...], right: tuple[bool, ...], ends: Array
) -> Scaling:
    low, high = ends[:-1].T
    slope = 1 / span(high - low)
    anchor = np.where(right, high, low)
    *inputs, y, weights = samples
    away = np.array([(x - a) * m for x, a, m in zip(inputs, anchor, slope, strict=True)])
    y_anchor = end_of_trend(away, y, weights) if variables else 0.0
    place = ",".join("right" if r else "left" for r in right) or "-"
    y_span = float(span(np.ptp(ends[-1])))
    return Scaling("unit_square", place, variables, slope, -slope * anchor, y_span, y_anchor)


def span(width: ArrayLike) -> Array:
    """Return the widths by which variables are divided when they are scaled. A width of zero, which
    belongs to a constant variable, is replaced by one.
    """
    return np.where(np.asarray(width) > 0, width, 1.0)


def end_of_trend(away: Array, y: Array, weights: Array) -> float:
    """Return the output at the anchor, averaged over the 5 % of the samples that are nearest to the
    anchor. `y`, (n,), is the output of the samples. `away`, (v, n), holds the distances of the
    samples from the anchor in scaled coordinates.

    If the 5 % are three or more samples with equal weights, the mean of their measured values is
    used. Otherwise, a parabola is fitted by weighted least squares, and its mean at these samples
    is used. The parabola is fitted to the nearest samples whose total weight is that of 5 % of the
    samples, and at least that of three samples. A sample with a small weight then has little
    influence, even if the curve is steep.

    Samples with equal values are merged into one sample with the sum of their weights. Samples at
    the same distance are used together or not at all, so that the order of the rows has no
    influence.
    """
    far = np.abs(away).max(axis=0)
    order = np.lexsort([y, *away, far])
    rows = np.column_stack([*away.T[order].T, y[order]])
    first = np.flatnonzero(np.append(True, (rows[1:] != rows[:-1]).any(axis=1)))
    order, total = order[first], np.add.reduceat(weights[order], first)
    away, y, far = away[:, order], y[order], far[order]
    nearest = far <= far[max(1, int(np.ceil(END_FRACTION * len(y)))) - 1]
    count = max(FEWEST, int(np.count_nonzero(nearest)))
    first = total[:count]
    alike = np.ptp(first) <= ALIKE * first.max()
    if alike and np.count_nonzero(nearest) >= FEWEST:
        return float(np.mean(y[nearest]))
    wanted = (count + EXTRA * (not alike)) * np.median(total) * (1 - ROUNDING)
    enough = int(np.searchsorted(np.cumsum(total), wanted))
    used = far <= far[min(enough, len(y) - 1)]
    used |= nearest
    B = np.vstack([np.ones(len(y)), away, away**2])
    B[1:] /= np.abs(B[1:, used]).max(axis=1, initial=np.finfo(float).tiny)[:, None]
    root = np.sqrt(total[used] / total[used].max())
    theta = np.linalg.lstsq((B[:, used] * root).T, y[used] * root, rcond=FLAT)[0]
    return float(np.mean(theta @ B[:, nearest]))
