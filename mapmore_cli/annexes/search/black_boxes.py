"""Provide the benchmark of a search: the errors of black boxes, which know nothing about muscles,
on the same samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

from mapmore_cli.annexes.search.samples import Folds, pooled_samples
from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.domain.arrays import Array
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
"""Name of the family of black boxes in the table of structures."""

SHOWN = (BLACK_BOX, "papers")
"""Kinds that are shown in the table but never chosen."""

Outcome = tuple[Tried, Sequence[Array]]
"""A structure with its errors on the left-out samples of every fold, (n,) each; NaN for a sample
that the structure does not predict.
"""


def black_boxes(dataset: Dataset, folds: Folds, situation: Situation) -> list[Outcome]:
    """Return each black box with its errors on the left-out samples of every fold: a Gaussian
    process for tables and, if scikit-learn is installed, gradient boosting.

    The Gaussian process is the one that `plan` uses, because loading scikit-learn takes longer than
    fitting all structures of a small table. If samples are in the order of time, boosting also gets
    delayed inputs, because structures may use the past or the direction of motion. Each black box
    learns from at most half as many samples as it would as a competitor of a run.
    """
    inputs, samples = situation.inputs, pooled_samples(dataset)
    known, y = samples.training, samples.columns[dataset.target]
    learners = dict[str, tuple[Callable[..., Any], Sequence[int]]]()
    if not situation.timed and 0 < len(inputs) <= MOST_INPUTS:
        learners["gaussian_process"] = smooth, (0,)
    if inputs and known.sum() >= FEWEST and find_spec("sklearn") is not None:
        # a neural network is not fitted, because this takes as long as the rest of the search
        delays = DELAYS if situation.timed or situation.ordered else (0,)
        learners["gradient_boosting"] = partial(learned, "gradient_boosting"), delays
    outcomes = list[Outcome]()
    for name, (learner, back) in learners.items():
        x, left = features(samples, inputs, back), list[Array]()
        for out in folds:
            learnt = even_share(np.flatnonzero(known & ~out), LEARNERS[name].most_samples // 2)
            left.append(learner(x[learnt], y[learnt])(x[out]) - y[out])
        outcomes.append((Tried(BLACK_BOX, name.replace("_", " "), {}), left))
    return outcomes


def smooth(x: Array, y: Array) -> Callable[[Array], Array]:
    """Fit a Gaussian process to inputs, (n, d), of any range and outputs, (n,). Return a function
    that predicts outputs, (m,), from inputs, (m, d).
    """
    from mapmore_cli.modelling.validation.gaussian_process import most_likely

    low, middle = x.min(axis=0), y.mean()
    width = np.where(np.ptp(x, axis=0) > 0, np.ptp(x, axis=0), 1.0)
    process = most_likely((x - low) / width, y - middle)
    return lambda at: process.predict((at - low) / width)[0] + middle
