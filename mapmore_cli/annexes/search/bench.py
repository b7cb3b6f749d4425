"""What all structures of a search are tried on: training samples, and the folds that are left out
of them in turn.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.domain.arrays import Array, BoolArray, IntArray, extremes
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.fitting.baselines import even_share
from mapmore_cli.fitting.refitting import contiguous
from mapmore_cli.modelling.pieces.cross_validation import BLOCKS
from mapmore_cli.modelling.pieces.recipe import Fuse
from mapmore_cli.modelling.simple import polynomial_fit
from mapmore_cli.spec.sections.data import Between, Holdout, Levels
from mapmore_cli.spec.sections.model import ModelChoice

LONGEST_FOLD = 1 / 3
"""Of a recording at most that a fold leaves out, where the study holds longer runs out."""

BEHIND = (0.2, 0.35, 0.5)
"""Shares of every recording's end that are left out in turn, where the study holds ends out: what
drifts is to be foretold.
"""

MOST_PARTS = 6
"""Levels or recordings that are left out in turn, evenly chosen of more."""

FAIR = (0.2, 1.2)
"""Of the size of the recording that a training sample lies in on the average: what a recording has,
which is left out. Without a larger one too little is learnt, and a smaller one says nothing; the
average over recordings would be that of fragments.
"""

MOST_SAMPLES = 12_000
"""Training samples that structures are tried on: of more an even share of every curve, or of
recordings that models with a past run along, long pieces."""

Masks = tuple[BoolArray, ...]
"""For every curve the samples that a fold leaves out."""


@dataclass(frozen=True)
class Slice:
    """What a search depends on."""

    levels: Levels | None
    model: ModelChoice
    fuse: Fuse
    lengths: Mapping[str, float | None]
    held_out: Holdout | None
    ignored: tuple[str, ...]
    by_level: bool


@dataclass(frozen=True)
class Bench:
    """What all structures are tried on: training samples alone, and what is left out of them in
    turn.

    The first `blocks` of the folds are stretches of curves, the others whole levels, recordings or
    ends of them. `weights` (f,) add up to 1. Of the `study`, an even share of all that there is,
    what is held out included, the inputs alone are looked at.
    """

    dataset: Dataset
    study: Dataset
    situation: Situation
    folds: tuple[Masks, ...]
    blocks: int
    weights: Array
    left_out: str
    parts_left_out: str
    part: Slice
    asks_parts: bool

    @classmethod
    def of(cls, training: Dataset, situation: Situation, part: Slice, study: Dataset) -> Bench:
        """Return the folds of training samples, which resemble what the `study` holds out. Raises
        DataError where no sample can be left out.
        """
        left_out, blocks = _stretches(training, situation, part.held_out, held_run(study))
        ends, asked = _holds_out(study)
        if ends:
            parts, name = _end_folds(training), "ends of recordings"
        elif training.level is not None:
            parts, name = _neighbouring_levels(training, study), "levels"
        else:
            parts, name = _recording_folds(training, part.held_out), "recordings"
        asked = len(parts) > 0 and (asked or part.by_level or ends)
        weight = (2 / 3 if asked else 1 / 2 if situation.timed else 1 / 4) * bool(parts)
        if len(parts) == 1:  # the only inner level
            weight = 1 / 2
        weight = weight if blocks else 1.0  # recordings that are too short for stretches
        if not blocks and not parts:
            raise DataError("too few samples train: none can be left out", "keep more samples")
        shares = [(1 - weight) / max(len(blocks), 1), weight / max(len(parts), 1)]
        most = max(MOST_SAMPLES // len(study.curves), 1)
        shown = [curve.at(even_share(np.arange(curve.size), most)) for curve in study.curves]
        return cls(
            training,
            replace(study, curves=tuple(shown)),
            situation,
            (*blocks, *parts),
            len(blocks),
            np.repeat(shares, [len(blocks), len(parts)]),
            left_out,
            f"each of {len(parts)} {name}" if parts else "",
            part,
            asked,
        )

    @cached_property
    def range(self) -> tuple[float, float]:
        """Least and largest output: measured in training, and of a plane through these at all
        inputs of the study, since what lies beyond is to be foretold.
        """
        target = self.study.target
        plane = polynomial_fit(1, self.study, self.situation.inputs) or ()
        every = [curve.columns[target][curve.training] for curve in self.study.curves]
        return extremes(np.concatenate([*every, *plane]))


def searchable(dataset: Dataset) -> Dataset:
    """Return the training samples with the inputs between them, which states follow, but without
    the held-out outputs.

    Without these inputs, whatever follows slowly would begin anew behind every piece that is held
    out, and look worse than it is.
    """
    curves = []
    for curve in dataset.curves:
        between = np.zeros(curve.size, dtype=np.bool_)
        for log in curve.logs:
            own = np.flatnonzero(curve.training[log])
            if len(own):
                between[log[own[0] : own[-1] + 1]] = True
        output = np.where(curve.held_out, np.nan, curve.columns[dataset.target])
        if between.any():
            columns = {**curve.columns, dataset.target: output}
            curves.append(replace(curve, columns=columns).at(between))
    return replace(dataset, curves=tuple(curves))


def cut_short(dataset: Dataset, run: int, timed: bool) -> Dataset:
    """Return at most so many samples: an even share of every curve, or of recordings in time some
    even pieces, which are no shorter than a held-out `run`.

    Each piece begins from measured outputs: shorter ones would flatter models that feed their
    output back.
    """
    most = max(MOST_SAMPLES // len(dataset.curves), 1)
    share = min(MOST_SAMPLES / sum(curve.size for curve in dataset.curves), 1.0)

    def kept(curve: Curve) -> IntArray:
        if not timed:
            return even_share(np.flatnonzero(curve.training), most)
        pieces = [
            piece[: math.ceil(share * len(piece))]
            for log in curve.logs
            for piece in np.array_split(
                log, int(np.clip(share * len(log) // max(run, 1), 1, BLOCKS))
            )
        ]
        return np.sort(np.concatenate(pieces))

    return replace(dataset, curves=tuple(curve.at(kept(curve)) for curve in dataset.curves))


def _stretches(
    dataset: Dataset, situation: Situation, held_out: Holdout | None, run: int
) -> tuple[str, tuple[Masks, ...]]:
    """Return what is left out of every curve, in words and masks: of recordings at even steps
    stretches of time as long as the longest `run` that is held out; else bands of an input, as wide
    as those that are held out, or stretches along each input.

    Time says nothing of a model without a past. What lies at the end of an input can only be
    extrapolated: that would decide, and is not what is asked.
    """
    curves = dataset.curves
    if situation.timed:
        logs = [[log[curve.training[log]] for log in curve.logs] for curve in curves]
        each = [_stretch_masks(of, run, curve.size) for of, curve in zip(logs, curves, strict=True)]
        stretches = f"each of {BLOCKS} stretches of the training samples of every recording"
        return stretches, tuple(zip(*each, strict=True))
    inputs = situation.moving or situation.inputs
    if bands := _bands(dataset, held_out, inputs):
        return f"each of {len(bands)} bands of an input, as wide as those held out", bands
    folds: list[Masks] = []
    for name in inputs:
        within = []
        for curve in curves:
            x = curve.columns[name]
            rows = np.flatnonzero(curve.training & (np.ptp(x) > 0))
            rows = rows[np.argsort(x[rows], kind="stable")]
            end = math.ceil(len(rows) / (BLOCKS + 2))
            within.append(contiguous([rows[end : len(rows) - end]], BLOCKS, curve.size))
        folds += zip(*within, strict=True)
    told = f"each of {BLOCKS} inner stretches of the training samples of every curve"
    return told, tuple(fold for fold in folds if any(mask.any() for mask in fold))


def _stretch_masks(logs: Sequence[IntArray], run: int, size: int) -> list[BoolArray]:
    """Masks (size,) of five folds: short runs several times in each recording, or one long run,
    which those of other folds may overlap.
    """
    longest = max(map(len, logs))
    if run <= longest / BLOCKS:
        return contiguous(
            logs, BLOCKS, size, int(np.clip(longest / (BLOCKS * max(run, 1)), 1, BLOCKS))
        )
    masks = np.zeros((BLOCKS, size), dtype=np.bool_)
    for rows in logs:
        length = math.ceil(len(rows) * min(run / longest, LONGEST_FOLD))
        for mask, first in zip(
            masks, np.linspace(0, len(rows) - length, BLOCKS).round().astype(int), strict=True
        ):
            mask[rows[first : first + length]] = True
    return list(masks)


def held_run(study: Dataset) -> int:
    """Return the usual length of a run of held-out samples: that in which half of them lie."""
    out = [0]
    for curve in study.curves:
        for log in curve.logs:
            out += [*curve.held_out[log].astype(int), 0]
    edges = np.flatnonzero(np.diff(out))
    runs = np.sort(edges[1::2] - edges[::2])
    return int(runs[np.searchsorted(np.cumsum(runs), runs.sum() / 2)]) if len(runs) else 0


def _bands(dataset: Dataset, held_out: Holdout | None, inputs: Sequence[str]) -> tuple[Masks, ...]:
    """Bands of an input that are as wide as those that the study holds out of it, about even
    quantiles of what trains; at an end, where those lie beyond that end.

    Blocks in the order of time hold every value of an input that was swept more than once: left
    out, they ask for nothing between.
    """
    folds: list[Masks] = []
    for name, held in ({} if held_out is None else held_out.quantities).items():
        if name not in inputs or not isinstance(held, Between):
            continue
        low, high = np.array(held.between).T
        half = float(np.median(high - low)) / 2
        values = np.concatenate([curve.columns[name][curve.training] for curve in dataset.curves])
        least, largest = extremes(values)
        middles = [least + half] * bool(low.min() <= least)
        middles += [largest - half] * bool(high.max() >= largest)
        if ((low > least) & (high < largest)).any():
            middles.extend(np.quantile(values, np.linspace(0, 1, BLOCKS + 2)[1:-1]))
        folds += [
            tuple(
                curve.training & (np.abs(curve.columns[name] - middle) <= half)
                for curve in dataset.curves
            )
            for middle in middles
        ]
    return tuple(folds) if len(folds) > 1 else ()


def _holds_out(study: Dataset) -> tuple[bool, bool]:
    """Whether most of what a study holds out lies behind the training samples of the same
    recording, and whether it is whole curves.
    """
    held = sum(int(curve.held_out.sum()) for curve in study.curves)
    whole = sum(curve.size for curve in study.curves if curve.held_out.all())
    timed = "time" in study.curves[0].columns
    ends = [
        int(np.argmax(curve.training[log][::-1]))
        for curve in study.curves
        for log in curve.logs
        if curve.training[log].any()
    ]
    return timed and 2 * sum(ends) > held, 2 * whole > held


def _end_folds(dataset: Dataset) -> tuple[Masks, ...]:
    """Return the last shares of the training samples of every recording."""
    masks = []
    for curve in dataset.curves:
        left = np.full(curve.size, 1.0)
        for log in curve.logs:
            rows = log[curve.training[log]]
            left[rows] = np.arange(len(rows), 0, -1) / len(rows)
        masks.append([left <= share for share in BEHIND])
    return tuple(zip(*masks, strict=True))


def _neighbouring_levels(dataset: Dataset, study: Dataset) -> tuple[Masks, ...]:
    """Levels as the study holds them out: inner ones, as many neighbours as its longest row of
    them, or as many at an end where they lie beyond that end; inner ones one by one where it holds
    none out. Two levels stay at least.
    """
    held = np.array([curve.held_out.all() for curve in study.curves])
    last = len(held) - 1
    rows = np.split(np.arange(last + 1), np.flatnonzero(np.diff(held)) + 1)
    gaps = [row for row in rows if held[row[0]]]
    inner = [len(gap) for gap in gaps if gap[0] > 0 and gap[-1] < last]
    trained = np.flatnonzero([curve.training.any() for curve in dataset.curves])
    most = len(trained) - 2
    if most < 1:
        return ()
    out = [trained[:most][: len(gap)] for gap in gaps if gap[0] == 0]
    out += [trained[2:][-len(gap) :] for gap in gaps if gap[-1] == last]
    if inner or not out:
        out += [*sliding_window_view(trained[1:-1], min(max(inner, default=1), most))]
    return _without(dataset, out)


def _recording_folds(dataset: Dataset, held_out: Holdout | None) -> tuple[Masks, ...]:
    """Return recordings, those together in which what the study holds out stands at one value; none
    where there are fewer than two of a fair size.
    """
    curves = dataset.curves
    held = () if held_out is None else held_out.quantities
    still = [
        one for one in held if all(np.ptp(curve.columns.get(one, [0, 1])) == 0 for curve in curves)
    ]
    values = [[c.columns[one][0] for one in still] or [n] for n, c in enumerate(curves)]
    _, place = np.unique(values, axis=0, return_inverse=True)
    sizes = np.bincount(place, [curve.training.sum() for curve in curves])
    low, high = (bound * (sizes @ sizes) / sizes.sum() for bound in FAIR)
    fair = np.flatnonzero((low <= sizes) & (sizes <= high))
    return _without(dataset, [np.flatnonzero(place == one) for one in fair[len(fair) < 2 :]])


def _without(dataset: Dataset, out: Sequence[IntArray]) -> tuple[Masks, ...]:
    """Return the masks of the curves of these numbers; of `MOST_PARTS` at most, evenly chosen."""
    return tuple(
        tuple(
            curve.training & (number in out[place]) for number, curve in enumerate(dataset.curves)
        )
        for place in even_share(np.arange(len(out)), MOST_PARTS).tolist()
    )
