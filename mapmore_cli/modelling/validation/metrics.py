"""How far predictions lie from measurements, on the whole and by the size of what is measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial as partial_of
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import (
    WIDE,
    Array,
    BoolArray,
    by_blocks,
    extremes,
    give_back,
    in_blocks,
    row_blocks,
)
from mapmore_cli.domain.recording import DIRECTION, Curve, Dataset, uncertainty_of
from mapmore_cli.domain.results import ErrorBand, Forecast
from mapmore_cli.domain.scores import Score
from mapmore_cli.modelling.frols.moments import LARGEST, SMALLEST, power_of_two
from mapmore_cli.modelling.signals.rates import FALL, RISE


@dataclass(frozen=True)
class Normaliser:
    """What errors are divided by; a table always names it."""

    name: str
    value: float
    extent: float = math.nan  # range of the same samples

    def fraction(self, error: float) -> float:
        """Return the error as a fraction; NaN where there is nothing to divide by."""
        return error / self.value if self.value > 0 else math.nan


NORMALISERS: Mapping[str, tuple[str, Callable[[float, float], float]]] = {
    "max": ("max|{}| over {}", lambda low, high: max(abs(low), abs(high))),
    "range": ("range of {} over {}", lambda low, high: high - low),
}
"""By the names that specs have for them: `max |y|` (M2 eq 13), and `max y - min y` for quantities
whose zero is arbitrary.
"""


def normaliser(kind: str, ends: tuple[float, float], quantity: str, split: str) -> Normaliser:
    """Return one of `NORMALISERS` by the least and the largest sample of a split."""
    name, size = NORMALISERS[kind]
    return Normaliser(name.format(quantity, split), size(*ends), ends[1] - ends[0])


# Sums over samples, which add up over blocks of a curve and over curves
# --------------------------------------------------------------------------------------------------


class Squares(NamedTuple):
    """Number, mean and sum of squares of some values about their mean, or about zero. The sum is in
    units of `unit` squared, a power of two in which squares neither vanish nor overflow.
    """

    n: int
    mean: float
    total: float
    unit: float

    @classmethod
    def of(cls, values: Array, centred: bool = False) -> Squares:
        """Sum up values, (n,), about their mean where they are `centred`."""
        mean = float(values.mean()) if centred and len(values) else 0.0
        apart, unit = values - mean if centred else values, 1.0
        with np.errstate(over="ignore", invalid="ignore"):
            total = float(apart @ apart)
        if not SMALLEST < total < LARGEST:
            unit = float(power_of_two(np.abs(values).max(initial=SMALLEST**2)))
            apart = (values - mean) / unit
            total = float(apart @ apart)
        return cls(len(values), mean, total, unit)

    @classmethod
    def together(cls, parts: Iterable[Squares]) -> Squares:
        """Return the sum of all parts (T. F. Chan, G. H. Golub, R. J. LeVeque 1983)."""
        n, mean, total, unit = np.array([*parts]).T
        whole, largest = float(n.sum()), float(unit.max())
        middle = float(n @ mean) / max(whole, 1.0)
        between = float(n @ ((mean - middle) / largest) ** 2)
        return cls(int(whole), middle, float(total @ (unit / largest) ** 2) + between, largest)

    @property
    def about_zero(self) -> Squares:
        """The sum of squares about zero."""
        shift = self.n * (self.mean / self.unit) ** 2
        return Squares(self.n, 0.0, self.total + shift, self.unit)

    @property
    def root_mean(self) -> float:
        """Root of the mean square."""
        return self.unit * math.sqrt(self.total / self.n)

    def over(self, other: Squares) -> float:
        """Return this sum over another; NaN where that is zero."""
        if not other.total > 0:
            return math.nan
        return self.total / other.total * (self.unit / other.unit) ** 2


class Sums(NamedTuple):
    """What a row of the score table follows from.

    Samples that are not ready are the history that a model with memory goes on from: they count in
    no sum but the spread of `all_measured`, which is that of the RRSE, as it is usual.
    """

    all_measured: Squares  # about their mean, as the next
    measured: Squares
    predicted: Squares
    errors: Squares
    one_step: Squares
    worst: float
    given: int  # samples with an interval
    inside: int  # those within it
    chi2: float  # sum of squared errors over that of the uncertainty, NaN where none is known
    weight: float  # sum of the inverse of its square
    widths: tuple[Array, ...]  # of all intervals, or of an even share

    @classmethod
    def of(
        cls, measured: Array, forecast: Forecast, every: int = 1, sigma: Array | None = None
    ) -> Sums:
        """Sum up `measured` samples, (n,), of the uncertainty `sigma` where it is known, and what a
        model forecasts of them; one in `every` width of an interval is kept.
        """
        y, said = measured, forecast
        if not said.ready.all():
            y, said = measured[said.ready], forecast.at(forecast.ready)
            sigma = None if sigma is None else sigma[forecast.ready]
        error = said.values - y
        given = inside = 0
        widths = np.empty(0)
        if said.half is not None:
            known = np.flatnonzero(np.isfinite(said.half))
            given, widths = len(known), said.half[known[::every]]
            inside = int(np.count_nonzero(np.abs(error[known]) <= said.half[known]))
        own = Squares.of(y, True)
        return cls(
            own if said is forecast else Squares.of(measured, True),
            own,
            Squares.of(said.values),
            Squares.of(error),
            Squares.of(np.empty(0) if said.one_step is None else said.one_step - y),
            float(np.maximum(error.max(initial=0.0), -error.min(initial=0.0))),
            given,
            inside,
            math.nan if sigma is None else float(np.sum((error / sigma) ** 2)),
            math.nan if sigma is None else float(np.sum(sigma**-2.0)),
            (widths,),
        )

    @classmethod
    def together(cls, parts: Iterable[Sums]) -> Sums:
        """Return the sums over all parts."""
        *squares, worst, given, inside, chi2, weight, widths = zip(*parts, strict=True)
        found: Any = [*map(Squares.together, squares), float(np.max(worst))]
        found += [*map(sum, (given, inside, chi2, weight)), sum(widths, ())]
        return cls(*found)

    @property
    def correlation(self) -> float:
        """`sum y yhat / sqrt(sum y^2 sum yhat^2)`: W's correlation index, not Pearson's; NaN where
        either is zero throughout. By the law of cosines, as `yhat - y` is the error.
        """
        size = math.sqrt(self.predicted.over(self.measured.about_zero))
        error = self.errors.over(self.measured.about_zero)
        return (1 + size**2 - error) / (2 * size) if size > 0 else math.nan


def score(
    model: str,
    target: str,
    split: str,
    curve: str,
    sums: Sums,
    scale: Normaliser,
    free: int = 0,
) -> Score:
    """One row of the score table over n pooled samples y, and as a model forecasts them.

    `RMSE = sqrt(mean (y - yhat)^2)`, `NRMSE = RMSE / scale` (M2 eq 13), `R^2 = 1 - SSE / sum (y -
    mean y)^2`, which is NaN for a constant y, and `RRSE = sqrt(SSE / sum (y - mean y)^2)`. `scale`
    is the normaliser over all samples of the split, so that the rows of its curves can be compared;
    `free` are the numbers that were fitted to them.
    """
    n, errors, spread = sums.errors.n, sums.errors, sums.all_measured
    rmse = errors.root_mean
    given = sums.given > 0
    return Score(
        model=model,
        target=target,
        split=split,
        curve=curve,
        n=n,
        rmse=rmse,
        nrmse=scale.fraction(rmse),
        normaliser=scale.value,
        normaliser_name=scale.name,
        max_abs_error=sums.worst,
        max_abs_error_fs=scale.fraction(sums.worst),
        r2=1 - errors.over(sums.measured),
        rrse=math.sqrt(errors.over(spread)),
        rrse_one_step=math.sqrt(sums.one_step.over(spread)) if sums.one_step.n else math.nan,
        r_uncentred=sums.correlation,
        interval_coverage=sums.inside / sums.given if given else math.nan,
        interval_half_width=float(np.median(np.concatenate(sums.widths))) if given else math.nan,
        nrmse_range=rmse / scale.extent if scale.extent > 0 else math.nan,
        rmse_weighted=math.sqrt(sums.chi2 / sums.weight),
        chi2_dof=sums.chi2 / (n - free) if n > free else math.nan,
    )


def relative(error: Array, measured: Array) -> float:
    """`sqrt(sum error^2 / sum (y - mean y)^2)`, of errors of some or all of the measured samples;
    NaN for a constant y.
    """
    return math.sqrt(Squares.of(error).over(Squares.of(measured, True)))


def information_criteria(n: int, rmse: float, parameters: int) -> tuple[float, float]:
    """Return AIC `n ln(SSE/n) + 2k` and BIC `n ln(SSE/n) + k ln n` of a fit to n samples by k
    parameters, with `SSE/n = rmse^2` (Akaike 1974; Schwarz 1978).

    They compare models of the same samples: constants of the likelihood are left out. Minus
    infinity for an error of zero.
    """
    fit = 2 * n * math.log(rmse) if rmse > 0 else -math.inf
    return fit + 2 * parameters, fit + parameters * math.log(n)


EDGES = (0.0, 0.1, 0.25, 0.5, 1.0)
"""Of the bands, as shares of the largest absolute value of the samples that are compared; low
values have the narrower ones.
"""


def judged(dataset: Dataset) -> list[BoolArray]:
    """Return which samples of each curve a model is judged by: those held out where there are any,
    else those that train.
    """
    held_out = any(curve.held_out.any() for curve in dataset.curves)
    return [curve.held_out if held_out else curve.training for curve in dataset.curves]


def bands(dataset: Dataset, predictions: Mapping[str, tuple[Array, ...]]) -> tuple[ErrorBand, ...]:
    """RMSE of every model in each band, over the `judged` samples.

    `predictions` are by model, for every curve of the dataset. A band without samples is left out.
    """
    masks, curves = judged(dataset), dataset.curves
    measured = [curve.columns[dataset.target] for curve in curves]
    largest = max(map(abs, ends_of(measured, masks)), default=0.0)
    edges, count = np.array(EDGES) * largest, len(EDGES) - 1
    samples, known = np.zeros(count, dtype=int), {model: np.zeros(count) for model in predictions}
    squares = {model: np.zeros(count) for model in predictions}
    for place, (y, mask) in enumerate(zip(measured, masks, strict=True)):
        said = {model: every[place] for model, every in predictions.items()}
        for of, wanted, *values in in_blocks(y, mask, *said.values()):
            inside = np.digitize(np.abs(of), edges[1:-1], right=True)
            samples += np.bincount(inside[wanted], minlength=count)
            for model, own in zip(said, values, strict=True):
                error = own - of
                rows: Any = wanted & np.isfinite(error)
                rows = slice(None) if rows.all() else rows  # a copy costs more than the sums
                known[model] += np.bincount(inside[rows], minlength=count)
                squares[model] += np.bincount(inside[rows], error[rows] ** 2, count)
    with np.errstate(invalid="ignore"):
        rmse = {model: np.sqrt(total / known[model]) for model, total in squares.items()}
    return tuple(
        ErrorBand(low, high, int(n), {model: float(of[number]) for model, of in rmse.items()})
        for number, ((low, high), n) in enumerate(
            zip(pairwise(edges.tolist()), samples, strict=True)
        )
        if n
    )


MOST_WIDTHS = 1_000_000
"""Samples whose intervals the median width is of; of more, an even share."""

# names of the splits, and whether their samples are held out
SPLITS = (
    ("train", False),
    ("validate", True),
)


def divisor(dataset: Dataset, kind: str) -> Normaliser:
    """Return what all errors of a study are divided by: a measure of the validation rows, as in the
    papers, else of the training rows.
    """
    held_out = any(curve.held_out.any() for curve in dataset.curves)
    masks = [curve.held_out == held_out for curve in dataset.curves]
    ends = ends_of([curve.columns[dataset.target] for curve in dataset.curves], masks)
    return normaliser(kind, ends, dataset.target, "validate" if held_out else "train")


def ends_of(columns: Sequence[Array], masks: Sequence[BoolArray]) -> tuple[float, float]:
    """Return the least and the largest value of some columns where each has its mask."""
    ends = [extremes(x, mask) for x, mask in zip(columns, masks, strict=True) if mask.any()]
    low, high = zip(*ends, strict=True)
    return min(low), max(high)


def on_common_rows(forecasts: Mapping[str, Sequence[Forecast]]) -> dict[str, tuple[Forecast, ...]]:
    """Return the forecasts of every model on the rows that all predict: models that need a history
    would else be scored on fewer rows.
    """
    common = [
        np.logical_and.reduce([forecast.ready for forecast in curve])
        for curve in zip(*forecasts.values(), strict=True)
    ]
    return {
        name: tuple(replace(one, ready=ready) for one, ready in zip(own, common, strict=True))
        for name, own in forecasts.items()
    }


def score_rows(
    model: str,
    target: str,
    forecasts: Sequence[Forecast],
    dataset: Dataset,
    scale: Normaliser,
    *,
    partial: bool = False,
    group: str | None = None,
    free: int = 0,
) -> Iterator[Score]:
    """Rows of one model, whose `forecasts` are those of the dataset's curves; with `partial`, of
    the samples that it predicts.

    Of each split: all samples, those of each curve, of each direction of a curve, and of each value
    of the quantity `group`. What has no sample that could be predicted has no row. `scale` is the
    `divisor` of the study, `free` are the numbers that were fitted to all training samples.
    """
    every = 1 + sum(curve.size for curve in dataset.curves) // MOST_WIDTHS
    for split, held in SPLITS:
        parts: dict[tuple[int, Any], tuple[str, list[Sums]]] = {}
        for number, (curve, said) in enumerate(zip(dataset.curves, forecasts, strict=True)):
            wanted = (curve.held_out == held) & (said.ready if partial else True)
            for place, name, rows in _parts_of(curve, number, wanted, group):
                sums = summed(curve, dataset.target, said, every, rows)
                if sums.errors.n:
                    parts.setdefault(place, (name, []))[1].append(sums)
        whole = [own[0] for (kind, _), (_, own) in parts.items() if kind == 0]
        for name, own in [("all", whole), *(parts[place] for place in sorted(parts))]:
            if own:
                fitted = free if split == "train" and own is whole else 0
                sums = Sums.together(own)
                yield score(model, target, split, name, sums, scale, fitted)


def _parts_of(
    curve: Curve, number: int, wanted: BoolArray, group: str | None
) -> Iterator[tuple[tuple[int, Any], str, BoolArray]]:
    """Yield the rows of the score table that wanted samples of a curve count in: their place, their
    name, and which samples, (n,).
    """
    if wanted.any():
        yield (0, number), curve.id, wanted
        if DIRECTION in curve.columns:
            for place, (word, sign) in enumerate((("rise", RISE), ("fall", FALL))):
                on = by_blocks(partial_of(np.equal, sign), curve.columns[DIRECTION])
                yield (1, (number, place)), f"{curve.id};direction={word}", wanted & on
        if group is not None:
            of = curve.columns[group]
            for value in np.unique(of[wanted]).tolist():
                yield (2, value), f"{group}={value:g}", wanted & (of == value)


def summed(curve: Curve, target: str, said: Forecast, every: int, wanted: BoolArray) -> Sums:
    """Return the sums over the `wanted` samples of a curve, (n,), block by block."""
    y, sigma = curve.columns[target], curve.columns.get(uncertainty_of(target))
    nothing = None if sigma is None else np.empty(0)
    parts = [Sums.of(np.empty(0), said.at(slice(0)), every, nothing)]
    for rows in row_blocks(curve.size):
        where: Any = wanted[rows]
        if where.any():
            where = slice(None) if where.all() else where
            unsure = None if sigma is None else sigma[rows][where]
            parts.append(Sums.of(y[rows][where], said.at(rows).at(where), every, unsure))
        if rows.stop % WIDE == 0:
            give_back(y)
            give_back(said.values)
    return Sums.together(parts)
