"""How far predictions lie from measurements, on the whole and by the size of what is measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.recording import DIRECTION, Dataset, uncertainty_of
from mapmore_cli.domain.results import ErrorBand, Forecast
from mapmore_cli.domain.scores import Score
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


NORMALISERS: Mapping[str, tuple[str, Callable[[Array], Any]]] = {
    "max": ("max|{}| over {}", lambda y: np.abs(y).max()),
    "range": ("range of {} over {}", np.ptp),
}
"""By the names that specs have for them: `max |y|` (M2 eq 13), and `max y - min y` for quantities
whose zero is arbitrary.
"""


def normaliser(kind: str, y: Array, quantity: str, split: str) -> Normaliser:
    """Return one of `NORMALISERS` over the samples of a split."""
    name, size = NORMALISERS[kind]
    return Normaliser(name.format(quantity, split), float(size(y)), float(np.ptp(y)))


def score(
    model: str,
    target: str,
    split: str,
    curve: str,
    measured: Array,
    forecast: Forecast,
    scale: Normaliser,
    uncertainty: Array | None = None,
    free: int = 0,
) -> Score:
    """One row of the score table over n pooled samples, `measured` (n,) and as a model forecasts
    them.

    `RMSE = sqrt(mean (y - yhat)^2)`, `NRMSE = RMSE / scale` (M2 eq 13), `R^2 = 1 - SSE / sum (y -
    mean y)^2`, which is NaN for a constant y, and `RRSE = sqrt(SSE / sum (y - mean y)^2)`. `scale`
    is the normaliser over all samples of the split, so that the rows of its curves can be compared.

    Samples that are not `ready` are the history that a model with memory goes on from: they count
    in no number but the spread of the RRSE, as it is usual. `uncertainty`, (n,), is that of the
    measured samples where it is known; `free` are the numbers that were fitted to them.
    """
    known, predicted = forecast.ready, forecast.values
    y, error = measured[known], (predicted - measured)[known]
    unit = _unit_of(error, y)
    spread, squares = float(np.sum(((y - y.mean()) / unit) ** 2)), (error / unit) ** 2
    rmse, worst = unit * float(np.sqrt(np.mean(squares))), float(np.abs(error).max())
    width = np.full(len(y), np.nan) if forecast.half is None else forecast.half[known]
    given = np.isfinite(width)
    sigma = np.full(len(y), np.nan) if uncertainty is None else uncertainty[known]
    chi2 = float(np.sum((error / sigma) ** 2))
    return Score(
        model=model,
        target=target,
        split=split,
        curve=curve,
        n=len(y),
        rmse=rmse,
        nrmse=scale.fraction(rmse),
        normaliser=scale.value,
        normaliser_name=scale.name,
        max_abs_error=worst,
        max_abs_error_fs=scale.fraction(worst),
        r2=1 - float(np.sum(squares)) / spread if spread > 0 else math.nan,
        rrse=relative(error, measured),
        rrse_one_step=math.nan
        if forecast.one_step is None
        else relative((forecast.one_step - measured)[known], measured),
        r_uncentred=uncentred_correlation(y, predicted[known]),
        interval_coverage=float(np.mean(np.abs(error[given]) <= width[given]))
        if given.any()
        else math.nan,
        interval_half_width=float(np.median(width[given])) if given.any() else math.nan,
        nrmse_range=rmse / scale.extent if scale.extent > 0 else math.nan,
        rmse_weighted=math.sqrt(chi2 / float(np.sum(sigma**-2.0))),
        chi2_dof=chi2 / (len(y) - free) if len(y) > free else math.nan,
    )


def uncentred_correlation(measured: Array, predicted: Array) -> float:
    """`sum y yhat / sqrt(sum y^2 sum yhat^2)`: W's correlation index, not Pearson's; NaN where
    either is zero throughout.
    """
    measured, predicted = measured / _unit_of(measured), predicted / _unit_of(predicted)
    size = float(np.linalg.norm(measured) * np.linalg.norm(predicted))
    return float(measured @ predicted) / size if size > 0 else math.nan


def relative(error: Array, measured: Array) -> float:
    """`sqrt(sum error^2 / sum (y - mean y)^2)`, of errors of some or all of the measured samples;
    NaN for a constant y.
    """
    unit = _unit_of(error, measured)
    spread = float(np.sum(((measured - measured.mean()) / unit) ** 2))
    return float(np.sqrt(np.sum((error / unit) ** 2) / spread)) if spread > 0 else math.nan


def information_criteria(n: int, rmse: float, parameters: int) -> tuple[float, float]:
    """Return AIC `n ln(SSE/n) + 2k` and BIC `n ln(SSE/n) + k ln n` of a fit to n samples by k
    parameters, with `SSE/n = rmse^2` (Akaike 1974; Schwarz 1978).

    They compare models of the same samples: constants of the likelihood are left out. Minus
    infinity for an error of zero.
    """
    fit = 2 * n * math.log(rmse) if rmse > 0 else -math.inf
    return fit + 2 * parameters, fit + parameters * math.log(n)


def _unit_of(*values: Array) -> float:
    """Return a power of two next to the largest value, in which squares neither vanish nor
    overflow; dividing by it changes no digit.
    """
    largest = max(float(np.abs(array).max(initial=0.0)) for array in values)
    return math.ldexp(0.5, math.frexp(largest)[1]) if 0 < largest < math.inf else 1.0


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
    masks = judged(dataset)

    def chosen(values: Iterable[Array]) -> Array:
        return np.concatenate([own[mask] for own, mask in zip(values, masks, strict=True)])

    measured = chosen(curve.columns[dataset.target] for curve in dataset.curves)
    errors = {model: chosen(values) - measured for model, values in predictions.items()}
    edges = np.array(EDGES) * float(np.abs(measured).max(initial=0.0))
    inside = np.digitize(np.abs(measured), edges[1:-1], right=True)
    told = []
    for number, (low, high) in enumerate(pairwise(edges.tolist())):
        rows = inside == number
        known = {model: error[rows & np.isfinite(error)] for model, error in errors.items()}
        rmse = {
            model: float(np.sqrt(np.mean(error**2))) if len(error) else math.nan
            for model, error in known.items()
        }
        told.append(ErrorBand(low, high, int(rows.sum()), rmse))
    return tuple(band for band in told if band.samples)


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
    measured = np.concatenate(
        [curve.columns[dataset.target][curve.held_out == held_out] for curve in dataset.curves]
    )
    return normaliser(kind, measured, dataset.target, "validate" if held_out else "train")


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
    curves, unsure = dataset.curves, uncertainty_of(dataset.target)

    def column(name: str) -> Array:
        return np.concatenate([curve.columns[name] for curve in curves])

    measured, whole = column(dataset.target), _concatenated(forecasts)
    held_out = np.concatenate([curve.held_out for curve in curves])
    sigma = column(unsure) if unsure in curves[0].columns else None
    every = np.split(np.arange(len(measured)), np.cumsum([curve.size for curve in curves])[:-1])
    for split, held in SPLITS:
        wanted = (held_out == held) & (whole.ready if partial else True)
        of_curves = [rows[wanted[rows]] for rows in every]
        parts = [
            ("all", of_curves),
            *((curve.id, [rows]) for curve, rows in zip(curves, of_curves, strict=True)),
        ]
        if DIRECTION in curves[0].columns:
            way = column(DIRECTION)
            for curve, rows in zip(curves, of_curves, strict=True):
                parts += [
                    (f"{curve.id};direction={word}", [rows[way[rows] == sign]])
                    for word, sign in (("rise", RISE), ("fall", FALL))
                ]
        if group is not None:
            of = column(group)
            parts += [
                (f"{group}={value:g}", [rows[of[rows] == value] for rows in of_curves])
                for value in np.unique(of[wanted])
            ]
        for name, some in parts:
            predicted = [rows for rows in some if whole.ready[rows].any()]
            if predicted:
                rows = np.concatenate(predicted)
                others = (
                    None if column is None else column[rows]
                    for column in (whole.one_step, whole.half)
                )
                yield score(
                    model,
                    target,
                    split,
                    name,
                    measured[rows],
                    Forecast(whole.values[rows], whole.ready[rows], *others),
                    scale,
                    None if sigma is None else sigma[rows],
                    free if split == "train" and name == "all" else 0,
                )


def _concatenated(forecasts: Sequence[Forecast]) -> Forecast:
    """Return the forecasts of several curves as one; what one of them lacks, the whole lacks."""

    def whole(name: str) -> Any:
        columns = [getattr(one, name) for one in forecasts]
        return None if any(column is None for column in columns) else np.concatenate(columns)

    return Forecast(whole("values"), whole("ready"), whole("one_step"), whole("half"))
