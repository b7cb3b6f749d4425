"""Prepare the data with which all structures of a search are compared: training samples, and the
folds that are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from mapmore_cli.annexes.search.samples import MOST_SAMPLES, cut_short, ends_of, pooled_samples
from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.annexes.search.stretches import held_run, stretches
from mapmore_cli.domain.arrays import Array, BoolArray, extremes
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.pieces.recipe import Fuse
from mapmore_cli.modelling.signals.sampling import even_share
from mapmore_cli.modelling.simple import polynomial_fit
from mapmore_cli.study.sections.data import Levels
from mapmore_cli.study.sections.model import ModelChoice
from mapmore_cli.study.sections.split import Holdout

BEHIND = (0.2, 0.35, 0.5)
"""Shares of every recording, at its end, that the folds leave out if the study holds out ends of
recordings, so that drift must be predicted.
"""

MOST_PARTS = 6
"""Largest number of levels or recordings that are left out. If there are more, only an evenly
spread part of them is left out.
"""

FAIR = (0.2, 1.2)
"""Limits of the size of a recording that is left out, relative to the mean size of the recording in
which a training sample lies. If a larger recording is left out, too few samples remain for
training; the errors on a smaller one say little. (A mean over recordings, instead of over samples,
would be dominated by fragments.)
"""


@dataclass(frozen=True)
class Slice:
    """Part of a study on which the result of a search depends."""

    levels: Levels | None
    model: ModelChoice
    fuse: Fuse
    lengths: Mapping[str, float | None]
    held_out: Holdout | None
    ignored: tuple[str, ...]
    by_level: bool

    def in_order(self, dataset: Dataset) -> bool:
        """Return True if a model of the study may run along its recordings: held-out samples are
        not drawn at random, no level is left out, and `cycles` have not changed the order of the
        samples.
        """
        drawn = self.held_out is not None and self.held_out.fraction is not None
        known = dataset.quantities
        return "time" in known and "hysteresis" not in known and not (drawn or self.by_level)


@dataclass(frozen=True)
class Bench:
    """Data with which all structures are compared: training samples, and the folds that are left
    out.

    Each fold, (n,), covers all samples, curve after curve. The first `blocks` folds leave out
    stretches of curves, the others whole levels, recordings or their ends. Their `weights`, (f,),
    count relative to each other. If the study holds out an end (`ends`), only folds that leave out
    an end have a weight. The `study` holds evenly thinned samples, including held-out ones, whose
    outputs are not used.
    """

    dataset: Dataset
    study: Dataset
    situation: Situation
    folds: tuple[BoolArray, ...]
    blocks: int
    weights: Array
    left_out: str
    parts_left_out: str
    part: Slice
    asks_parts: bool
    ends: bool

    @classmethod
    def of(cls, training: Dataset, situation: Situation, part: Slice, study: Dataset) -> Bench:
        """Return folds of training samples that resemble the held-out data of the `study`; long
        recordings are shortened first. Raises DataError if no sample can be left out.
        """
        run = held_run(study)
        training = cut_short(training, run, situation.step)
        left_out, blocks = stretches(training, situation, part.held_out, run)
        name, parts, asked, ends = _parts(training, situation, study)
        if beyond := [] if ends else _beyond(training, situation, study):
            name, parts, ends = "ends of an input, as the study holds one out", beyond, True
        blocks, parts = ([fold for fold in some if fold.any()] for some in (blocks, parts))
        asked = bool(parts) and (asked or part.by_level or ends)
        if not blocks and not parts:
            raise DataError(
                "`model: {type: auto}` leaves out training samples, and there are too few of them",
                "loosen `data.keep`, hold out less, or add recordings",
            )
        weight = 2 / 3 if asked else 1 / 2 if situation.timed else 1 / 4
        if len(parts) == 1:  # there is only one inner level
            weight = 1 / 2
        if ends:  # errors at other levels, between training levels, say nothing about extrapolation
            weight = 1.0
        counts = [len(blocks), len(parts)]
        weights = np.repeat(np.array([1 - weight, weight]) / np.maximum(counts, 1), counts)
        most = max(MOST_SAMPLES // len(study.curves), 1)
        shown = [curve.at(even_share(np.arange(curve.size), most)) for curve in study.curves]
        return cls(
            training,
            replace(study, curves=tuple(shown)),
            situation,
            (*blocks, *parts),
            len(blocks),
            weights,
            left_out,
            f"each of {len(parts)} {name}" if parts else "",
            part,
            asked,
            ends,
        )

    @property
    def masks(self) -> list[list[BoolArray]]:
        """Masks of the samples that each fold leaves out, one for every curve."""
        return [np.split(fold, ends_of(self.dataset)) for fold in self.folds]

    @cached_property
    def range(self) -> tuple[float, float]:
        """Smallest and largest output that a model may reasonably predict: over the measured
        training data, and over the predictions of a plane at all inputs of the study. The plane is
        included because inputs outside the training data can have outputs outside their range.
        """
        target = self.study.target
        plane = polynomial_fit(1, self.study, self.situation.inputs)
        measured = pooled_training(self.study.curves)[target]
        return extremes(np.concatenate([measured, *(plane.of_curves(self.study) if plane else ())]))


def _parts(
    dataset: Dataset, situation: Situation, study: Dataset
) -> tuple[str, list[BoolArray], bool, bool]:
    """Return folds that leave out whole recordings, ends of recordings, or all curves at a level: a
    description and the masks. The third result is True if most held-out samples of the study belong
    to curves that are held out as a whole. The fourth result is True if the folds leave out
    outermost levels, because the study holds out such a level.

    Ends of recordings are left out if most held-out samples of the study come after training
    samples of the same recording, or if the study holds out whole recordings and only one recording
    is left for training. Otherwise, all curves at a level are left out, or recordings if there are
    no levels. A fold is used only if every input varies in the samples that remain, because nothing
    can be learnt about a constant input.
    """
    samples, every = pooled_samples(dataset), pooled_samples(study)
    behind = [np.argmax(every.training[log][::-1]) for log in every.logs]
    trains = [every.training[log].any() for log in every.logs]
    held = every.held_out.sum()
    last = "time" in every.columns and 2 * np.dot(behind, trains) > held
    whole = np.array([curve.held_out.all() for curve in study.curves])
    asked = bool(2 * sum(curve.size for curve in study.curves if curve.held_out.all()) > held)
    of = _standing(situation.inputs, study, whole)
    if last or (situation.timed and of is None and asked and len(samples.logs) == 1):
        return "ends of recordings", _ends(samples), True, False
    folds, ends = (_fair(samples), False) if of is None else _neighbours(dataset, study, whole, of)
    columns = [samples.columns[name].astype(np.float32) for name in situation.inputs]
    taught = [
        fold for fold in folds if all(np.ptp(x[samples.training & ~fold]) > 0 for x in columns)
    ]
    places = even_share(np.arange(len(taught)), MOST_PARTS)
    some = [samples.training & taught[place] for place in places]
    name = "recordings" if of is None else f"{'groups of outermost ' * ends}levels"
    return name, some, asked, ends and bool(some)


def _ends(samples: Curve) -> list[BoolArray]:
    """Return folds, (n,), that leave out the last fraction of the training samples of every
    recording, for each fraction in `BEHIND`.
    """
    left = np.full(samples.size, 1.0)
    for log in samples.logs:
        rows = log[samples.training[log]]
        left[rows] = np.arange(len(rows), 0, -1) / len(rows)
    return [left <= share for share in BEHIND]


def _standing(inputs: Sequence[str], study: Dataset, whole: BoolArray) -> str | None:
    """Return the name of the level quantity, or of an input that is constant in every curve and has
    other values in the curves that are held out as a whole (`whole`); None if there is neither.
    """
    if study.level is not None:
        return study.level
    for name in inputs:
        values = _values(study, name)
        still = all(np.ptp(curve.columns[name].astype(np.float32)) == 0 for curve in study.curves)
        if still and whole.any() and not np.isin(values[whole], values[~whole]).any():
            return name
    return None


def _values(dataset: Dataset, of: str) -> Array:
    """Return the value at which each curve is constant, (c,), without rounding errors."""
    return np.array(
        [c.columns[of][0] if c.level is None else c.level for c in dataset.curves], np.float32
    )


def _neighbours(
    dataset: Dataset, study: Dataset, whole: BoolArray, of: str
) -> tuple[list[BoolArray], bool]:
    """Return folds, (n,), that leave out the samples at neighbouring values, in the same way as the
    study holds out samples. Also return True if these values lie at an end of the range. If
    the study holds out values beyond an end of the training values, one fold leaves out the same
    number of values at that end. Another fold leaves out one value more, because a choice by a
    single fold is uncertain. Otherwise, each fold leaves out inner neighbours, as many as the study
    holds out in a row, or a single value. At least two values remain.
    """
    at_curves, every = _values(dataset, of), _values(study, of)
    values, trained = np.unique(every), np.unique(at_curves)
    most = len(trained) - 2
    if most < 1:
        return [], False
    kept = np.isin(values, every[~whole])
    rows = np.split(values, np.flatnonzero(np.diff(kept)) + 1)
    gaps = [row for row in rows if row[0] not in every[~whole]]
    out = [
        trained[:count] if gap[0] == values[0] else trained[-count:]
        for gap in gaps
        if gap[0] == values[0] or gap[-1] == values[-1]
        for count in sorted({min(len(gap) + more, most) for more in (0, 1)})
    ]
    ends = bool(out)
    if not ends:
        row = min(max(map(len, gaps), default=1), most)
        out += [*sliding_window_view(trained[1:-1], row)]
    at = np.repeat(at_curves, [curve.size for curve in dataset.curves])
    return [np.isin(at, some) for some in out], ends


BEYOND, WIDEST = 1 / 4, 1 / 3
"""An end of an input's range counts as held out if at least the first share of the held-out samples
lies beyond it. A fold leaves out at most the second fraction of the range at its end.
"""


def _beyond(dataset: Dataset, situation: Situation, study: Dataset) -> list[BoolArray]:
    """Return folds, (n,), that leave out an end of an input's range, as wide as the part that the
    study holds out beyond this end. The range is that of all training samples. If too few held-out
    samples lie outside of it, the range of each curve is tried instead. No fold is returned if too
    few samples lie outside of that range too, or if samples are in the order of time.
    """
    samples, held = pooled_samples(dataset), pooled_samples(study).held_out
    training = samples.training
    for of_each in () if situation.timed else (False, True):
        folds = list[BoolArray]()
        for name in situation.inputs:
            values = samples.columns[name]
            outside, _ = _from_ends(study, name, of_each)
            above, widths = _from_ends(dataset, name, of_each)
            for far, over in zip(outside[:, held], above, strict=True):
                reach = np.minimum(np.max(far, initial=0.0), WIDEST * widths)
                fold = training & (over >= -reach) & (reach > 0)
                is_held = fold.any() and np.count_nonzero(far > 0) >= BEYOND * far.size
                rest = values[training & ~fold]
                # the rest must cover at least half of the range, so that of two values neither is
                # left alone
                if is_held and len(rest) and 2 * np.ptp(rest) >= np.ptp(values[training]):
                    folds.append(fold)
        if folds:
            return folds
    return []


def _from_ends(dataset: Dataset, name: str, of_each: bool) -> tuple[Array, Array]:
    """Return the distances of all samples below the lower end and above the upper end of the
    training range, (2, n), and the width of this range, (n,). Distances inside the range are
    negative. With `of_each`, each curve has its own range, which is unlimited for a curve without
    training samples. Otherwise, all curves together have one range.
    """
    trained = [curve.columns[name][curve.training] for curve in dataset.curves]
    whole = extremes(np.concatenate(trained))
    far, widths = list[Array](), list[Array]()
    for curve, values in zip(dataset.curves, trained, strict=True):
        own = extremes(values) if len(values) else (-np.inf, np.inf)
        low, high = own if of_each else whole
        far.append(np.array([low - curve.columns[name], curve.columns[name] - high]))
        widths.append(np.full(curve.size, high - low))
    return np.concatenate(far, axis=1), np.concatenate(widths)


def _fair(samples: Curve) -> list[BoolArray]:
    """Return folds, (n,), that leave out one log each, for all logs whose size is within the limits
    `FAIR`. Return an empty list if fewer than two logs have such a size.
    """
    logs = samples.origin
    assert logs is not None
    sizes = np.bincount(logs, samples.training)
    low, high = (bound * (sizes @ sizes) / sizes.sum() for bound in FAIR)
    fair = np.flatnonzero((low <= sizes) & (sizes <= high))
    return [logs == number for number in fair] if len(fair) > 1 else []
