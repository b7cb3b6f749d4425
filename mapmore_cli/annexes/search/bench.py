"""What all structures of a search are tried on: training samples, and the folds that are left out
of them in turn.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.fitting.refitting import contiguous, training_only
from mapmore_cli.modelling.pieces.cross_validation import BLOCKS
from mapmore_cli.modelling.pieces.recipe import Fuse
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
"""Times an even share of the training samples that a recording has, which is left out: without a
larger one too little is learnt, and a smaller one says nothing."""

MOST_SAMPLES, MOST_STEPS = 6_000, 12_000
"""Training samples that structures without memory are tried on, of more an even share; and those of
any, in long pieces.
"""

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
    ends of them. `weights` (f,) add up to 1. `thinned` are the same with an even share of the
    samples, for models without memory. Errors are divided by `scale`.
    """

    dataset: Dataset
    folds: tuple[Masks, ...]
    thinned: Dataset
    thinned_folds: tuple[Masks, ...]
    blocks: int
    weights: Array
    left_out: str
    parts_left_out: str
    scale: float
    part: Slice
    asks_parts: bool

    @classmethod
    def of(cls, training: Dataset, situation: Situation, part: Slice, study: Dataset) -> Bench:
        """Return the folds of training samples, which resemble what the `study` holds out."""
        timed = "time" in training.curves[0].columns
        of = "training samples of every recording" if timed else "training samples of every curve"
        left_out = f"each of {BLOCKS} {'' if timed else 'inner '}stretches of the {of}"
        blocks = () if situation.timed else _bands(training, part.held_out, situation.moving)
        if blocks:
            left_out = f"each of {len(blocks)} bands of an input, as wide as those held out"
        else:
            run = held_run(study)
            blocks = _stretch_folds(training, situation.moving or situation.inputs, run)
        ends, asked = _holds_out(study)
        if ends:
            parts, which = _end_folds(training), f"each of {len(BEHIND)} ends of recordings"
        else:
            parts, which = _part_folds(training)
        asked = len(parts) > 0 and (asked or part.by_level or ends)
        weight = (2 / 3 if asked else 1 / 2 if situation.timed else 1 / 4) * bool(parts)
        if len(parts) == 1:  # the only inner level
            weight = 1 / 2
        weight = weight if blocks else 1.0  # recordings that are too short for stretches
        shares = [(1 - weight) / max(len(blocks), 1), weight / max(len(parts), 1)]
        thinning = thinning_of(training)
        thinned = tuple(c.at(rows) for c, rows in zip(training.curves, thinning, strict=True))
        folds = (*blocks, *parts)
        values = np.concatenate(
            [curve.columns[training.target][curve.training] for curve in training.curves]
        )
        return cls(
            training,
            folds,
            replace(training, curves=thinned),
            tuple(
                tuple(mask[rows] for mask, rows in zip(fold, thinning, strict=True))
                for fold in folds
            ),
            len(blocks),
            np.repeat(shares, [len(blocks), len(parts)]),
            left_out,
            which,
            float(np.ptp(values)) or 1.0,
            part,
            asked,
        )


def searchable(dataset: Dataset) -> Dataset:
    """Return the training samples; in recordings, with the inputs between them, which states
    follow, but without the held-out outputs.

    Without these inputs, whatever follows slowly would begin anew behind every piece that is held
    out, and look worse than it is.
    """
    if "time" not in dataset.curves[0].columns:
        return training_only(dataset)
    curves = []
    for curve in dataset.curves:
        between = np.zeros(curve.size, dtype=np.bool_)
        for log in curve.logs:
            own = np.flatnonzero(curve.training[log])
            if len(own):
                between[log[own[0] : own[-1] + 1]] = True
        output = np.where(curve.held_out, np.nan, curve.columns[dataset.target])
        if curve.training.any():
            columns = {**curve.columns, dataset.target: output}
            curves.append(replace(curve, columns=columns).at(between))
    return replace(dataset, curves=tuple(curves))


def cut_short(dataset: Dataset, run: int) -> Dataset:
    """At most so many samples, where recordings are longer: of each one some even pieces, which are
    no shorter than a held-out `run`.

    Each piece begins from measured outputs: shorter ones would flatter models that feed their
    output back.
    """
    total = sum(curve.size for curve in dataset.curves)
    if total <= MOST_STEPS or "time" not in dataset.curves[0].columns:
        return dataset
    share, curves = MOST_STEPS / total, []
    for curve in dataset.curves:
        mask = np.zeros(curve.size, dtype=np.bool_)
        for log in curve.logs:
            count = int(np.clip(share * len(log) // max(run, 1), 1, BLOCKS))
            for piece in np.array_split(log, count):
                mask[piece[: int(np.ceil(share * len(piece)))]] = True
        curves.append(curve.at(mask))
    return replace(dataset, curves=tuple(curves))


def thinning_of(dataset: Dataset) -> list[BoolArray]:
    """Return an even share of the samples of every curve."""
    most = max(MOST_SAMPLES // max(len(dataset.curves), 1), 1)
    return [
        curve.training & ((np.cumsum(curve.training) - 1) % -(-curve.training.sum() // most) == 0)
        for curve in dataset.curves
    ]


def _stretch_folds(dataset: Dataset, inputs: Sequence[str], run: int) -> tuple[Masks, ...]:
    """Stretches of every recording in the order of time; without a clock, inner ones of every curve
    along each of the inputs.

    In recordings they are as long as the longest `run` that is held out, one or several of each
    recording. What lies at the end of an input can only be extrapolated: that would decide, and is
    not what is asked.
    """
    curves = dataset.curves
    if "time" in curves[0].columns:
        logs = [[log[curve.training[log]] for log in curve.logs] for curve in curves]
        each = [_stretch_masks(of, run, curve.size) for of, curve in zip(logs, curves, strict=True)]
        return tuple(zip(*each, strict=True))
    folds: list[Masks] = []
    for name in inputs:
        along = [np.argsort(curve.columns[name], kind="stable") for curve in curves]
        every = [contiguous([rows], BLOCKS + 2, len(rows)) for rows in along]
        folds += list(zip(*every, strict=True))[1:-1]
    return tuple(folds)


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
    """Bands of an input that are as wide as those that the study holds out of it, in the middles of
    even parts of what trains.

    Blocks in the order of time hold every value of an input that was swept more than once: left
    out, they ask for nothing between.
    """
    folds: list[Masks] = []
    for name, held in ({} if held_out is None else held_out.quantities).items():
        if name not in inputs or not isinstance(held, Between):
            continue
        bands = np.array(held.between)
        values = np.concatenate([curve.columns[name][curve.training] for curve in dataset.curves])
        half = float(np.median(np.ptp(bands, axis=1))) / 2
        places = np.linspace(values.min(), values.max(), 1 + 100 * BLOCKS)
        within = (bands[:, :1] <= places) & (places <= bands[:, 1:])
        free = places[~within.any(axis=0)]
        for middle in free[np.linspace(0, len(free) - 1, 2 * BLOCKS + 1)[1::2].astype(int)]:
            fold = tuple(
                curve.training & (np.abs(curve.columns[name] - middle) <= half)
                for curve in dataset.curves
            )
            folds += [fold] if any(mask.any() for mask in fold) else []
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
    folds = []
    for share in BEHIND:
        masks = [np.zeros(curve.size, dtype=np.bool_) for curve in dataset.curves]
        for curve, mask in zip(dataset.curves, masks, strict=True):
            for log in curve.logs:
                rows = log[curve.training[log]]
                mask[rows[len(rows) - int(share * len(rows)) :]] = True
        folds.append(tuple(masks))
    return tuple(folds)


def _part_folds(dataset: Dataset) -> tuple[tuple[Masks, ...], str]:
    """Inner levels, or recordings where there are no levels; none where there are fewer than two
    recordings of a fair size.
    """
    sizes = np.array([curve.training.sum() for curve in dataset.curves])
    low, high = (bound * sizes.sum() / np.count_nonzero(sizes) for bound in FAIR)
    if dataset.level is not None:
        numbers, least, name = np.flatnonzero(sizes)[1:-1], 1, "inner levels"
    else:
        numbers, least = np.flatnonzero((low <= sizes) & (sizes <= high)), 2
        name = "recordings"
    if len(numbers) < least:
        return (), ""
    taken = np.linspace(0, len(numbers) - 1, min(len(numbers), MOST_PARTS)).round().astype(int)
    folds = tuple(
        tuple(curve.training & (number == out) for number, curve in enumerate(dataset.curves))
        for out in numbers[taken]
    )
    return folds, f"each of {len(folds)} {name}"
