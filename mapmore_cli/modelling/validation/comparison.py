"""Decide whether a muscle has changed, by comparing two models of it on a common grid inside both
training ranges.

Samples of one curve are not independent, because for example an error of the load cell affects the
whole curve. Therefore, one number is computed for each curve, and the scatter of these numbers
gives the uncertainty of their mean.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, root_mean_square
from mapmore_cli.domain.fits import LOWER_BOUND
from mapmore_cli.domain.models import Model, Pieces, SegmentFunction
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.validation.common_curves import CurvePlace, common_curves, grid
from mapmore_cli.modelling.validation.intervals import half_widths
from mapmore_cli.modelling.validation.significance import sign_permutation, weighted_mean

CONFIDENCE, EQUIVALENCE = 0.95, 0.90
"""Level of the interval, and level of the interval that must lie within the margin (two one-sided
tests of 5 % each).
"""

CHANGED, SAME, UNCLEAR = "changed", "same", "cannot tell"  # possible results of a comparison
# result for two models of the same recordings, whose differences are caused by the settings
OF_SETTINGS = "settings"
# A change of the force by less than this fraction is ignored: repeated measurements differ as much.
MARGIN = 0.01
MOST_POINTS = 6  # largest number of reference points


@dataclass(frozen=True)
class CurveChange:
    """Difference between the later and the earlier model along one curve.

    - `ratio`: the factor by which the output has changed. It is `sum(a b)/sum(a^2)` over the points
      of the grid, with the output a of the earlier model and the output b of the later model.
      `weight`: the weight of this factor in the mean over all curves, which is proportional to
      `sum(a^2)`.
    - `difference`, `rms`: mean and root mean square of `b - a`, in the unit of the output.
    - `largest`, `place`: the value of `b - a` with the largest magnitude, and the point of the grid
      there.
    - `interpolated`: True if one of the models has no curve at this level.
    """

    curve: str
    level: float | None
    points: int
    ratio: float
    weight: float
    difference: float
    rms: float
    largest: float
    place: Mapping[str, float]
    interpolated: bool


@dataclass(frozen=True)
class TermChange:
    """Coefficients of one term of one segment in both models, in the unit of the output. A
    coefficient is None if its model does not have the term.

    `error` is the standard error of the difference (the root of the sum of squares of both standard
    errors), NaN if one of them is missing. `errors_note` is the assumption about residuals on which
    the standard errors are based. If one of the standard errors is only a lower bound, this is
    noted here.
    """

    segment: str
    term: str
    before: float | None
    after: float | None
    error: float
    errors_note: str

    @property
    def moved(self) -> bool:
        """Return True if the coefficient changed by more than twice the standard error of the
        difference, or if only one model has the term.
        """
        return (
            self.before is None
            or self.after is None
            or not abs(self.after - self.before) <= 2 * self.error
        )


@dataclass(frozen=True)
class Comparison:
    """Comparison of two models of one muscle.

    `ratio` is the least-squares factor from the output of the earlier model to the output of the
    later model, over all curves. It is the mean of the factors of the curves, weighted by the
    squares of the output. `interval` is its t-interval with K - 1 degrees of freedom for K curves.
    `p` is the p-value of the hypothesis that the factor is one. `p_permutation` is the p-value of a
    permutation test, in which the signs of the changes of the curves are exchanged; None if K is
    too small for this test. `narrow` is the interval at the level `EQUIVALENCE`. `resolution` is
    the smallest relative change that these curves can detect: half of the width of the interval, or
    the uncertainty of the interpolation between levels if that is larger. `settings` holds the keys
    of the spec that differ, with both values. If `same_recordings` is True, only the settings can
    differ.
    """

    before: str
    after: str
    output: str
    unit: str
    curves: tuple[CurveChange, ...]
    ratio: float
    interval: tuple[float, float]
    narrow: tuple[float, float]
    p: float
    p_permutation: float | None
    margin: float
    resolution: float
    terms: tuple[TermChange, ...] = ()
    settings: tuple[str, ...] = ()
    same_recordings: bool = False

    @property
    def changed(self) -> bool:
        """Return True if the muscle has changed. The change must be certain (the interval of the
        factor does not contain 1) and larger than the margin.
        """
        low, high = self.interval
        large = abs(self.ratio - 1) > max(self.margin, self.resolution)
        return not self.same_recordings and (low > 1 or high < 1) and large

    def moved(self, limit: float) -> bool:
        """Return True if the output of the muscle changed by more than the fraction `limit`."""
        return not self.same_recordings and abs(self.ratio - 1) > limit

    @property
    def answer(self) -> str:
        """Result of the comparison.

        - `changed`: the muscle has changed.
        - `same`: two one-sided tests show that the change is smaller than the margin.
        - `cannot tell`: the data do not decide.
        - `settings`: both models were fitted to the same recordings, so that only the settings
          differ.
        """
        if self.changed:
            return CHANGED
        if self.same_recordings:
            return OF_SETTINGS
        low, high = self.narrow
        # a change may be hidden if the interpolation between levels is uncertain
        sure = self.resolution <= max(np.ptp(self.interval) / 2, self.margin)
        return SAME if sure and 1 - self.margin < low <= high < 1 + self.margin else UNCLEAR

    @property
    def by_effect(self) -> tuple[CurveChange, ...]:
        """The curves, sorted by the root mean square of their difference; the largest comes
        first.
        """
        return tuple(sorted(self.curves, key=lambda curve: -curve.rms))


def compare(before: Model, after: Model, margin: float = MARGIN) -> Comparison:
    """Compare two models on the curves that they have in common.

    Raises ValueError if the models have different quantities, or fewer than two curves in common;
    the message says which.
    """
    if before.output != after.output or set(before.inputs) != set(after.inputs):
        raise ValueError(
            f"{before.name} and {after.name} have different quantities or units, so that "
            "they cannot be compared"
        )
    curves = tuple(_change(before, after, place) for place in common_curves(before, after))
    ratios, weights = (
        np.array([getattr(curve, name) for curve in curves]) for name in ("ratio", "weight")
    )
    shares = weights / weights.sum()
    factor = weighted_mean(ratios, weights, CONFIDENCE)
    between = _of_interpolation(before, after, curves, shares)
    return Comparison(
        before=before.name,
        after=after.name,
        output=before.output.name,
        unit=before.output.unit,
        curves=tuple(
            replace(curve, weight=share)
            for curve, share in zip(curves, shares.tolist(), strict=True)
        ),
        ratio=factor.value,
        interval=factor.interval,
        narrow=weighted_mean(ratios, weights, EQUIVALENCE).interval,
        p=weighted_mean(ratios - 1, weights, CONFIDENCE).p,
        p_permutation=sign_permutation(weights * (ratios - 1)),
        margin=margin,
        resolution=max((factor.interval[1] - factor.interval[0]) / 2, between),
        terms=term_changes(before, after),
    )


def _of_interpolation(
    before: Model, after: Model, curves: Sequence[CurveChange], shares: Array
) -> float:
    """Return the uncertainty of the factor between both models that is caused by interpolation
    between levels. It is computed from the prediction intervals of the models
    (`validate.intervals`).

    The uncertainty is `1.96 sqrt(sum(share^2 u^2))` over the interpolated curves. Here, `share` is
    the weight of a curve in the factor, and u is the standard deviation of a model at the level of
    the curve, divided by the root mean square of the output of `before`. The uncertainty is 0 if no
    curve is interpolated or no model has intervals, and infinite if the intervals of a model cannot
    be computed.
    """
    squares = 0.0
    for curve, share in zip(curves, shares, strict=True):
        for model in (before, after) if curve.interpolated else ():
            if model.left_out is None or model.level is None:
                continue
            points = grid(before, after, CurvePlace(curve.curve, curve.level))
            half = float(half_widths(model.left_out, points[model.level][:1], CONFIDENCE)[0])
            size = root_mean_square(predict(before, points))
            squares += (share * half / size) ** 2 if math.isfinite(half) and size > 0 else math.inf
    return math.sqrt(squares)


def _change(before: Model, after: Model, place: CurvePlace) -> CurveChange:
    points = grid(before, after, place)
    a, b = predict(before, points), predict(after, points)
    d = b - a
    worst = int(np.argmax(np.abs(d)))
    return CurveChange(
        curve=place.curve,
        level=place.level,
        points=len(a),
        ratio=float(a @ b / (a @ a)),
        weight=float(a @ a),
        difference=float(d.mean()),
        rms=root_mean_square(d),
        largest=float(d[worst]),
        place={name: float(values[worst]) for name, values in points.items()},
        interpolated=place.interpolated,
    )


class ReferencePoint(NamedTuple):
    """A place within the training ranges of the first and the last model, and the output of every
    model at this place.
    """

    inputs: Mapping[str, float]
    outputs: tuple[float, ...]


def reference_points(models: Sequence[Model]) -> list[ReferencePoint]:
    """Return at most `MOST_POINTS` places, and the outputs of all models there. Each place is the
    middle of a curve that the first and the last model have in common. It lies in the training
    ranges of both.
    """
    first, last = models[0], models[-1]
    places = common_curves(first, last)
    points = []
    for number in sorted(
        {round(place) for place in np.linspace(0, len(places) - 1, min(len(places), MOST_POINTS))}
    ):
        middle = {
            name: values[[len(values) // 2]]
            for name, values in grid(first, last, places[number]).items()
        }
        outputs = tuple(float(predict(model, middle)[0]) for model in models)
        points.append(
            ReferencePoint({name: float(value[0]) for name, value in middle.items()}, outputs)
        )
    return points


def term_changes(before: Model, after: Model) -> tuple[TermChange, ...]:
    """Compare the coefficients of both models. For each segment that both models have, return every
    term with its coefficients `y_slope theta` in both models. A term may occur in only one of them.
    The result is empty if a model has no segments.

    The scaling of a segment depends on the range of its data. Therefore, a coefficient also changes
    if the ends of its segment change.
    """
    if not isinstance(before.body, Pieces) or not isinstance(after.body, Pieces):
        return ()
    later = {segment.id: segment for segment in after.body.segments}
    changes = []
    for segment in (segment for segment in before.body.segments if segment.id in later):
        first, second = _coefficients(segment), _coefficients(later[segment.id])
        notes = (later[segment.id].errors_note, segment.errors_note)
        note = LOWER_BOUND if LOWER_BOUND in notes else notes[0]
        for term in dict.fromkeys((*first, *second)):
            (a, a_error), (b, b_error) = (
                terms.get(term, (None, math.nan)) for terms in (first, second)
            )
            changes.append(TermChange(segment.id, term, a, b, math.hypot(a_error, b_error), note))
    return tuple(changes)


def _coefficients(segment: SegmentFunction) -> dict[str, tuple[float, float]]:
    """Return, for every term of a segment, the coefficient and the standard error of the
    coefficient, in the unit of the output.
    """
    scale = segment.scaling.y_slope
    pairs = zip(
        (segment.theta * scale).tolist(), (segment.theta_error * abs(scale)).tolist(), strict=True
    )
    return dict(zip(segment.terms, pairs, strict=True))
