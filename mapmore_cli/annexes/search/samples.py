"""Choose the samples with which the structures of a search are compared, and pool them."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling.memory.records import begun
from mapmore_cli.modelling.pieces.cross_validation import BLOCKS
from mapmore_cli.modelling.signals.sampling import even_share

MOST_SAMPLES = 12_000
"""Largest number of training samples with which structures are compared. More are thinned evenly
along every curve; for models that use the past, long pieces of recordings are used instead.
"""

MOST_DELAYS = 4
"""Largest delay of the output in the candidates that feed it back. Every piece of a recording
begins with this number of known outputs.
"""

Folds = list[BoolArray]
"""Folds over all samples of a dataset, as a mask for each fold, (n,). The fold leaves out the
samples at which its mask is True.
"""


def searchable(dataset: Dataset) -> Dataset:
    """Return each recording from its first to its last training sample, without the held-out
    outputs.

    The inputs of held-out samples are kept, because slow states would otherwise restart after every
    held-out piece. Models with slow states would then look worse than they are.
    """
    curves = []
    for curve in dataset.curves:
        between = np.zeros(curve.size, dtype=bool)
        for log in curve.logs:
            rows = np.flatnonzero(curve.training[log])
            if len(rows):
                between[log[rows[0] : rows[-1] + 1]] = True
        output = np.where(curve.held_out, np.nan, curve.columns[dataset.target])
        if between.any():
            columns = {**curve.columns, dataset.target: output}
            curves.append(replace(curve, columns=columns).at(between))
    return replace(dataset, curves=tuple(curves))


def cut_short(dataset: Dataset, run: int, step: float | None) -> Dataset:
    """Return at most about `MOST_SAMPLES` samples. If `step` is None, these are training samples,
    evenly spread along every curve.

    Otherwise, `step` is the equal time step of the recordings (s), and uninterrupted pieces of the
    recordings are returned. If possible, no piece is shorter than `run`, the length of a held-out
    run in samples. A model that feeds its output back starts each piece with known outputs, so its
    errors on shorter pieces would be too small.
    """
    if step is None:
        return thinned(dataset, every=False)
    share = min(MOST_SAMPLES / sum(curve.size for curve in dataset.curves), 1.0)
    short = []
    for curve in dataset.curves:
        kept = [
            piece[: math.ceil(share * len(piece))]
            for log in curve.logs
            for piece in np.array_split(log, np.clip(share * len(log) // max(run, 1), 1, BLOCKS))
        ]
        short.append(begun(curve.at(np.sort(np.concatenate(kept))), MOST_DELAYS, step))
    return replace(dataset, curves=tuple(short))


def thinned(dataset: Dataset, *, every: bool) -> Dataset:
    """Return at most `MOST_SAMPLES` training samples, evenly spread along every curve. If `every`
    is True, held-out samples are included.
    """
    most = max(MOST_SAMPLES // len(dataset.curves), 1)
    short = [
        curve.at(even_share(np.flatnonzero(curve.training | every), most))
        for curve in dataset.curves
    ]
    return replace(dataset, curves=tuple(short))


@dataclass(frozen=True, kw_only=True)
class Samples(Curve):
    """The samples of all curves of a dataset as one curve: the samples of the first curve, then
    the samples of the second curve, and so on. A recording of this curve is a log at one level. If
    a log was cut into pieces, all its pieces at this level belong to the same recording.

    - `curve`: number of the curve that each sample comes from, (n,).
    - `levels`: level of this curve, (n,); NaN without levels.
    """

    curve: IntArray
    levels: Array

    @property
    def curves(self) -> tuple[IntArray, ...]:
        """For each curve of the dataset, the row numbers of its samples."""
        return replace(self, origin=self.curve).logs


def pooled_samples(dataset: Dataset) -> Samples:
    """Return the samples of all curves as one curve."""
    curves, log_of, logs = dataset.curves, dataset.logs, list[IntArray]()
    number_of = defaultdict[tuple[float | None, str], int](count().__next__)
    for each in curves:
        own = np.array([number_of[each.level, log_of.get(name, name)] for name in each.recordings])
        logs.append(np.full(each.size, own[0 if each.origin is None else each.origin]))
    curve = np.repeat(np.arange(len(curves)), [each.size for each in curves])
    return Samples(
        "",
        None,
        {
            name: np.concatenate([each.columns[name] for each in curves])
            for name in curves[0].columns
        },
        np.concatenate([each.held_out for each in curves]),
        (),
        np.concatenate([~each.training for each in curves]),
        np.concatenate(logs),
        curve=curve,
        levels=np.array([each.level for each in curves], dtype=float)[curve],
    )
