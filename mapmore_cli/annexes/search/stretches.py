"""Make the folds of a search that leave out stretches of curves. The stretches are as long as those
that the study holds out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from mapmore_cli.annexes.search.samples import ends_of, pooled_samples
from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.domain.arrays import BoolArray, IntArray
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.fitting.refitting import contiguous
from mapmore_cli.modelling.pieces.cross_validation import BLOCKS
from mapmore_cli.study.sections.split import Between, Holdout

LONGEST_FOLD = 1 / 3
"""Largest fraction of a recording that a fold leaves out, even if the study holds out longer runs
of samples.
"""


def stretches(
    dataset: Dataset, situation: Situation, held_out: Holdout | None, run: int
) -> tuple[str, list[BoolArray]]:
    """Return a description of the folds, and their masks. Each fold leaves out a part of every
    curve.

    For recordings at equal steps, the parts are stretches of time as long as the held-out run.
    Otherwise, the parts are bands of an input as wide as the held-out bands or, without such bands,
    stretches along each input. (If models do not depend on earlier samples, leaving out stretches
    of time would not test interpolation.) The ends of an input's range are not left out: a model
    could only extrapolate there, and its large errors would dominate the comparison.
    """
    samples = pooled_samples(dataset)
    training = samples.training
    if situation.timed:
        words = f"each of {BLOCKS} stretches of the training samples of every recording"
        return words, _windows([log[training[log]] for log in samples.logs], samples.size, run)
    bands = _bands(samples, {} if held_out is None else held_out.quantities, situation.moving)
    if bands:
        return f"each of {len(bands)} bands of an input, as wide as those held out", bands
    folds: list[BoolArray] = []
    for name in situation.moving:
        x, inner = samples.columns[name], list[IntArray]()
        for rows in np.split(np.arange(samples.size), ends_of(dataset)):
            if np.ptp(x[rows]) > 0:
                rows = rows[np.argsort(x[rows], kind="stable")]
                rows = rows[training[rows]]
                end = math.ceil(len(rows) / (BLOCKS + 2))
                inner.append(rows[end : len(rows) - end])
        folds += contiguous(inner, BLOCKS, len(x)) if inner else []
    words = f"each of {BLOCKS} inner stretches of the training samples of every curve"
    return words, folds


def _windows(logs: Sequence[IntArray], size: int, run: int) -> list[BoolArray]:
    """Return the masks of `BLOCKS` folds, (size,) each. In each recording, a fold leaves out
    stretches of about `run` samples: up to `BLOCKS` stretches if they are short, or a single
    stretch if it is long. Long stretches of different folds may overlap.
    """
    masks = np.zeros((BLOCKS, size), dtype=np.bool_)
    for rows in logs:
        times = int(np.clip(len(rows) / (BLOCKS * max(run, 1)), 1, BLOCKS))
        share = max(1 / (BLOCKS * times), min(run / max(len(rows), 1), LONGEST_FOLD))
        first = np.linspace(0, (1 - share) * len(rows), BLOCKS * times)
        ends = np.rint([first, first + share * len(rows)]).astype(int)
        for number, (start, stop) in enumerate(ends.T):
            masks[number % BLOCKS, rows[start:stop]] = True
    return list(masks)


def held_run(study: Dataset) -> int:
    """Return the typical length of a run of consecutive held-out samples: half of the held-out
    samples belong to runs that are at least as long.
    """
    samples = pooled_samples(study)
    out = [0]
    for log in samples.logs:
        out += [*samples.held_out[log], 0]
    edges = np.flatnonzero(np.diff(out))
    runs = np.sort(edges[1::2] - edges[::2])
    return int(runs[np.searchsorted(np.cumsum(runs), runs.sum() / 2)]) if len(runs) else 0


def _bands(
    samples: Curve, held_out: Mapping[str, object], inputs: Sequence[str]
) -> list[BoolArray]:
    """Return folds that leave out bands of an input, as wide as the bands that the study holds out.
    The bands lie around evenly spaced quantiles of the training data.

    Bands are used because a block in the order of time would not test interpolation: if an input
    was swept more than once, its values in the block also occur outside the block.
    """
    folds: list[BoolArray] = []
    for name, held in held_out.items():
        if name in inputs and isinstance(held, Between):
            low, high = np.array(held.between).T
            values = samples.columns[name]
            least, *middles, largest = np.quantile(
                values[samples.training], np.linspace(0, 1, BLOCKS + 2)
            )
            if ((low > least) & (high < largest)).any():
                apart = [np.abs(values - middle) for middle in middles]
                folds += [samples.training & (x <= np.median(high - low) / 2) for x in apart]
    return folds
