"""The score table of one model: each split pooled, curve by curve, and rise and fall by themselves where directions are told apart."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.recording import DIRECTION, Curve, Dataset
from mapmore_cli.domain.results import Forecast
from mapmore_cli.domain.scores import Score
from mapmore_cli.modelling.scores.metrics import NORMALISERS, Normaliser, score
from mapmore_cli.modelling.signals.rates import FALL, RISE

SPLITS = (("train", False), ("validate", True))
"""Names of the splits, and whether their samples are held out."""


@dataclass(frozen=True)
class _Part:
    """Samples of a curve, as measured and as a model says, (n,) each."""

    curve: str
    measured: Array
    predicted: Array
    ready: BoolArray
    one_step: Array | None
    half: Array | None

    def score(self, model: str, target: str, split: str, scale: Normaliser) -> Score:
        """The row of these samples."""
        return score(
            model, target, split, self.curve, self.measured, self.predicted, scale, ready=self.ready, one_step=self.one_step, half=self.half
        )


def divisor(dataset: Dataset, normaliser: str) -> Normaliser:
    """What all errors of a study are divided by: a measure of the validation rows, as in the papers; of the training rows without these.

    `normaliser` is one of `metrics.NORMALISERS`.
    """
    held_out = any(curve.held_out.any() for curve in dataset.curves)
    measured = np.concatenate([curve.columns[dataset.target][curve.held_out == held_out] for curve in dataset.curves])
    return NORMALISERS[normaliser](measured, dataset.target, "validate" if held_out else "train")


def on_common_rows(forecasts: Mapping[str, Sequence[Forecast]]) -> dict[str, tuple[Forecast, ...]]:
    """The forecasts of every model on the rows that all of them predict: models that need a history would else be scored on fewer rows."""
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
        masks = [curve.held_out == held_out for curve, _ in every]
        counted = [mask & found.ready if partial else mask for mask, (_, found) in zip(masks, every, strict=True)]
        parts, ways = [], []
        for (curve, found), mask in zip(every, counted, strict=True):
            parts += _parts(curve.id, dataset.target, curve, found, mask)
            for word, sign in (("rise", RISE), ("fall", FALL)):
                if DIRECTION in curve.columns:
                    name = f"{curve.id};direction={word}"
                    ways += _parts(name, dataset.target, curve, found, mask & (curve.columns[DIRECTION] == sign))
        if not parts:
            continue
        yield _pooled(parts).score(model, target, split, scale)
        for part in (*parts, *ways, *(_of_groups(group, dataset.target, every, counted) if group is not None else ())):
            yield part.score(model, target, split, scale)


def _of_groups(of: str, target: str, every: Sequence[tuple[Curve, Forecast]], masks: Sequence[BoolArray]) -> Iterator[_Part]:
    """The samples of each group, of all curves together."""
    for value in np.unique(np.concatenate([curve.columns[of][mask] for (curve, _), mask in zip(every, masks, strict=True)])):
        chosen = [(curve, found, mask & (curve.columns[of] == value)) for (curve, found), mask in zip(every, masks, strict=True)]
        found = [part for curve, said, mask in chosen for part in _parts("", target, curve, said, mask)]
        if found:
            yield replace(_pooled(found), curve=f"{of}={value:g}")


def _parts(name: str, target: str, curve: Curve, found: Forecast, mask: BoolArray) -> list[_Part]:
    """The samples of a mask; nothing where none of them could be predicted."""
    if not (mask & found.ready).any():
        return []
    one_step = None if found.one_step is None else found.one_step[mask]
    half = None if found.half is None else found.half[mask]
    return [_Part(name, curve.columns[target][mask], found.values[mask], found.ready[mask], one_step, half)]


def _pooled(parts: Sequence[_Part]) -> _Part:
    one_steps = [part.one_step for part in parts if part.one_step is not None]
    halves = [part.half for part in parts if part.half is not None]
    return _Part(
        "all",
        np.concatenate([part.measured for part in parts]),
        np.concatenate([part.predicted for part in parts]),
        np.concatenate([part.ready for part in parts]),
        np.concatenate(one_steps) if len(one_steps) == len(parts) else None,
        np.concatenate(halves) if len(halves) == len(parts) else None,
    )
