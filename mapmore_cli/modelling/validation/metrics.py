"""How far predictions lie from measurements, on the whole and by the size of what is measured."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.recording import DIRECTION, Curve, Dataset
from mapmore_cli.domain.results import Forecast
from mapmore_cli.domain.scores import Score
from mapmore_cli.modelling.signals.rates import FALL, RISE


@dataclass(frozen=True)
class Normaliser:
    """What errors are divided by; a table always names it."""

    name: str
    value: float

    def fraction(self, error: float) -> float:
        """Return the error as a fraction; NaN where there is nothing to divide by."""
        return error / self.value if self.value > 0 else math.nan


def max_abs(y: Array, quantity: str, split: str) -> Normaliser:
    """`max |y|` over the samples of a split (M2 eq 13)."""
    return Normaliser(f"max|{quantity}| over {split}", float(np.abs(y).max()))


def extent(y: Array, quantity: str, split: str) -> Normaliser:
    """`max y - min y` over the samples of a split, for quantities whose zero is arbitrary."""
    return Normaliser(f"range of {quantity} over {split}", float(np.ptp(y)))


NORMALISERS = {"max": max_abs, "range": extent}  # by the names that specs have for them


def score(model: str, target: str, split: str, curve: str, measured: Array, found: Forecast, scale: Normaliser) -> Score:
    """One row of the score table over n pooled samples, `measured` (n,) and as a model has `found` them.

    `RMSE = sqrt(mean (y - yhat)^2)`, `NRMSE = RMSE / scale` (M2 eq 13), `R^2 = 1 - SSE / sum (y - mean y)^2`, which is NaN for a
    constant y, and `RRSE = sqrt(SSE / sum (y - mean y)^2)`. `scale` is the normaliser over all samples of the split, so that the rows of
    its curves can be compared.

    Samples that are not `ready` are the history that a model with memory goes on from: they count in no number but the spread of the RRSE,
    as it is usual.
    """
    known, predicted = found.ready, found.values
    y, error = measured[known], (predicted - measured)[known]
    unit = _unit_of(error, y)
    spread = float(np.sum(((y - y.mean()) / unit) ** 2))
    rmse = unit * float(np.sqrt(np.mean((error / unit) ** 2)))
    worst = float(np.abs(error).max())
    width = np.full(len(y), np.nan) if found.half is None else found.half[known]
    given = np.isfinite(width)
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
        r2=1 - float(np.sum((error / unit) ** 2)) / spread if spread > 0 else math.nan,
        rrse=relative(error, measured),
        rrse_one_step=math.nan if found.one_step is None else relative((found.one_step - measured)[known], measured),
        r_uncentred=uncentred(y, predicted[known]),
        interval_coverage=float(np.mean(np.abs(error[given]) <= width[given])) if given.any() else math.nan,
        interval_half_width=float(np.median(width[given])) if given.any() else math.nan,
    )


def uncentred(measured: Array, predicted: Array) -> float:
    """`sum y yhat / sqrt(sum y^2 sum yhat^2)`: W's correlation index, not Pearson's; NaN where either is zero throughout."""
    measured, predicted = measured / _unit_of(measured), predicted / _unit_of(predicted)
    size = float(np.linalg.norm(measured) * np.linalg.norm(predicted))
    return float(measured @ predicted) / size if size > 0 else math.nan


def relative(error: Array, measured: Array) -> float:
    """`sqrt(sum error^2 / sum (y - mean y)^2)`, of errors of some or all of the measured samples; NaN for a constant y."""
    unit = _unit_of(error, measured)
    spread = float(np.sum(((measured - measured.mean()) / unit) ** 2))
    return float(np.sqrt(np.sum((error / unit) ** 2) / spread)) if spread > 0 else math.nan


def _unit_of(*values: Array) -> float:
    """Return a power of two next to the largest value, in which squares neither vanish nor overflow; dividing by it changes no digit."""
    largest = max(float(np.abs(array).max(initial=0.0)) for array in values)
    return math.ldexp(0.5, math.frexp(largest)[1]) if 0 < largest < math.inf else 1.0


EDGES = (0.0, 0.1, 0.25, 0.5, 1.0)
"""Of the bands, as shares of the largest absolute value of the samples that are compared; low values have the narrower ones."""


@dataclass(frozen=True)
class Band:
    """Samples whose absolute value lies between `low` and `high`; the RMSE is by model, NaN where it has no prediction there."""

    low: float
    high: float
    samples: int
    rmse: Mapping[str, float]


def bands(dataset: Dataset, predictions: Mapping[str, tuple[Array, ...]]) -> tuple[Band, ...]:
    """RMSE of every model in each band, over the held-out samples where there are any, else the training samples.

    `predictions` are by model, for every curve of the dataset. A band without samples is left out.
    """
    some_held_out = any(curve.held_out.any() for curve in dataset.curves)
    masks = [curve.held_out if some_held_out else curve.training for curve in dataset.curves]

    def chosen(values: Sequence[Array]) -> Array:
        return np.concatenate([own[mask] for own, mask in zip(values, masks, strict=True)])

    measured = chosen([curve.columns[dataset.target] for curve in dataset.curves])
    errors = {model: chosen(values) - measured for model, values in predictions.items()}
    size = np.abs(measured)
    edges = np.array(EDGES) * float(size.max(initial=0.0))
    inside = np.digitize(size, edges[1:-1], right=True)
    found = []
    for number, (low, high) in enumerate(pairwise(edges)):
        rows = inside == number
        if rows.any():
            found.append(Band(float(low), float(high), int(rows.sum()), {model: _rmse(error[rows]) for model, error in errors.items()}))
    return tuple(found)


def _rmse(error: Array) -> float:
    known = error[np.isfinite(error)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else math.nan


SPLITS = (("train", False), ("validate", True))  # names of the splits, and whether their samples are held out


class _Samples(NamedTuple):
    """Some samples of a curve as measured, (n,), and as found by a model."""

    curve: str
    measured: Array
    found: Forecast


def divisor(dataset: Dataset, normaliser: str) -> Normaliser:
    """Return what all errors of a study are divided by: a measure of the validation rows, as in the papers, else of the training rows.

    `normaliser` is one of `NORMALISERS`.
    """
    held_out = any(curve.held_out.any() for curve in dataset.curves)
    measured = np.concatenate([curve.columns[dataset.target][curve.held_out == held_out] for curve in dataset.curves])
    return NORMALISERS[normaliser](measured, dataset.target, "validate" if held_out else "train")


def on_common_rows(forecasts: Mapping[str, Sequence[Forecast]]) -> dict[str, tuple[Forecast, ...]]:
    """Return the forecasts of every model on the rows that all predict: models that need a history would else be scored on fewer rows."""
    common = [np.logical_and.reduce([found.ready for found in curve]) for curve in zip(*forecasts.values(), strict=True)]
    return {name: tuple(replace(one, ready=ready) for one, ready in zip(found, common, strict=True)) for name, found in forecasts.items()}


def score_rows(
    model: str,
    target: str,
    forecasts: Sequence[Forecast],
    dataset: Dataset,
    scale: Normaliser,
    *,
    partial: bool = False,
    group: str | None = None,
) -> Iterator[Score]:
    """Rows of one model, whose `forecasts` are those of the dataset's curves; with `partial`, of the samples that it predicts.

    `scale` is the `divisor` of the study. `group` is a quantity: the samples of each of its values also have a row of their own.
    """
    every = list(zip(dataset.curves, forecasts, strict=True))
    for split, held_out in SPLITS:
        masks = [(curve.held_out == held_out) & (found.ready if partial else True) for curve, found in every]
        parts: list[_Samples] = []
        ways: list[_Samples] = []
        for (curve, found), mask in zip(every, masks, strict=True):
            parts += _samples(curve.id, dataset.target, curve, found, mask)
            if DIRECTION in curve.columns:
                for word, sign in (("rise", RISE), ("fall", FALL)):
                    way = mask & (curve.columns[DIRECTION] == sign)
                    ways += _samples(f"{curve.id};direction={word}", dataset.target, curve, found, way)
        if not parts:
            continue
        groups = _of_groups(group, dataset.target, every, masks) if group is not None else ()
        for name, measured, found in (_pooled("all", parts), *parts, *ways, *groups):
            yield score(model, target, split, name, measured, found, scale)


def _of_groups(of: str, target: str, every: Sequence[tuple[Curve, Forecast]], masks: Sequence[BoolArray]) -> Iterator[_Samples]:
    """Yield the samples of each group, of all curves together."""
    for value in np.unique(np.concatenate([curve.columns[of][mask] for (curve, _), mask in zip(every, masks, strict=True)])):
        chosen = [(curve, found, mask & (curve.columns[of] == value)) for (curve, found), mask in zip(every, masks, strict=True)]
        parts = [part for curve, found, mask in chosen for part in _samples("", target, curve, found, mask)]
        if parts:
            yield _pooled(f"{of}={value:g}", parts)


def _samples(name: str, target: str, curve: Curve, found: Forecast, mask: BoolArray) -> list[_Samples]:
    """Return the samples of a mask; nothing where none of them could be predicted."""
    if not (mask & found.ready).any():
        return []
    one_step, half = (None if column is None else column[mask] for column in (found.one_step, found.half))
    return [_Samples(name, curve.columns[target][mask], Forecast(found.values[mask], found.ready[mask], one_step, half))]


def _pooled(name: str, parts: Sequence[_Samples]) -> _Samples:
    def joined(columns: Sequence[Array | None]) -> Array | None:
        given = [column for column in columns if column is not None]
        return np.concatenate(given) if len(given) == len(parts) else None

    values, ready = (np.concatenate([getattr(part.found, column) for part in parts]) for column in ("values", "ready"))
    one_step, half = joined([part.found.one_step for part in parts]), joined([part.found.half for part in parts])
    return _Samples(name, np.concatenate([part.measured for part in parts]), Forecast(values, ready, one_step, half))
