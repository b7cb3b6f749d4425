"""What the numbers of recordings show: rest, one signal in two units, outputs that differ at equal
inputs, and spikes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray, extremes, row_blocks
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Recording, united
from mapmore_cli.modelling.signals.rates import rate
from mapmore_cli.modelling.signals.sampling import PART, correlation, even_parts, even_share
from mapmore_cli.study.units import convert

FEWEST = 30  # samples, below which what they show may be chance
COMPARED = 200  # recordings, one with each other: of more, an even share
ROUNDING = 1e-4  # of a range or a correlation: columns that agree so far are one
LITTLE = 0.01  # of samples or a range: may be chance
SOME = 0.05  # of samples or a range: is worth a warning
MUCH = 0.5  # of samples, a value or a difference: is most of it

SLOW = 0.04  # of the pressure range per second
SHORTEST = 0.1  # s, width of the window in which the rate is found
SAMPLES = 8  # that the window must hold
MIDDLE = (0.1, 0.9)  # of the pressure range


@dataclass(frozen=True)
class Settling:
    """How a pressure settles.

    A sample counts as settled below the rate `limit` per second, a round number, found in a
    `window` in s. That is a `share` of all samples, and `share_between` of those in the middle of
    the pressure range: staircases rest there, and sweeps do not.
    """

    limit: float
    share: float
    share_between: float
    window: float


def settling(recordings: Sequence[Recording], unit: str = "s") -> Settling | None:
    """Find which share of the samples is settled, of recordings with a pressure and a time in
    `unit`.

    None if the pressure does not move, or the time stamps do not let a rate be found.
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
    except DataError:  # gaps that are wider than the window
        return None
    settled = np.abs(rates) < limit
    low, high = (pressures.min() + place * np.ptp(pressures) for place in MIDDLE)
    between = settled[(pressures > low) & (pressures < high)]
    return Settling(
        limit, float(np.mean(settled)), float(np.mean(between)) if between.size else 0.0, window
    )


def two_digits(value: float) -> float:
    """Return a positive number, rounded to two digits, as a person would choose it."""
    return float(f"{round(value, 1 - math.floor(math.log10(value))):.6g}")


# One signal in two units
# --------------------------------------------------------------------------------------------------


def same_signals(columns: Sequence[Array]) -> list[list[int]]:
    """Return the places of columns `(n,)` that are one another times a constant, plus one, a list
    for each repeated signal.

    Columns of different lengths, as where one lacks values, are not compared.
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


# Equal inputs, unequal outputs
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Unequal:
    """Two recordings whose inputs are equal, sample for sample, and whose outputs differ.

    All are root mean squares relative to the range of the `target`: how far the outputs are
    `apart`, and what remains (`left`) where one is taken as a factor times the other (`gain`), as
    the other plus a constant (`offset`), or as both (`offset gain`).
    """

    one: Recording
    other: Recording
    inputs: tuple[str, ...]
    target: str
    apart: float
    left: Mapping[str, float]

    @property
    def effects(self) -> list[str]:
        """What tells most of the difference, as `data.groups` calls it: the one that leaves less,
        or both where they leave far less together; empty if most of the difference remains.
        """
        best = min(("gain", "offset"), key=lambda effect: self.left[effect])
        both = "offset gain"
        if self.left[best] > SOME * self.apart and self.left[both] < MUCH * self.left[best]:
            best = both
        return best.split() if self.left[best] < MUCH * self.apart else []

    @property
    def is_large(self) -> bool:
        """Whether hardly any repetition differs so far."""
        return self.apart > SOME

    def words(self) -> str:
        """Return it as a sentence, with what each effect explains of the sum of squares."""
        gain, offset, both = (f"{1 - (left / self.apart) ** 2:.0%}" for left in self.left.values())
        return (
            f"{self.other.name} has the same {', '.join(self.inputs)} as {self.one.name}, "
            f"but {self.target} differs by {self.apart:.2g} of its range (rms); a factor "
            f"between the two explains {gain} of the difference, an offset {offset}, both "
            f"together {both}"
        )


def unequal(recordings: Sequence[Recording], inputs: Sequence[str], target: str) -> Unequal | None:
    """Return the two recordings whose outputs differ most at equal inputs; None if these differ
    by less than 1 % of the range of the target, or by less than 5 % that nothing explains.

    Inputs are equal where they differ by less than 1 % of their ranges (rms), from the first sample
    to the end of the shorter recording, which has half of the samples at least. What stays within
    1 % of its largest value was held. Of more than 200 recordings an even share is compared.
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
    """Yield all pairs of recordings with equal inputs, and how many samples they have in common."""
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
                _rms(first.columns[x][some] - other.columns[x][some]) < LITTLE * size
                for x, size in ranges.items()
            ):
                yield first, other, few


def _left(first: Array, second: Array) -> tuple[float, dict[str, float]]:
    """Return how far outputs are apart, and what a gain, an offset and both leave of it."""
    less, more = sorted((first, second), key=_rms)
    ones, apart = np.ones_like(more), less - more

    def left(values: Array, *terms: Array) -> float:
        basis = np.column_stack(terms)
        return _rms(values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0])

    return _rms(apart), {
        "gain": left(less, more),
        "offset": left(apart, ones),
        "offset gain": left(less, more, ones),
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


# Single samples
# --------------------------------------------------------------------------------------------------

STANDS_OUT = 4.0  # times as high as anything else changes


def spikes(values: Array) -> IntArray:
    """Return the numbers of the samples of a record, `(n,)`, that stand alone far from their
    neighbours; none if these are more than 1 %, which is what was measured.

    Such a sample lies to one side of both neighbours. It is four times as high as these differ, as
    the record changes from one sample to the next anywhere else, and as a quarter of its range:
    steps, and signals of two values, have no such sample.
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
    # where a record rests, nothing says what is far
    return lone[height[lone] > usual] if span else none


def _heights(x: Array) -> Array:
    """Return how far each sample but the ends lies from its nearest neighbour, (n - 2,); below zero
    where it lies between both.
    """
    steps = np.diff(x)
    before, after = steps[:-1], steps[1:]
    height: Array = np.maximum(np.minimum(before, -after), np.minimum(-before, after))
    return height
