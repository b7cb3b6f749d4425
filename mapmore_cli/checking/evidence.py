"""Find facts in the values of recordings: how often the pressure is at rest, which columns contain
the same signal, whether outputs differ at equal inputs, and where a signal has spikes.
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

# smallest number of samples that are examined; with fewer, a finding may be due to chance
FEWEST = 30
# largest number of recordings that are compared; if there are more, every n-th is compared
COMPARED = 200
# A target is a linear function of a column if it deviates by at most this fraction of its range.
# Two columns contain the same signal if their absolute correlation is at least 1 minus this number.
ROUNDING = 1e-4
# a part of the samples, or of a range, may be due to chance if it is below this fraction
LITTLE = 0.01
# a part of the samples, or of a range, is worth a warning if it is above this fraction
SOME = 0.05
# a part of the samples, or of a difference, is the greater part if it is above this fraction
MUCH = 0.5

# a pressure is settled if it changes by less than this fraction of its range per second
SLOW = 0.04
SHORTEST = 0.1  # smallest width of the window in which the rate of the pressure is computed, s
SAMPLES = 8  # smallest number of samples in the window in which the rate is computed
# the middle of the pressure range lies between these two fractions of the range
MIDDLE = (0.1, 0.9)


@dataclass(frozen=True)
class Settling:
    """Result of `settling`: how much of the time a pressure is settled.

    A sample is settled if the pressure changes there by less than `limit` per second. The rate of
    change is computed in a window of `window` seconds. `share` is the fraction of all samples that
    are settled. `share_between` is the fraction that is settled among the samples in the middle of
    the pressure range. It is large if the pressure moves in steps, because the pressure then also
    rests in the middle of its range. It is small if the pressure moves steadily through its range.
    """

    limit: float
    share: float
    share_between: float
    window: float


def settling(recordings: Sequence[Recording], unit: str = "s") -> Settling | None:
    """Return how much of the time the pressure is settled in the recordings. `unit` is the unit of
    their column `time`.

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
    # this error is raised if the time stamps have a gap that is wider than the window
    except DataError:
        return None
    settled = np.abs(rates) < limit
    low, high = (pressures.min() + place * np.ptp(pressures) for place in MIDDLE)
    between = settled[(pressures > low) & (pressures < high)]
    return Settling(
        limit, float(np.mean(settled)), float(np.mean(between)) if between.size else 0.0, window
    )


def two_digits(value: float) -> float:
    """Return a positive number rounded to two significant digits."""
    return float(f"{round(value, 1 - math.floor(math.log10(value))):.6g}")


# Repeated signals
# --------------------------------------------------------------------------------------------------


def same_signals(columns: Sequence[Array]) -> list[list[int]]:
    """Return groups of columns, (n,) each, that contain the same signal: in a group, each column is
    nearly a linear function `a y + b` of any other column y. Each group is a list of at least two
    indices of columns. Columns that are constant or shorter than `FEWEST` are left out.

    Two columns of different lengths are not compared. Their lengths differ, for example, if values
    are missing in one of them.
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
    """Two recordings whose inputs are equal, sample for sample, but whose outputs differ.

    All numbers are root mean squares divided by the range of the `target`. `apart` is the
    difference between the two outputs. `left` holds the difference that remains after one output is
    fitted to the other by a factor (`gain`), by a constant (`offset`), or by both (`offset gain`).
    """

    one: Recording
    other: Recording
    inputs: tuple[str, ...]
    target: str
    apart: float
    left: Mapping[str, float]

    @property
    def effects(self) -> list[str]:
        """Names of the effects that explain the difference, as the section `data.groups` names
        them: `gain`, `offset`, or both. Usually only the better effect is returned, which leaves a
        smaller difference than the other effect. Both are returned if the better effect leaves more
        than 5 % of the difference, and both together leave less than half of what it leaves. The
        list is empty if at least half of the difference remains.
        """
        best = min(("gain", "offset"), key=lambda effect: self.left[effect])
        both = "offset gain"
        if self.left[best] > SOME * self.apart and self.left[both] < MUCH * self.left[best]:
            best = both
        return best.split() if self.left[best] < MUCH * self.apart else []

    @property
    def is_large(self) -> bool:
        """Return True if the outputs differ by more than 5 % of the range of the target.
        Repetitions of the same measurement hardly ever differ so much.
        """
        return self.apart > SOME

    def words(self) -> str:
        """Return a sentence that states by how much the two outputs differ, and which share of the
        squared difference is explained by a gain, by an offset, and by both.
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
    samples as the longer one. Inputs that were held constant are not compared; their range over all
    recordings is at most 1 % of their largest absolute value. Of more than 200 recordings, only
    some that are evenly spread are compared.
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
    """Yield every pair of recordings with equal inputs, together with the number of samples of the
    shorter recording. `ranges` holds the range of each input.
    """
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
    """Return the root mean square of the difference of two outputs, and what remains of it after
    one output is corrected by a gain, by an offset, or by both.
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

# smallest ratio of the height of a spike to the largest other change between samples
STANDS_OUT = 4.0


def spikes(values: Array) -> IntArray:
    """Return the indices of the spikes in a record, (n,): single samples that are much larger, or
    much smaller, than both neighbours.

    The height of a spike is its distance from the nearer neighbour. It is at least four times the
    difference of the two neighbours. It is larger than four times the largest change between other
    samples, and larger than a quarter of the range of the other samples. Steps, and signals with
    only two values, have no spikes. If there are several spikes, and they are more than 1 % of the
    samples, nothing is returned, because spikes are then a property of the signal. Nothing is
    returned for a record of fewer than `FEWEST` samples either.
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
    # if all other values are equal, nothing is reported as a spike
    return lone[height[lone] > usual] if span else none


def _heights(x: Array) -> Array:
    """Return the height of each sample as a spike, (n - 2,), without the first and the last sample.
    If a sample is larger, or smaller, than both neighbours, the height is its distance from the
    nearer neighbour. The height is negative if the sample lies between its neighbours.
    """
    steps = np.diff(x)
    before, after = steps[:-1], steps[1:]
    height: Array = np.maximum(np.minimum(before, -after), np.minimum(-before, after))
    return height
