"""What all structures of a search are tried on: training samples, and the folds that are left out of them in turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import BoolArray
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.fitting.refitting import contiguous, kept, training_only
from mapmore_cli.modelling.pieces.cross_validation import BLOCKS
from mapmore_cli.modelling.pieces.recipe import Fuse
from mapmore_cli.modelling.search.situation import Situation
from mapmore_cli.spec.sections.data import Between, Holdout, Levels
from mapmore_cli.spec.sections.model import ModelChoice

PLACES = 1_000
"""Along an input, of which the middles of left-out bands are chosen."""

MOST_BLOCKS = 5
"""Blocks of a recording that a fold leaves out at most, where the study holds short pieces out."""

BEHIND = (0.2, 0.35, 0.5)
"""Shares of every recording's end that are left out in turn, where the study holds ends out: what drifts is to be foretold."""

MOST_PARTS = 6
"""Levels or recordings that are left out in turn, evenly chosen of more."""

FAIR = (0.2, 1.2)
"""Times an even share of the training samples that a level or recording has, which is left out: without a larger one too little is learnt,
and a smaller one says nothing."""

MOST_SAMPLES, MOST_STEPS = 6_000, 12_000
"""Training samples that structures without memory are tried on, of more an even share; and those of any, of more the first part of every
block."""


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
    """What all structures are tried on: training samples alone, what is left out of them in turn, and what errors are divided by."""

    dataset: Dataset
    thinned: Dataset
    blocks: tuple[Masks, ...]
    parts: tuple[Masks, ...]
    thinned_blocks: tuple[Masks, ...]
    thinned_parts: tuple[Masks, ...]
    left_out: str
    parts_left_out: str
    scale: float
    part: Slice
    tables: bool
    parts_asked: bool

    @classmethod
    def of(cls, training: Dataset, situation: Situation, part: Slice, behind: bool = False, parts_asked: bool = False) -> Bench:
        """Return the folds of training samples; the study holds the ends of recordings out (`behind`), or whole parts (`parts_asked`)."""
        whole = training
        values = np.concatenate([curve.columns[training.target][curve.training] for curve in training.curves])
        thinning = thinning_of(whole)
        bands = () if situation.timed else _bands(whole, part.held_out, situation.moving)
        blocks = bands or _blocks(whole, situation.moving or situation.inputs)
        parts, inner = (_ends(whole), "the end of every recording") if behind else _parts(whole)
        name = "recording" if "time" in whole.curves[0].columns else "curve"
        which = "contiguous" if name == "recording" else f"inner ones of {BLOCKS + 2} contiguous"
        return cls(
            whole,
            replace(whole, curves=tuple(kept(curve, rows) for curve, rows in zip(whole.curves, thinning, strict=True))),
            blocks,
            parts,
            tuple(tuple(mask[rows] for mask, rows in zip(fold, thinning, strict=True)) for fold in blocks),
            tuple(tuple(mask[rows] for mask, rows in zip(fold, thinning, strict=True)) for fold in parts),
            f"each of {len(bands)} bands of an input, as wide as those held out"
            if bands
            else f"each of {BLOCKS} {which} blocks of the training samples of every {name}",
            inner,
            float(np.ptp(values)) or 1.0,
            part,
            not situation.timed,
            parts_asked or part.by_level,
        )


Masks = tuple[BoolArray, ...]
"""For every curve the samples that a fold leaves out."""


def searchable(dataset: Dataset) -> Dataset:
    """Return the training samples; in recordings, with the inputs between them, which states follow, but without the held-out outputs.

    Without these inputs, whatever follows slowly would begin anew behind every piece that is held out, and look worse than it is.
    """
    if "time" not in dataset.curves[0].columns:
        return training_only(dataset)
    return replace(dataset, curves=tuple(_within(curve, dataset.target) for curve in dataset.curves if curve.training.any()))


def _within(curve: Curve, target: str) -> Curve:
    """From the first to the last training sample of every recording."""
    between = np.zeros(curve.size, dtype=np.bool_)
    for log in curve.logs:
        own = np.flatnonzero(curve.training[log])
        if len(own):
            between[log[own[0] : own[-1] + 1]] = True
    output = np.where(curve.held_out, np.nan, curve.columns[target])
    return kept(replace(curve, columns={**curve.columns, target: output}), between)


def shortened(dataset: Dataset) -> Dataset:
    """At most so many samples, where recordings are longer: of every block of every recording the first part, in one piece."""
    total = sum(curve.size for curve in dataset.curves)
    if total <= MOST_STEPS or "time" not in dataset.curves[0].columns:
        return dataset
    share = MOST_STEPS / total
    return replace(dataset, curves=tuple(kept(curve, _beginnings(curve, share)) for curve in dataset.curves))


def _beginnings(curve: Curve, share: float) -> BoolArray:
    """Return the first part of every block of every recording."""
    blocks = [block for log in curve.logs for block in np.array_split(log, BLOCKS)]
    mask = np.zeros(curve.size, dtype=np.bool_)
    mask[np.concatenate([block[: -int(-len(block) * share // 1)] for block in blocks])] = True
    return mask


def thinning_of(dataset: Dataset) -> list[BoolArray]:
    """Return an even share of the samples of every curve."""
    most = max(MOST_SAMPLES // max(len(dataset.curves), 1), 1)
    return [curve.training & ((np.cumsum(curve.training) - 1) % -(-curve.training.sum() // most) == 0) for curve in dataset.curves]


def _blocks(dataset: Dataset, inputs: Sequence[str]) -> tuple[Masks, ...]:
    """Contiguous blocks of every recording in the order of time; without a clock, inner ones of every curve along each of the inputs.

    Where pieces of recordings are held out, the blocks are as short as these: long ones would ask for more than the study does. What lies
    at the end of an input can only be extrapolated: that would decide, and is not what is asked.
    """
    if "time" in dataset.curves[0].columns:
        each = [contiguous([log[curve.training[log]] for log in curve.logs], BLOCKS, curve.size, _times(curve)) for curve in dataset.curves]
        return tuple(zip(*each, strict=True))
    folds: list[Masks] = []
    for name in inputs:
        sorted_rows = [np.argsort(curve.columns[name], kind="stable") for curve in dataset.curves]
        each = [contiguous([rows], BLOCKS + 2, curve.size) for rows, curve in zip(sorted_rows, dataset.curves, strict=True)]
        folds += list(zip(*each, strict=True))[1:-1]
    return tuple(folds)


def _bands(dataset: Dataset, held_out: Holdout | None, inputs: Sequence[str]) -> tuple[Masks, ...]:
    """Bands of an input that are as wide as those that the study holds out of it, in the middles of even parts of what trains.

    Blocks in the order of time hold every value of an input that was swept more than once: left out, they ask for nothing between.
    """
    held = {} if held_out is None else {name: one for name, one in held_out.quantities.items() if name in inputs}
    folds: list[Masks] = []
    for name, bands in held.items():
        if not isinstance(bands, Between):
            continue
        values = np.concatenate([curve.columns[name][curve.training] for curve in dataset.curves])
        width = float(np.median([high - low for low, high in bands.between]))
        places = np.linspace(values.min(), values.max(), PLACES)
        free = places[~np.logical_or.reduce([(low <= places) & (places <= high) for low, high in bands.between])]
        for middle in free[np.linspace(0, len(free) - 1, 2 * BLOCKS + 1)[1::2].astype(int)]:
            fold = tuple(curve.training & (np.abs(curve.columns[name] - middle) <= width / 2) for curve in dataset.curves)
            if any(mask.any() for mask in fold):
                folds.append(fold)
    return tuple(folds) if len(folds) > 1 else ()


def _times(curve: Curve) -> int:
    """How many blocks of a recording a fold leaves out, so that they are about as short as the pieces that the study holds out."""
    out = np.concatenate([[0], *([*(~curve.training[log]).astype(int), 0] for log in curve.logs)])
    edges = np.flatnonzero(np.diff(out))
    if not len(edges):
        return 1
    usual, longest = float(np.median(edges[1::2] - edges[::2])), max(int(curve.training[log].sum()) for log in curve.logs)
    return int(np.clip(longest / (BLOCKS * usual), 1, MOST_BLOCKS))


def holds_ends_out(dataset: Dataset) -> bool:
    """Whether most of what a study holds out lies behind the training samples of the same recording."""
    if "time" not in dataset.curves[0].columns:
        return False
    ends = sum(int(np.argmax(curve.training[log][::-1])) for curve in dataset.curves for log in curve.logs if curve.training[log].any())
    return 2 * ends > sum(int(curve.held_out.sum()) for curve in dataset.curves)


def holds_parts_out(dataset: Dataset) -> bool:
    """Whether most of what a study holds out are whole levels or recordings."""
    whole = sum(curve.size for curve in dataset.curves if curve.held_out.all())
    return 2 * whole > sum(int(curve.held_out.sum()) for curve in dataset.curves)


def _ends(dataset: Dataset) -> tuple[Masks, ...]:
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


def _parts(dataset: Dataset) -> tuple[tuple[Masks, ...], str]:
    """Inner levels, or recordings where there are no levels; none where there are fewer than two of a fair size."""
    sizes = np.array([curve.training.sum() for curve in dataset.curves])
    numbers = np.flatnonzero(sizes).tolist()
    low, high = (bound * sizes.sum() / len(numbers) for bound in FAIR)
    numbers = numbers[1:-1] if dataset.level is not None else [number for number in numbers if low <= sizes[number] <= high]
    if len(numbers) < 2:
        return (), ""
    if len(numbers) > MOST_PARTS:
        numbers = [numbers[place] for place in np.linspace(0, len(numbers) - 1, MOST_PARTS).round().astype(int)]
    folds = tuple(tuple(curve.training & (number == out) for number, curve in enumerate(dataset.curves)) for out in numbers)
    return folds, f"each of {len(folds)} {'inner levels' if dataset.level is not None else 'recordings'}"
