"""Make the folds of a search that leave out whole parts of the training data: levels, recordings,
ends of recordings, and ends of an input.

The folds leave out the same kinds of parts as the study holds out, in the same proportion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from mapmore_cli.annexes.search.samples import Folds, Samples
from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.sampling import even_share

BEHIND = (0.2, 0.35, 0.5)
"""Fractions of every recording, at its end, that folds leave out if the study holds out ends of
recordings. The models must then predict drift.
"""

MOST_PARTS = 6
"""Largest number of levels or recordings that are left out. If there are more, only an evenly
spread part of them is left out.
"""

FAIR = (0.2, 1.2)
"""Limits of the number of samples of a recording that is left out, as multiples of a mean number.
If a larger recording is left out, too few samples remain for training; the errors on a smaller
recording say little. The mean is taken over samples: each training sample gives the size of its
recording. A mean over recordings would be dominated by fragments.
"""

SOME, WIDEST = 1 / 4, 1 / 3
"""`SOME`: a study holds out a kind of part if at least this fraction of its held-out samples is of
this kind. `WIDEST`: largest fraction of the range of an input that a fold leaves out at an end.
"""

ASKED, OTHERWISE, ALONE = 2 / 3, (1 / 4, 1 / 2), 1 / 2
"""Weights of the folds that leave out whole levels or recordings, all together.

- `ASKED`: weight if the study holds out only such parts.
- `OTHERWISE`: weights if the study holds out no such part, for tables and for recordings in time.
- `ALONE`: weight if there is only one such fold.

The folds that leave out stretches share the rest of the weight.
"""


class Parts(NamedTuple):
    """One kind of parts of the data, for example recordings.

    - `words`: description of the parts.
    - `folds`: masks, (n,) each; each fold leaves out one part.
    - `share`: fraction of the held-out samples of the study that belong to parts of this kind.
    - `weight`: weight of all these folds together.
    """

    words: str
    folds: Folds
    share: float
    weight: float


def parts_of(samples: Samples, situation: Situation, every: Samples, by_level: bool) -> list[Parts]:
    """Return the folds of every kind of part that has a weight. The folds leave out some of the
    `samples`; `every` holds all samples of the study.

    Each held-out sample of the study belongs to the first kind in this list that it fits, or to a
    stretch if it fits none:

    - an end of an input: the sample lies at outermost levels, or in a table beyond the training
      range;
    - the end of a recording: it comes after all training samples of its recording;
    - a level or a recording: its curve is held out as a whole.

    The weight of the folds at ends of an input is the fraction of the held-out samples at such
    ends, because no other folds can predict the error beyond the range. With `by_level`, the study
    leaves out every level in turn.
    """
    whole = ~np.isin(every.curve, every.curve[~every.held_out])
    standing = _standing(samples, situation, every, whole)
    words, folds, end_folds, at_end = "recordings", _fair(samples), Folds(), whole
    if standing is not None:
        words, (folds, end_folds, at_end) = "levels", _neighbours(*standing, whole)
    folds, end_folds = (_taught(each, samples, situation.inputs) for each in (folds, end_folds))
    end_words = "groups of outermost levels"
    if not end_folds:
        end_words = "ends of an input, as the study holds one out"
        end_folds, at_end = _beyond(samples, situation, every)
    behind, whole = (_remaining(every) == 0) & ("time" in every.columns), whole | by_level
    if situation.timed and standing is None and len(samples.logs) == 1:
        # a single training recording cannot be left out as a whole, so its end is left out instead
        behind |= whole
    ends, drift, parts, rest = _shares([at_end, behind, whole], every.held_out | by_level)
    asked, other = (ALONE, ALONE) if len(folds) == 1 else (ASKED, OTHERWISE[situation.timed])
    remaining = _remaining(samples)
    last = [samples.training & (remaining <= share) for share in BEHIND]
    kinds = (
        Parts(end_words, end_folds, ends, ends),
        Parts("ends of recordings", [fold for fold in last if fold.any()], drift, ASKED * drift),
        Parts(words, folds, parts, asked * parts + other * rest),
    )
    return [kind for kind in kinds if kind.weight and kind.folds]


def _shares(kinds: Folds, held: BoolArray) -> list[float]:
    """Return the fraction of the held-out samples that belong to each kind, followed by the
    fraction that belong to none. A sample that fits several kinds belongs to the first of them. A
    fraction below `SOME` is set to zero; the others are then scaled so that their sum is one.
    """
    first = np.argmax([*kinds, np.ones_like(held)], axis=0)[held]
    counts = np.bincount(first, minlength=len(kinds) + 1)
    counts[-1] += not len(first)
    counts *= counts >= SOME * counts.sum()
    return list(counts / counts.sum())


def _taught(folds: Folds, samples: Curve, inputs: Sequence[str]) -> Folds:
    """Return at most `MOST_PARTS` of the folds, restricted to training samples. A fold is used only
    if every input still varies in the samples that remain, because nothing can be learnt about a
    constant input.
    """
    columns = np.array([samples.columns[name] for name in inputs], np.float32)
    taught = [
        fold & samples.training
        for fold in folds
        if np.all(np.ptp(columns[:, samples.training & ~fold], axis=1) > 0)
    ]
    return [*even_share(np.array(taught), MOST_PARTS)]


def _remaining(samples: Curve) -> Array:
    """Return, for each sample, the fraction of the training samples of its recording that come at
    this sample or later, (n,). If the recording has no training samples, the fraction is 1.
    """
    remaining = np.ones(samples.size)
    for log in samples.logs:
        counts = np.cumsum(samples.training[log][::-1])[::-1]
        if counts[0]:
            remaining[log] = counts / counts[0]
    return remaining


def _standing(
    samples: Samples, situation: Situation, every: Samples, whole: BoolArray
) -> tuple[Any, Any] | None:
    """Return the values of the quantity that distinguishes the curves that are held out as a whole
    (`whole`), at the training samples and at all samples of the study: the levels if there are
    levels; otherwise an input that is constant in every curve and whose values in these curves
    occur in no other curve. Return None if there is no such quantity.

    The inputs have single precision, so that values that differ only by rounding errors are equal.
    """
    if situation.level is not None:
        return samples.levels, every.levels
    for name in situation.inputs if whole.any() else ():
        at, values = (of.columns[name].astype(np.float32) for of in (samples, every))
        still = all(np.ptp(values[rows]) == 0 for rows in every.curves)
        if still and not np.isin(values[whole], values[~whole]).any():
            return at, values
    return None


def _neighbours(at: Array, every: Array, whole: BoolArray) -> tuple[Folds, Folds, BoolArray]:
    """Return inner folds, end folds, and a mask of the samples of the study that lie beyond all
    training values, (m,).

    - An inner fold, (n,), leaves out neighbouring values inside the range: as many as the study
      holds out between two training values, or a single value if the study holds out none there.
    - An end fold, (n,), leaves out values at an end of the range at which the study holds out
      values, and as many as the study. A second fold at this end leaves out one value more, because
      a choice by a single fold is uncertain. At least two values remain.

    `at`, (n,), and `every`, (m,), hold the values at the training samples and at the samples of the
    study. `whole`, (m,), is True for samples of curves that are held out as a whole.
    """
    values, known = np.unique(every), np.unique(every[~whole])
    trained, place = np.unique(at, return_inverse=True)
    most = len(trained) - 2
    if most < 1:
        return [], [], whole
    longest = np.diff(np.searchsorted(values, known)).max() - 1
    count = int(np.clip(longest, 1, most))
    inner = [(first <= place) & (place < first + count) for first in range(1, most + 2 - count)]
    sides = (place, np.sum(values < known[0])), (place.max() - place, np.sum(values > known[-1]))
    ends = [
        side < count
        for side, held in sides
        if held
        for count in range(min(held, most), min(held + 1, most) + 1)
    ]
    return inner, ends, (every < known[0]) | (every > known[-1])


def _beyond(samples: Samples, situation: Situation, every: Samples) -> tuple[Folds, BoolArray]:
    """Return folds, (n,), that leave out an end of the range of an input, and a mask of the samples
    of the study beyond these ends, (m,). An end is left out if the study holds out samples beyond
    it; the fold is as wide as the part that the study holds out there, but at most the fraction
    `WIDEST` of the range.

    First, the range is that of all training samples together. If too few held-out samples lie
    outside it, each curve has its own range. No fold is returned if too few lie outside these
    ranges either, or if samples are in the order of time.
    """
    held, folds = every.held_out, Folds()
    beyond = np.zeros_like(held)
    for of_each in () if situation.timed else (False, True):
        for name in () if folds else situation.inputs:
            x, inside = samples.columns[name], _from_ends(samples, name, of_each)
            for far, over in zip(_from_ends(every, name, of_each), inside, strict=True):
                reach = np.minimum(np.max(far[held], initial=0.0), -WIDEST * inside.sum(axis=0))
                fold = (over >= -reach) & (reach > 0)
                is_held = fold.any() and np.sum(far[held] > 0) >= SOME * held.sum()
                # at least half of the range remains, so that an input with two values keeps both
                if is_held and 2 * np.ptp(x[~fold]) >= np.ptp(x):
                    folds.append(fold)
                    beyond |= far > 0
    return folds, beyond


def _from_ends(samples: Samples, name: str, of_each: bool) -> Array:
    """Return how far each sample lies below the lower end of the training range, and how far above
    the upper end, (2, n). The distances are negative inside the range, so that the sum of both is
    always the negative width of the range.

    With `of_each`, each curve has its own range, which is unlimited for a curve without training
    samples. Otherwise, all curves together have one range.
    """
    x = samples.columns[name]
    distances = np.full((2, samples.size), -np.inf)
    for rows in samples.curves if of_each else (slice(None),):
        trained = x[rows][samples.training[rows]]
        if trained.size:
            distances[:, rows] = trained.min() - x[rows], x[rows] - trained.max()
    return distances


def _fair(samples: Curve) -> Folds:
    """Return folds, (n,), that leave out one log each. Only logs with a number of training samples
    within the limits `FAIR` are left out. Return an empty list if there are fewer than two such
    logs.
    """
    logs = samples.origin
    assert logs is not None
    sizes = np.bincount(logs, samples.training)
    low, high = np.array(FAIR) * (sizes @ sizes) / sizes.sum()
    fair = np.flatnonzero((low <= sizes) & (sizes <= high))
    return [logs == number for number in fair] if len(fair) > 1 else []
