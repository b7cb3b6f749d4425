"""What recordings show of the experiment: what was held, at which levels, whether it went back and forth, whether it settled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.modelling.signals.cycles import split_cycles, turning_points
from mapmore_cli.modelling.signals.levels import default_within, find_levels, match_levels
from mapmore_cli.stages.inspection.settling import Settling, settling, two_digits

SWING = 0.1  # of the pooled range: smaller reversals are noise
LESS = 0.5  # of the other's travel, that the held quantity makes at most
RESTS = 0.5  # of the samples between the ends of the range, that are settled on a staircase
TRANSITION = 0.02  # of the samples, that may lie between levels before `within` matters
TIGHT = 0.06  # of the distance of levels


@dataclass(frozen=True)
class Held:
    """The held quantity `of`, its levels `at`, `within` where samples between levels have to be kept out, and the quantity `swept`."""

    of: str
    at: Array
    within: float | None
    swept: str


def find_held(recordings: Sequence[Recording], names: tuple[str, str]) -> Held | None:
    """Find which of two quantities was held while the other moved: the one that travels less than half as far, relative to its range.

    None where both move, or where what is held has a single level.
    """
    travels = {name: _travel(recordings, name) for name in names}
    of, swept = sorted(names, key=travels.__getitem__)
    values = np.concatenate([recording.columns[of] for recording in recordings])
    if not np.ptp(values) or travels[of] > LESS * travels[swept]:
        return None
    levels = find_levels(values)
    return Held(of, _neat(values, levels), _within(values, levels), swept) if len(levels) > 1 else None


def _travel(recordings: Sequence[Recording], name: str) -> float:
    """How far a quantity moves within the recordings, in units of its range over all of them."""
    series = [recording.columns[name] for recording in recordings]
    span = float(np.ptp(np.concatenate(series)))
    turns = [turning_points(values, SWING * span) for values in series]
    return sum(float(np.abs(np.diff(v[t])).sum()) for v, t in zip(series, turns, strict=True)) / span if span else 0.0


def _neat(values: Array, levels: Array) -> Array:
    """The levels with as few digits as the spread of their samples allows: 249.9 +- 0.7 was meant to be 250."""
    off = values - levels[match_levels(values, levels, np.inf)]
    near = np.abs(off) < 2 * TIGHT * default_within(levels)
    nearest = match_levels(values, levels, np.inf)
    neat = [_shortest(float(level), float(np.std(off[near & (nearest == i)]))) for i, level in enumerate(levels)]
    return np.array(neat if len(set(neat)) == len(levels) else levels)


def _shortest(value: float, tolerance: float) -> float:
    """The number with the fewest digits within the tolerance."""
    return next((round(value, d) + 0.0 for d in range(-6, 7) if abs(round(value, d) - value) <= tolerance), value)


def _within(values: Array, levels: Array) -> float | None:
    """How near a sample has to be to its level; None where half the distance of levels will do."""
    spacing = 2 * default_within(levels)
    nearest = match_levels(values, levels, np.inf)
    off = np.abs(values - levels[nearest])
    tight = max(TIGHT * spacing, *(7.0 * float(np.median(off[nearest == i])) for i in range(len(levels))))
    return two_digits(tight) if tight < spacing / 2 and np.mean((off > tight) & (off <= spacing / 2)) > TRANSITION else None


def goes_in_cycles(recordings: Sequence[Recording], held: Held, samples: int) -> bool:
    """True where the swept quantity goes there and back at every level of every recording."""
    for recording in recordings:
        place = match_levels(recording.columns[held.of], held.at, held.within or default_within(held.at))
        for level in np.unique(place[place >= 0]):
            try:
                split_cycles(recording.columns[held.swept][place == level], {}, samples)
            except DataError:
                return False
    return True


def staircase(recordings: Sequence[Recording]) -> Settling | None:
    """How the pressure settles, where it rests in between: most samples in the middle of its range are slow. None for sweeps."""
    found = settling([(recording.columns["time"], recording.columns["pressure"]) for recording in recordings])
    return found if found is not None and found.share_between > RESTS and found.share < 1 - TRANSITION else None
