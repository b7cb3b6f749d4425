"""Provide the benchmark of a search: the errors of black boxes, which know nothing about muscles,
on the same samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

from mapmore_cli.annexes.search.samples import pooled_samples
from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import Tried
from mapmore_cli.fitting.baselines import DELAYS, features, learned
from mapmore_cli.modelling.learners import LEARNERS
from mapmore_cli.modelling.signals.sampling import even_share

FEWEST = 100
"""Smallest number of training samples for which decision trees are fitted in folds: with fewer, a
tree has a step for every few samples, which says nothing about a smooth surface.
"""

MOST_INPUTS = 4
"""Largest number of inputs for which a Gaussian process is fitted; with more, it takes long."""

BLACK_BOX = "black box"
"""Kind of these models in the table."""

SHOWN = (BLACK_BOX, "papers")
"""Kinds that are shown in the table but never chosen."""

Left = tuple[Array, BoolArray]
"""Errors of a structure on the left-out samples of a fold, (n,), and a mask of the samples that it
predicts.
"""

Outcome = tuple[Tried, Sequence[Left]]
"""A structure with its left-out errors in every fold."""


def black_boxes(
    dataset: Dataset, folds: Sequence[BoolArray], situation: Situation
) -> list[Outcome]:
    """Return each black box with its errors on the left-out samples of every fold; without
    scikit-learn, only the Gaussian process.

    If samples are in the order of time, boosting also gets delayed inputs, because structures may
    use the past or the direction of motion. The Gaussian process is that of `plan`, because loading
    scikit-learn takes longer than fitting all structures of a small table; it is fitted to tables
    only. Each black box learns from at most half of the samples that it may have as a competitor.
    """
    inputs = situation.inputs
    if not inputs:
        return []
    samples = pooled_samples(dataset)
    known, y = samples.training, samples.columns[dataset.target]
    learners = list[tuple[str, Callable[..., Any], Sequence[int]]]()
    if not situation.timed and len(inputs) <= MOST_INPUTS:
        learners.append(("gaussian_process", smooth, (0,)))
    if known.sum() >= FEWEST and find_spec("sklearn") is not None:
        # a neural network is not fitted, because this takes as long as the rest of the search
        delays = DELAYS if situation.timed or situation.ordered else (0,)
        learners.append(("gradient_boosting", partial(learned, "gradient_boosting"), delays))
    outcomes = list[Outcome]()
    for name, learner, back in learners:
        x = features(samples, inputs, back)
        left = list[Left]()
        for out in folds:
            learnt = even_share(np.flatnonzero(known & ~out), LEARNERS[name].most_samples // 2)
            missed = learner(x[learnt], y[learnt])(x[out]) - y[out]
            left.append((missed, np.isfinite(missed)))
        outcomes.append((Tried(BLACK_BOX, name.replace("_", " "), {}), left))
    return outcomes


def smooth(x: Array, y: Array) -> Callable[[Array], Array]:
    """Fit a process to inputs, (n, d), of any range and outputs, (n,); return a function that
    predicts (m,) from (m, d).
    """
    from mapmore_cli.modelling.validation.gaussian_process import most_likely

    low, middle = x.min(axis=0), y.mean()
    width = np.where(np.ptp(x, axis=0) > 0, np.ptp(x, axis=0), 1.0)
    process = most_likely((x - low) / width, y - middle)
    return lambda at: process.predict((at - low) / width)[0] + middle
