"""Find facts in the numbers of recordings: rest, one signal in two units, different outputs at
equal inputs, and spikes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray, extremes, root_mean_square, row_blocks
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Recording, united
from mapmore_cli.modelling.signals.rates import rate
from mapmore_cli.modelling.signals.sampling import PART, correlation, even_parts, even_share
from mapmore_cli.study.units import convert

FEWEST = 30  # smallest number of samples; with fewer, a finding may be due to chance
# largest number of recordings that are compared with each other, evenly spread over all
COMPARED = 200
# A target was computed from a column if it lies on a line up to this fraction of its range.
# Two columns are one signal if the magnitude of their correlation is at least 1 minus this number.
ROUNDING = 1e-4
LITTLE = 0.01  # below this fraction of the samples or of a range, a finding may be due to chance
SOME = 0.05  # above this fraction of the samples or of a range, a finding is worth a warning
# limit between the smaller and the greater part: of samples, a difference, or the largest value
MUCH = 0.5

SLOW = 0.04  # largest rate of a settled pressure, as a fraction of the pressure range per second
SHORTEST = 0.1  # smallest width of the window for the rate, s
SAMPLES = 8  # smallest number of samples in the window
MIDDLE = (0.1, 0.9)  # limits of the middle of the pressure range, as fractions of the range


@dataclass(frozen=True)
class Settling:
    """Settling of a pressure.

    A sample is settled if the pressure changes there by less than `limit` per second. The rate is
    computed in a `window` (s). `share` is the settled share of all samples. `share_between` is the
    settled share of the samples in the middle of the pressure range. This share is large if the
    pressure moves in steps, because the pressure then rests in the middle of its range, too. It is
    small for a sweep.
    """

    limit: float
    share: float
    share_between: float
    window: float


def settling(recordings: Sequence[Recording], unit: str = "s") -> Settling | None:
    """Return the share of settled samples in recordings of a pressure. `unit` is the unit of their
    time.

    Return None if the pressure is constant, or if no rate can be computed from the time stamps.
    """
    records = [
        (convert(recording.columns["time"][part], unit, "s"), recording.columns["pressure"][part])
        for recording in recordings
        for part in even_parts(recording.rows_kept)
        if recording.rows_kept
    ]
    pressures = np.concatenate([pressure for _, pressure in records])
    steps = np.concatenate([np.diff(time) for time, _ in records])
    if not np.ptp(pressures) or not (steps > 0).any() or (steps < 0).any():
        return None
    window = max(SHORTEST, two_digits(SAMPLES * float(np.mean(steps))))
    limit = two_digits(SLOW * float(np.ptp(pressures)))
    try:
        rates = np.concatenate(
            [rate(time, pressure, window, order=2) for time, pressure in records]
        )
    except DataError:  # some gaps are wider than the window of the rate
        return None
    settled = np.abs(rates) < limit
    low, high = (pressures.min() + place * np.ptp(pressures) for place in MIDDLE)
    between = settled[(pressures > low) & (pressures < high)]
    return Settling(
        limit, float(np.mean(settled)), float(np.mean(between)) if between.size else 0.0, window
    )


def two_digits(value: float) -> float:
    """Return a positive number rounded to two digits, as a person would choose it."""
    return float(f"{round(value, 1 - math.floor(math.log10(value))):.6g}")


# Repeated signals
# --------------------------------------------------------------------------------------------------


def same_signals(columns: Sequence[Array]) -> list[list[int]]:
    """Return groups of indices of columns, (n,), that equal each other up to a factor and an
    offset, one list for each repeated signal.

    Columns of different lengths, for example because one lacks values, are not compared.
    """
    families: list[list[int]] = []
    shares: dict[int, Array] = {}
    for place, column in enumerate(columns):
        if len(column) < FEWEST or not np.ptp(extremes(column)):
            continue
        shares[place] = even_share(column)
        same = [family for family in families if len(columns[family[0]]) == len(column)]
        alike = [
            family
            for family in same
            if abs(correlation(shares[family[0]], shares[place])) >= 1 - ROUNDING
        ]
        alike[0].append(place) if alike else families.append([place])
    return [family for family in families if len(family) > 1]


# Unexplained differences
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Unequal:
    """Two recordings with equal inputs, sample for sample, and different outputs.

    All numbers are root mean squares divided by the range of the `target`. `apart` is the distance
    between the outputs. `left` holds the distances that remain after one output is fitted to the
    other by a factor (`gain`), by a constant (`offset`), or by both (`offset gain`).
    """

    one: Recording
    other: Recording
    inputs: tuple[str, ...]
    target: str
    apart: float
    left: Mapping[str, float]

    @property
    def effects(self) -> list[str]:
        """Names of the effects that explain most of the difference, as they are written in
        `data.groups`: the effect that explains more, or both effects if together they leave much
        less of the difference than either alone. Empty if most of the difference remains.
        """
        best = min(("gain", "offset"), key=lambda effect: self.left[effect])
        both = "offset gain"
        if self.left[best] > SOME * self.apart and self.left[both] < MUCH * self.left[best]:
            best = both
        return best.split() if self.left[best] < MUCH * self.apart else []

    @property
    def is_large(self) -> bool:
        """Return True if the difference is larger than almost any difference between
        repetitions.
        """
        return self.apart > SOME

    def words(self) -> str:
        """Return a sentence about the difference of the two outputs, and about the share of this
        difference (of its sum of squares) that each effect explains.
        """
        gain, offset, both = (f"{1 - (left / self.apart) ** 2:.0%}" for left in self.left.values())
        return (
            f"{self.other.name} has the same {', '.join(self.inputs)} as {self.one.name}, "
            f"but {self.target} differs by {self.apart:.2g} of its range (rms); a factor "
            f"between the two explains {gain} of the difference, an offset {offset}, both "
            f"together {both}"
        )


def unequal(recordings: Sequence[Recording], inputs: Sequence[str], target: str) -> Unequal | None:
    """Return the two recordings whose outputs differ most at equal inputs. Return None if these
    outputs differ by less than 1 % of the target's range, or by less than 5 % without an effect
    that explains the difference.

    Inputs are equal if they differ by less than 1 % of their ranges (rms). They are compared from
    the first sample to the end of the shorter recording, which must have at least half as many
    samples as the longer one. A quantity was held constant if it stays within 1 % of its largest
    value. Of more than 200 recordings, only some that are evenly spread are compared.
    """
    usable = [recording for recording in recordings if recording.rows_kept >= FEWEST]
    if not usable:
        return None
    usable = usable[:: -(-len(usable) // COMPARED)]
    names = (*inputs, target)
    ends = united(
        [{name: extremes(recording.columns[name]) for name in names} for recording in usable]
    )
    ranges = {name: high - low for name, (low, high) in ends.items()}
    moving = {
        name: ranges[name] for name in inputs if ranges[name] > LITTLE * max(map(abs, ends[name]))
    }
    if not moving or not ranges[target]:
        return None
    pairs = []
    for first, other, rows in _with_equal_inputs(usable, moving):
        some = slice(0, rows, 1 + rows // PART)
        outputs = (each.columns[target][some] / ranges[target] for each in (first, other))
        pairs.append(Unequal(first, other, tuple(moving), target, *_left(*outputs)))
    telling = (pair for pair in pairs if pair.is_large or (pair.effects and pair.apart > LITTLE))
    return max(telling, key=lambda pair: pair.apart, default=None)


def _with_equal_inputs(
    recordings: Sequence[Recording], ranges: Mapping[str, float]
) -> Iterator[tuple[Recording, Recording, int]]:
    """Yield all pairs of recordings with equal inputs, and the length of the shorter recording."""
    begins = np.array(
        [
            [recording.columns[x][:FEWEST] / size for x, size in ranges.items()]
            for recording in recordings
        ]
    )
    for place, first in enumerate(recordings):
        off = np.sqrt(np.mean((begins[place + 1 :] - begins[place]) ** 2, axis=-1)).max(axis=-1)
        for near in np.flatnonzero(off < LITTLE).tolist():
            other = recordings[place + 1 + near]
            few, many = sorted((first.rows_kept, other.rows_kept))
            some = slice(0, few, 1 + few // PART)
            if few >= MUCH * many and all(
                root_mean_square(first.columns[x][some] - other.columns[x][some]) < LITTLE * size
                for x, size in ranges.items()
            ):
                yield first, other, few


def _left(first: Array, second: Array) -> tuple[float, dict[str, float]]:
    """Return the distance of two outputs, and the distances that remain after one of them is
    corrected by a gain, an offset, or both.
    """
    less, more = sorted((first, second), key=root_mean_square)
    ones, apart = np.ones_like(more), less - more

    def left(values: Array, *terms: Array) -> float:
        basis = np.column_stack(terms)
        return root_mean_square(values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0])

    return root_mean_square(apart), {
        "gain": left(less, more),
        "offset": left(apart, ones),
        "offset gain": left(less, more, ones),
    }


# Single samples
# --------------------------------------------------------------------------------------------------

STANDS_OUT = 4.0  # smallest ratio of the height of a spike to the largest other change


def spikes(values: Array) -> IntArray:
    """Return the indices of single samples in a record, (n,), that lie far from both neighbours.
    Nothing is returned if there are more such samples than 1 % of the record, because they are then
    a property of the signal.

    Such a sample lies to one side of both neighbours. Its height is at least four times the
    difference of the neighbours, four times the largest change anywhere else in the record, and a
    quarter of its range. Steps, and signals of two values, have no such sample.
    """
    none = np.zeros(0, dtype=np.int64)
    if len(values) < FEWEST:
        return none
    height = np.zeros(len(values))
    for rows in row_blocks(len(values) - 2):
        height[rows.start + 1 : rows.stop + 1] = _heights(values[rows.start : rows.stop + 2])
    lone = np.flatnonzero(height >= (height.max() / STANDS_OUT or np.inf))
    lone = lone[height[lone] >= STANDS_OUT * np.abs(values[lone + 1] - values[lone - 1])]
    if not 0 < lone.size <= max(1, LITTLE * len(values)):
        return none
    span = float(np.ptp(np.delete(values, lone)))
    steps = np.delete(np.abs(np.diff(values)), np.union1d(lone - 1, lone))
    usual = max(STANDS_OUT * float(steps.max(initial=0.0)), span / STANDS_OUT)
    # a record whose values are all equal has no spikes
    return lone[height[lone] > usual] if span else none


def _heights(x: Array) -> Array:
    """Return by how much the value of each sample (except the ends) lies above or below the values
    of both neighbours, (n - 2,). The result is negative if the value lies between the values of the
    neighbours.
    """
    steps = np.diff(x)
    before, after = steps[:-1], steps[1:]
    height: Array = np.maximum(np.minimum(before, -after), np.minimum(-before, after))
    return height
