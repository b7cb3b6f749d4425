"""What limits a model of repeated cycles: drift from cycle to cycle, the shape of its loops, or what does not repeat.

Errors are parted by projections, so that squares add up. The mean of each cycle is `drift`. Of what is left, the mean over cycles at the
same place of the same stroke is an error that every cycle of the split repeats: as far as it is the one that training left, it is the
model's `shape`; what differs from that is `change`, loops that are no longer those of the training cycles. The `rest` is repeated by no
other cycle: noise, and drift within a cycle. Of a single held-out cycle, all that its places have and training did not leave is `change`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.cycles import cycle_starts
from mapmore_cli.modelling.validation.repeatability import rising

PLACES = 20
"""Parts of a stroke at which cycles are compared."""

WHOLE = 0.25
"""Of the usual number of samples: a cycle with fewer is a remainder, and left out."""

PARTS = ("drift", "change", "shape", "rest")
"""What errors are parted in."""


@dataclass(frozen=True)
class ErrorParts:
    """RMS of the parts of the errors on samples of `cycles` cycles, held out or not.

    - `rms`: by `PARTS`; their squares add up to the mean square error.
    - `offsets`: (cycles,) mean error of each cycle, in order of time.
    """

    split: str
    samples: int
    rms: Mapping[str, float]
    offsets: Array

    @property
    def limit(self) -> str:
        """The largest part."""
        return max(self.rms, key=lambda part: self.rms[part])


def error_parts(
    curves: Sequence[Curve], predicted: Sequence[Array], target: str, driven: str, logs: Mapping[str, str]
) -> tuple[ErrorParts, ...]:
    """Return the parts of the errors on training and on held-out samples; nothing of training where no log has
    two cycles of `driven`, nor of held-out samples where there is not one beside these.

    - `curves`, `predicted`: pieces of recordings, and (n,) predictions of each.
    - `target`, `driven`: the predicted quantity, and the input that goes up and down.
    - `logs`: the log that each recording is a piece of: cycles go on over gaps.
    """
    names = [logs[curve.recordings[0]] for curve in curves]
    error, held_out, cycle, place = [], [], [], []
    count = 0
    for log in dict.fromkeys(names):
        pieces = [number for number, name in enumerate(names) if name == log]
        x, y = (np.concatenate([curves[number].columns[name] for number in pieces]) for name in (driven, target))
        number = np.searchsorted(cycle_starts(x), np.arange(len(x)), side="right") - 1
        error.append(np.concatenate([predicted[piece] for piece in pieces]) - y)
        held_out.append(np.concatenate([curves[piece].held_out for piece in pieces]))
        cycle.append(np.where(number < 0, -1, number + count))
        place.append(_places(x))
        count += int(number.max(initial=-1)) + 1
    columns = [np.concatenate(parts) for parts in (error, held_out, cycle, place)]
    trained = _means(*_left(~columns[1], *columns)[:2])
    found: list[ErrorParts] = []
    for split, rows in (("train", ~columns[1]), ("validate", columns[1])):
        left = _left(rows, *columns)
        if len(left[-1]) > (0 if found else 1):
            found.append(_of_split(split, trained, *left))
    return tuple(found)


def _places(x: Array) -> IntArray:
    """(n,) where a sample lies on its stroke: a part of the range, and whether x rises."""
    low, high = float(x.min()), float(x.max())
    part = np.clip((PLACES * (x - low) / (high - low or 1.0)).astype(np.int64), 0, PLACES - 1)
    return np.asarray(part + PLACES * rising(x))


def _left(rows: BoolArray, error: Array, _held_out: BoolArray, cycle: IntArray, place: IntArray) -> tuple[Array, IntArray, Array, Array]:
    """Errors less the mean of their cycle, their places, that mean, each (n,); and the mean of every cycle."""
    rows = rows & np.isfinite(error) & (cycle >= 0)
    counts = np.bincount(cycle[rows], minlength=int(cycle.max(initial=0)) + 1)
    enough = counts >= WHOLE * (np.median(counts[counts > 0]) if counts.any() else 1)
    rows &= enough[np.maximum(cycle, 0)]
    cycles, of_cycle = np.unique(cycle[rows], return_inverse=True)
    offsets = _means(error[rows], of_cycle)[: len(cycles)]
    return error[rows] - offsets[of_cycle], place[rows], offsets[of_cycle], offsets


def _of_split(split: str, trained: Array, left: Array, place: IntArray, drift: Array, offsets: Array) -> ErrorParts:
    repeated, known = _means(left, place)[place], trained[place]
    power = float(known @ known)
    again = float(np.clip(repeated @ known / power, 0.0, 1.0)) if power > 0 else 0.0
    shape = again**2 * np.mean(known**2)
    squares = (np.mean(drift**2), max(np.mean(repeated**2) - shape, 0.0), shape, np.mean((left - repeated) ** 2))
    return ErrorParts(split, len(left), dict(zip(PARTS, np.sqrt(np.array(squares)).tolist(), strict=True)), offsets)


def _means(values: Array, groups: IntArray) -> Array:
    """Mean of each group, (2 `PLACES`,) or more; zero of an empty one."""
    counts = np.bincount(groups, minlength=2 * PLACES)
    sums = np.bincount(groups, values, minlength=2 * PLACES)
    return np.asarray(np.divide(sums, counts, out=np.zeros(len(counts)), where=counts > 0))
