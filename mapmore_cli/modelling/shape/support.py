"""Test whether training data support the sign of a slope that a shape requires, or contradict it by
more than their noise.

Because of noise, differences between neighbouring samples contradict any sign. Therefore, means
over 1, 2, 4, ... neighbouring places are compared. The largest contradiction, in standard errors,
is compared with the largest one that noise alone would cause over all places and widths (a
multiscale test of monotonicity: Duembgen and Spokoiny 2001).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.recording import Curve, CurveRange, united
from mapmore_cli.modelling.literature.linear import parameter_errors
from mapmore_cli.modelling.ranges import limits
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.modelling.shape.region import Region, region_within
from mapmore_cli.modelling.shape.stencils import (
    ShapeWord,
    Stencils,
    asked_of,
    nodes_of,
    stencils_on,
)

if TYPE_CHECKING:
    from scipy.sparse import csr_array

# number of nodes of the grid on which differences of the training output are computed
COMPARED = 4096
# smallest and largest number of places of the grid along one input
LEAST_ALONG = 24
MOST_ALONG = 1000
FEWEST = 10  # smallest number of differences that can support a sign
# If at most this fraction of the differences has the wrong sign, the data do not contradict the
# sign. Otherwise, mapmore tests whether noise is the cause.
CONTRADICTED = 0.05
# a difference below this fraction of the range of the output is treated as a rounding error
ROUNDING = 1e-9
LEVEL = 0.01
"""Significance level: probability that the noise of a constant output is mistaken for a
contradiction.
"""

RUNS = 199  # number of simulations of a constant output with noise
# a contradiction of fewer standard errors is never significant
UNLIKELY = 2.0
# A slope with the wrong sign confirms a contradiction if it exceeds this many standard errors.
CONFIRMED = 3.0
# The test uses means over groups of several sizes. For each size, at most this number of
# contradictions, the most significant ones, may be tested with a fitted surface.
TRIED = 32
ABOUT = 3  # for d inputs, a plane is fitted to `2 d + ABOUT - 1` neighbours of a cell
LOCAL = 12  # the noise of a cell is the mean over at least this many cells around it


def refuse_unsupported(
    curves: Sequence[Curve],
    target: str,
    inputs: Sequence[str],
    level: str | None,
    fit: Fit,
    fewest: int = FEWEST,
    *,
    over_time: bool = False,
) -> None:
    """Raise FitError if a quantity in `fit.shape` does not vary, if the training data contradict a
    required sign by more than their noise, or if there are too few differences to support the sign.

    Only the data are used, so that `check` and a run give the same result. The test compares the
    interpolated training output at neighbouring values of the quantity, while all other inputs have
    equal values.

    - `curves`: the curves of the dataset, with their training samples.
    - `target`, `inputs`: names of the output and of the inputs of the model.
    - `level`: the quantity between whose levels curves are interpolated; None if curves are pooled.
    - `over_time`: True if the model has memory. Differences then say nothing about the output at
      rest, and are not tested.
    """
    ranges = tuple(limits(_ranges_of(curves, inputs, level), level))
    region = region_within(ranges, curves, target, inputs, fit)
    asked = asked_of(fit)
    known = [] if region is None else region.asks(asked)
    if fewest and (unknown := [word.quantity for word in asked if word not in known]):
        raise FitError(
            f"fit.shape: `{unknown[0]}` is not an input of the model that varies in the "
            "training data",
            f"name one of {', '.join(region.names if region else ())}",
        )
    if region is None or over_time:
        return
    axes = _axes(region, level)
    columns = nodes_of(axes)
    between, amid = region.between(columns)
    inside, output = region.holds(columns) & amid, between @ region.values
    for word in (word for word in known if word.word in ("increasing", "decreasing")):
        rises = stencils_on(axes, word, inside).of(output)
        count = len(rises)
        wrong = int((rises < -ROUNDING * region.span).sum())
        against = None
        if wrong > CONTRADICTED * count:
            against = _contradiction(region, axes, word, inside, between)
        if count < fewest or against is not None:
            against_words = "" if against is None else against.told
            raise FitError(
                f"fit.shape: `{word.quantity}: {word.word}` was examined at {count} "
                f"differences of the training data, of which {wrong} contradict it{against_words}",
                f"a condition needs at least {FEWEST} differences, and data may contradict it only "
                "within their noise; remove this condition, or raise `fit.slack`",
            )


def _ranges_of(
    curves: Sequence[Curve], inputs: Sequence[str], level: str | None
) -> list[CurveRange]:
    """Return the training range of every input. If the curves have levels, every curve has its own
    range; otherwise, all curves have a common range.
    """
    known = sorted(
        (curve for curve in curves if curve.training.any()),
        key=lambda curve: (curve.level is not None, curve.level),
    )
    ranges = [
        {name: curve.limits(name) for name in inputs if name in curve.columns} for curve in known
    ]
    if level is None:
        return [CurveRange("all", None, united(ranges))]
    return [
        CurveRange(curve.id, curve.level, its) for curve, its in zip(known, ranges, strict=True)
    ]


def _axes(region: Region, level: str | None) -> dict[str, Array]:
    """Return the grid on which the training output is interpolated: its places along each input."""
    most = np.clip(round(COMPARED ** (1 / len(region.names))), LEAST_ALONG, MOST_ALONG)
    axes = dict(region.fixed)
    for name, x in zip(region.names, region.places.T, strict=True):
        places = region.ranges[0].levels if name == level else np.unique(x)
        axes[name] = places if len(places) <= most else np.linspace(places[0], places[-1], most)
    return axes


class _Against(NamedTuple):
    """Contradiction between the training data and a condition of the shape. `amount` is the
    difference with the wrong sign between the means of two groups of neighbouring places, and
    `errors` is this difference divided by its standard error. `place` is the stencil of both
    groups. `cells` holds the indices of the cells from which the difference was computed.
    """

    errors: float
    amount: float
    place: Stencils
    cells: IntArray

    @property
    def told(self) -> str:
        """Description of the contradiction in words."""
        return (
            f", by {self.amount:.3g} on average over a stretch, which is {self.errors:.3g} "
            f"times what their noise explains; the largest is at {self.place.told}"
        )


def _contradiction(
    region: Region,
    axes: Mapping[str, Array],
    asked: ShapeWord,
    inside: BoolArray,
    between: csr_array,
) -> _Against | None:
    """Return the contradiction of the condition `asked` with the largest number of standard errors;
    None if no contradiction is significant. A contradiction is significant if noise alone would
    cause it with a probability of at most `LEVEL`, and if the slope of a surface that is fitted to
    the cells confirms it.
    """
    from scipy.sparse import csr_array

    near = _near(region)
    sigma = _noise(region, near)
    noise = sigma[:, None] * np.random.default_rng(0).normal(size=(len(sigma), RUNS))
    contradictions = list[_Against]()
    by_noise = np.zeros(RUNS)
    for power in range(len(axes[asked.quantity]).bit_length() - 1):
        stencils = stencils_on(axes, asked, inside, 2**power)
        if not len(stencils.nodes):
            break
        size = (len(stencils.nodes), len(inside))
        starts = np.arange(0, stencils.nodes.size + 1, stencils.nodes.shape[1])
        rises = (
            csr_array((stencils.weights.ravel(), stencils.nodes.ravel(), starts), size) @ between
        )
        error = np.sqrt(rises.power(2) @ sigma**2) + ROUNDING * region.span
        against = -(rises @ region.values) / error
        by_noise = np.maximum(by_noise, (-(rises @ noise) / error[:, None]).max(axis=0))
        for row in np.argsort(-against)[:TRIED].tolist():
            cells = rises.indices[rises.indptr[row] : rises.indptr[row + 1]]
            place = stencils.at(np.array([row]))
            contradictions.append(
                _Against(float(against[row]), float(against[row] * error[row]), place, cells)
            )
    least = max(UNLIKELY, float(np.quantile(by_noise, 1 - LEVEL, method="higher")))
    for contradiction in sorted(contradictions, key=lambda contradiction: -contradiction.errors):
        if contradiction.errors > least and _confirmed(
            region, asked, np.unique(near[contradiction.cells])
        ):
            return contradiction
    return None


def _confirmed(region: Region, asked: ShapeWord, cells: IntArray) -> bool:
    """Fit a surface to some cells, and return True if its slope has the wrong sign. The magnitude
    of the slope must be more than `CONFIRMED` times its standard error. The surface is linear in
    the quantity of the condition `asked`, and quadratic in the other inputs.

    This confirmation is needed because the output between scattered cells is interpolated linearly
    in long, thin simplices. If the true output is curved, the interpolated output may fall although
    the true output rises. The surface is fitted to more cells and has no such simplices. If it
    cannot follow the curvature, its residuals are larger, and therefore its standard errors too.
    """
    others = [name != asked.quantity for name in region.names]
    x = region.places[cells]
    X = np.column_stack([np.ones(len(cells)), x, (x[:, others] - x[:, others].mean(axis=0)) ** 2])
    theta = np.linalg.lstsq(X, region.values[cells])[0]
    left, freedom = region.values[cells] - X @ theta, len(cells) - X.shape[1]
    variance = float(left @ left) / freedom if freedom > 0 else 0.0
    along = 1 + region.names.index(asked.quantity)
    against = theta[along] * (-1.0 if asked.word == "increasing" else 1.0)
    return bool(against > CONFIRMED * parameter_errors(X, variance)[0][along])


def _near(region: Region) -> IntArray:
    """Return, for each of the c cells, the indices of the cells nearest to it, shape (c, k). The
    first of them is the cell itself.
    """
    from scipy.spatial import KDTree

    c, d = region.places.shape
    places = region.places / np.ptp(region.places, axis=0)
    near = KDTree(places).query(places, min(c, max(2 * d + ABOUT, LOCAL)))[1]
    return np.asarray(near).reshape(c, -1)


def _noise(region: Region, near: IntArray) -> Array:
    """Return the standard deviation of the noise in the value of each cell, (c,).

    A plane is fitted to the nearest cells of a cell (`near`). Let s be the standard deviation of
    one sample. The value of the cell minus the plane has the variance `s^2 (1/n + sum w_i^2/n_i)`,
    with the number n of samples in the cell, the numbers n_i in the nearest cells, and their
    weights w_i in the plane. `s^2` is estimated as the mean over all cells, or as the mean over the
    cells around a cell if that is larger (residuals of neighbours: Gasser, Sroka and
    Jennen-Steinmetz 1986).
    """
    c, d = region.places.shape
    if c < d + ABOUT:
        return np.zeros(c)
    places = region.places / np.ptp(region.places, axis=0)
    about = near[:, 1 : 2 * d + ABOUT]
    away = places[about] - places[:, None]
    weights = np.linalg.pinv(np.concatenate([np.ones_like(away[..., :1]), away], axis=2))[:, 0]
    left = region.values - np.sum(weights * region.values[about], axis=1)
    each = left**2 / (1 / region.counts + np.sum(weights**2 / region.counts[about], axis=1))
    return np.asarray(np.sqrt(np.maximum(each.mean(), each[near].mean(axis=1)) / region.counts))
