"""Choose the samples with which the structures of a search are compared, and pool them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import IntArray
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


def searchable(dataset: Dataset) -> Dataset:
    """Return each recording from its first to its last training sample, without the held-out
    outputs.

    The inputs of held-out samples are kept, because slow states would otherwise restart after every
    held-out piece. Models with slow states would then look worse than they are.
    """
    curves = []
    for curve in dataset.curves:
        between = np.zeros(curve.size, dtype=np.bool_)
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
    """Return at most about `MOST_SAMPLES` samples. If `step` is None, every curve is thinned
    evenly.

    Otherwise, `step` is the equal time step of the recordings (s), and uninterrupted pieces of the
    recordings are returned. If possible, no piece is shorter than `run`, the length of a held-out
    run in samples. A model that feeds its output back starts each piece with known outputs, so its
    errors on shorter pieces would be too small.
    """
    if step is None:
        training = tuple(curve.at(curve.training) for curve in dataset.curves)
        return thinned(replace(dataset, curves=training))
    share = min(MOST_SAMPLES / sum(curve.size for curve in dataset.curves), 1.0)
    short = []
    for curve in dataset.curves:
        kept = list[IntArray]()
        for log in curve.logs:
            count = int(np.clip(share * len(log) // max(run, 1), 1, BLOCKS))
            kept += [part[: math.ceil(share * len(part))] for part in np.array_split(log, count)]
        short.append(begun(curve.at(np.sort(np.concatenate(kept))), MOST_DELAYS, step))
    return replace(dataset, curves=tuple(short))


def thinned(dataset: Dataset) -> Dataset:
    """Return at most `MOST_SAMPLES` samples, evenly spread along every curve."""
    most = max(MOST_SAMPLES // len(dataset.curves), 1)
    short = [curve.at(even_share(np.arange(curve.size), most)) for curve in dataset.curves]
    return replace(dataset, curves=tuple(short))


def pooled_samples(dataset: Dataset) -> Curve:
    """Return the samples of all curves as one curve. A recording of this curve is a log at one
    level. If a log was cut into pieces, all its pieces at this level belong to the same recording.
    """
    curves, log_of, numbers = dataset.curves, dataset.logs, dict[tuple[float | None, str], int]()
    logs = list[IntArray]()
    for curve in curves:
        keys = [(curve.level, log_of.get(name, name)) for name in curve.recordings]
        own = np.array([numbers.setdefault(key, len(numbers)) for key in keys])
        logs.append(np.broadcast_to(own[0 if curve.origin is None else curve.origin], curve.size))
    return Curve(
        "",
        None,
        {name: np.concatenate([c.columns[name] for c in curves]) for name in curves[0].columns},
        np.concatenate([curve.held_out for curve in curves]),
        (),
        np.concatenate([~curve.training for curve in curves]),
        np.concatenate(logs),
    )


def ends_of(dataset: Dataset) -> IntArray:
    """Return the number of samples of the first curve, of the first two curves, and so on, without
    the last sum. An array over all samples is split into curves at these indices.
    """
    return np.cumsum([curve.size for curve in dataset.curves])[:-1]
