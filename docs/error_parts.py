"""What limits a model on cycles that repeat each other.

Errors on repeated cycles are parted by projections, so that squares add up. The mean of each cycle
is `drift`. Of what is left, the mean over cycles at the same place of the same stroke is an error
that every cycle of the split repeats: as far as it is the one that training left, it is the model's
`shape`; what differs from that is `change`, loops that are no longer those of the training cycles.
The `rest` is repeated by no other cycle: noise, and drift within a cycle. Of a single held-out
cycle, all that its places have and training did not leave is `change`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.signals.cycles import cycle_starts
from mapmore_cli.modelling.validation.repeatability import by_log, rising_samples

PLACES = 20  # parts of a stroke at which cycles are compared
WHOLE = 0.25  # of the usual number of samples: a cycle with fewer is a remainder, and left out
PARTS = ("drift", "change", "shape", "rest")  # what errors are parted in


@dataclass(frozen=True)
class ErrorParts:
    """Parts of the errors on the samples of a split: `rms` by `PARTS`, whose squares add up to the
    mean square error.

    `offsets` are the mean errors of the cycles, (cycles,), in order of time.
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
    curves: Sequence[Curve],
    predicted: Sequence[Array],
    target: str,
    driven: str,
    logs: Mapping[str, str],
) -> tuple[ErrorParts, ...]:
    """Return the parts of the errors on training and on held-out samples; nothing of training where
    no log has two cycles of `driven`, nor of held-out samples where there is not one beside these.

    `curves` are pieces of recordings, with (n,) predictions of each; `logs` names the log of each
    recording: cycles go on over gaps.
    """
    columns, count = [], 0
    for pieces, x, y, held in by_log(curves, logs, driven, target):
        cycle = np.searchsorted(cycle_starts(x), np.arange(len(x)), side="right") - 1
        error = np.concatenate([predicted[number] for number in pieces]) - y
        columns.append((held, error, np.where(cycle < 0, -1, cycle + count), _stroke_places(x)))
        count += int(cycle.max(initial=-1)) + 1
    held_out, error, cycle, place = (np.concatenate(parts) for parts in zip(*columns, strict=True))
    known = np.isfinite(error) & (cycle >= 0)
    parts: list[ErrorParts] = []
    trained = np.zeros(2 * PLACES)
    for split, later in (("train", False), ("validate", True)):
        rows = np.flatnonzero(known & (held_out == later))
        _, of_cycle, counts = np.unique(cycle[rows], return_inverse=True, return_counts=True)
        if len(rows):
            rows = rows[(counts >= WHOLE * np.median(counts))[of_cycle]]
        offsets, of_cycle = _group_means(error[rows], cycle[rows])
        left = error[rows] - offsets[of_cycle]
        at_places = np.zeros(2 * PLACES)
        means, _ = _group_means(left, place[rows])
        at_places[np.unique(place[rows])] = means
        trained = trained if later else at_places
        if len(offsets) > (0 if parts else 1):
            repeated, again = at_places[place[rows]], trained[place[rows]]
            rms = _rms_of_parts(offsets[of_cycle], left, repeated, again)
            parts.append(ErrorParts(split, len(rows), rms, offsets))
    return tuple(parts)


def _stroke_places(x: Array) -> IntArray:
    """(n,) where a sample lies on its stroke: a part of the range, and whether x rises."""
    low, high = float(x.min()), float(x.max())
    part = np.clip((PLACES * (x - low) / (high - low or 1.0)).astype(np.int64), 0, PLACES - 1)
    return np.asarray(part + PLACES * rising_samples(x))


def _group_means(values: Array, groups: IntArray) -> tuple[Array, IntArray]:
    """Return the mean of each group, and the number of the group of every value."""
    _, number, counts = np.unique(groups, return_inverse=True, return_counts=True)
    return np.bincount(number, values) / counts, number


def _rms_of_parts(drift: Array, left: Array, repeated: Array, known: Array) -> dict[str, float]:
    """Return the root mean square of each part, given what is `repeated` at the places of the
    samples, and what is `known` from training.
    """
    power = float(known @ known)
    again = float(np.clip(repeated @ known / power, 0.0, 1.0)) if power > 0 else 0.0
    shape = again**2 * float(np.mean(known**2))
    change = max(float(np.mean(repeated**2)) - shape, 0.0)
    squares = (float(np.mean(drift**2)), change, shape, float(np.mean((left - repeated) ** 2)))
    return {part: math.sqrt(square) for part, square in zip(PARTS, squares, strict=True)}
