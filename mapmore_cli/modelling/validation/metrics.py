"""Compute the errors of predictions, over all samples and for bands of the measured value."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, pairwise
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import (
    WIDE,
    Array,
    BoolArray,
    blocks_where,
    by_blocks,
    extremes,
    give_back,
    in_blocks,
    row_blocks,
)
from mapmore_cli.domain.compared import Compared, Normaliser, SampleBlock
from mapmore_cli.domain.recording import DIRECTION, Curve, Dataset, uncertainty_of
from mapmore_cli.domain.results import ErrorBand, Forecast
from mapmore_cli.domain.scores import Score
from mapmore_cli.modelling.signals.rates import FALL, RISE

NORMALISERS: Mapping[str, tuple[str, Callable[[float, float], float]]] = {
    "max": ("max|{}| over {}", lambda low, high: max(-low, high)),
    "range": ("range of {} over {}", lambda low, high: high - low),
}
"""Normalisers by the names that specs use: `max |y|` (M2 eq 13), and `max y - min y` for quantities
with an arbitrary zero.
"""


def normaliser(kind: str, ends: tuple[float, float], quantity: str, split: str) -> Normaliser:
    """Return the number by which errors are divided. `kind` is a key of `NORMALISERS`, and `ends`
    are the smallest and the largest measured value of a split.
    """
    name, size = NORMALISERS[kind]
    return Normaliser(name.format(quantity, split), size(*ends), ends[1] - ends[0])


def information_criteria(n: int, rmse: float, parameters: int) -> tuple[float, float]:
    """Return AIC `n ln(SSE/n) + 2k` and BIC `n ln(SSE/n) + k ln n` of a fit to n samples by k
    parameters, with `SSE/n = rmse^2` (Akaike 1974; Schwarz 1978).

    Constants of the likelihood are left out, so that only models of the same samples can be
    compared. If the error is zero, both are minus infinity.
    """
    fit = 2 * n * math.log(rmse) if rmse > 0 else -math.inf
    return fit + 2 * parameters, fit + parameters * math.log(n)


EDGES = (0.0, 0.1, 0.25, 0.5, 1.0)
"""Edges of the bands, as shares of the largest absolute value of the compared samples. Bands of low
values are narrower.
"""


def judged(dataset: Dataset) -> list[BoolArray]:
    """Return the samples of each curve by which a model is judged: the held-out samples if there
    are any, otherwise the training samples.
    """
    held_out = any(curve.held_out.any() for curve in dataset.curves)
    return [curve.held_out if held_out else curve.training for curve in dataset.curves]


def bands(dataset: Dataset, predictions: Mapping[str, tuple[Array, ...]]) -> tuple[ErrorBand, ...]:
    """Return the RMSE of every model in each band of the measured value, over the samples by which
    models are judged (`judged`).

    `predictions` holds, for each model, the predictions of every curve of the dataset. A band
    without samples is left out.
    """
    masks = judged(dataset)
    curves = dataset.curves
    measured = [curve.columns[dataset.target] for curve in curves]
    largest = max(map(abs, ends_of(measured, masks)), default=0.0)
    edges, count = np.array(EDGES) * largest, len(EDGES) - 1
    samples = np.zeros(count, dtype=int)
    known = {model: np.zeros(count) for model in predictions}
    squares = {model: np.zeros(count) for model in predictions}
    for place, (y, mask) in enumerate(zip(measured, masks, strict=True)):
        predicted = {model: every[place] for model, every in predictions.items()}
        for of, wanted, *values in in_blocks(y, mask, *predicted.values()):
            inside = np.digitize(np.abs(of), edges[1:-1], right=True)
            samples += np.bincount(inside[wanted], minlength=count)
            for model, predicted_y in zip(predicted, values, strict=True):
                error = predicted_y - of
                rows = wanted & np.isfinite(error)
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


HELD = 1 << 20
"""Largest number of samples of a row of the score table that are kept in memory. If there are more,
they are read again, block by block, for each statistic.
"""

# name of each split, and whether its samples are held out
SPLITS = (
    ("train", False),
    ("validate", True),
)


def divisor(dataset: Dataset, kind: str) -> Normaliser:
    """Return the number by which all errors of a study are divided. It is computed from the
    held-out rows, as in the papers. If no rows are held out, it is computed from the training rows.
    """
    held_out = any(curve.held_out.any() for curve in dataset.curves)
    masks = [curve.held_out == held_out for curve in dataset.curves]
    ends = ends_of([curve.columns[dataset.target] for curve in dataset.curves], masks)
    return normaliser(kind, ends, dataset.target, "validate" if held_out else "train")


def ends_of(columns: Sequence[Array], masks: Sequence[BoolArray]) -> tuple[float, float]:
    """Return the smallest and the largest value of all columns together. `masks` selects the rows
    of each column that are used.
    """
    ends = [extremes(x, mask) for x, mask in zip(columns, masks, strict=True) if mask.any()]
    low, high = zip(*ends, strict=True)
    return min(low), max(high)


def on_common_rows(forecasts: Mapping[str, Sequence[Forecast]]) -> dict[str, tuple[Forecast, ...]]:
    """Return the forecasts of every model, restricted to the rows that all models predict.
    Otherwise, a model that needs earlier samples would be scored on fewer rows than other models.
    """
    common = [
        np.logical_and.reduce([forecast.ready for forecast in curve])
        for curve in zip(*forecasts.values(), strict=True)
    ]
    return {
        name: tuple(
            replace(forecast, ready=ready)
            for forecast, ready in zip(of_curves, common, strict=True)
        )
        for name, of_curves in forecasts.items()
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
    """Yield the rows of the score table for one model. `forecasts` holds its predictions of every
    curve. If `partial` is True, samples without a prediction are ignored.

    Each split has rows for all samples, for each curve, for each direction of a curve, and for each
    value of the quantity `group`. A row without a predicted sample is left out. `scale` is the
    number by which errors are divided (see `divisor`). `free` is the number of parameters that were
    fitted to all training samples.
    """
    for split, held in SPLITS:
        rows: dict[tuple[int, Any], tuple[str, list[ScoredSamples]]] = {}
        for number, (curve, forecast) in enumerate(zip(dataset.curves, forecasts, strict=True)):
            wanted = curve.held_out == held
            if not wanted.any():
                continue
            for place, name, samples in _rows_of(
                curve, wanted & forecast.ready if partial else wanted, number, group
            ):
                part = ScoredSamples(curve, dataset.target, forecast, samples)
                rows.setdefault(place, (name, []))[1].append(part)
        whole = [part for (kind, _), (_, parts) in rows.items() if kind == 0 for part in parts]
        for name, parts in [("all", whole), *(rows[place] for place in sorted(rows))]:
            row = row_of_samples(parts, scale, free if split == "train" and parts is whole else 0)
            if row.n:
                yield Score.of(model, target, split, name, row)


@dataclass(frozen=True)
class ScoredSamples:
    """Samples of one curve, with their measured and predicted values. Only the samples in the mask
    `wanted`, (n,), are used.
    """

    curve: Curve
    target: str
    forecast: Forecast
    wanted: BoolArray

    def blocks(self) -> Iterator[SampleBlock]:
        """Yield the samples as one `SampleBlock` after the other."""
        y = self.curve.columns[self.target]
        forecast = self.forecast
        sigma = self.curve.columns.get(uncertainty_of(self.target))
        columns = (y, forecast.values, forecast.one_step, forecast.half, sigma)
        for rows in row_blocks(self.curve.size):
            wanted = self.wanted[rows]
            if wanted.any():
                ready = wanted & forecast.ready[rows]
                none = np.full(np.count_nonzero(ready), np.nan)
                yield SampleBlock(
                    y[rows][wanted],
                    *(none if column is None else column[rows][ready] for column in columns),
                )
            if rows.stop % WIDE == 0:
                give_back(y)
                give_back(forecast.values)


def _rows_of(
    curve: Curve, wanted: BoolArray, number: int, group: str | None
) -> Iterator[tuple[tuple[int, Any], str, BoolArray]]:
    """Yield the rows of the score table to which the `wanted` samples of a curve, (n,), contribute.
    For each row, yield a sorting key (its position in the table), its name, and a mask of its
    samples.
    """
    yield (0, number), curve.id, wanted
    if DIRECTION in curve.columns:
        for place, (word, sign) in enumerate((("rise", RISE), ("fall", FALL))):
            moving = by_blocks(partial(np.equal, sign), curve.columns[DIRECTION])
            yield (1, (number, place)), f"{curve.id};direction={word}", wanted & moving
    if group is not None:
        values = curve.columns[group]
        parts = map(np.unique, blocks_where(values, wanted))
        for value in {value for part in parts for value in part.tolist()}:
            same = by_blocks(partial(np.equal, value), values)
            yield (2, value), f"{group}={value:g}", wanted & same


def row_of_samples(parts: Sequence[ScoredSamples], scale: Normaliser, free: int) -> Compared:
    """Return one row of the score table. Its samples are those of all `parts`, which may belong to
    several curves.
    """

    def blocks() -> Iterator[SampleBlock]:
        return chain.from_iterable(part.blocks() for part in parts)

    if sum(part.curve.size for part in parts) > HELD:
        return Compared(blocks, scale, free)
    held = [*blocks()]
    if held:
        held = [SampleBlock(*map(np.concatenate, zip(*held, strict=True)))]
    return Compared(lambda: held, scale, free)
