"""What was done with the muscle: what was held, at which levels, load cycles or steps, and the data to hold out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.modelling.signals.cycles import split_cycles, turning_points
from mapmore_cli.modelling.signals.plateau import default_within, find_levels, match_levels
from mapmore_cli.spec.units import default_unit
from mapmore_cli.study.drafting.draft import Draft
from mapmore_cli.study.inspection.evidence import Settling, settling, two_digits

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


def find_held(recordings: Sequence[Recording], names: tuple[str, str], hold: str | None = None) -> Held | None:
    """Find which of two quantities was held while the other moved: the one that travels less than half as far, relative to its range.

    Or the one that a person says was held (`hold`). None where both move, where nothing was held (`none`), or at a single level.
    """
    if hold == "none":
        return None
    travels = {name: _travel(recordings, name) for name in names}
    of, swept = sorted(names, key=lambda name: (name != hold, travels[name]))
    values = np.concatenate([recording.columns[of] for recording in recordings])
    if not np.ptp(values) or (hold is None and travels[of] > LESS * travels[swept]):
        return None
    levels = find_levels(values)
    own = _one_each(recordings, of)
    levels = own if own is not None and len(levels) > len(own) else levels
    return Held(of, _neat(values, levels), _within(values, levels), swept) if len(levels) > 1 else None


def _one_each(recordings: Sequence[Recording], name: str) -> Array | None:
    """Return the level of each recording, ascending, where each has a range of its own: one level that drifts, as while a muscle is pulled.

    It is the median, unless this is so far off the middle that the samples of a recording come nearer to the level of another: they would
    be a cycle there.
    """
    series = sorted((one.columns[name] for one in recordings if one.rows_kept), key=lambda values: float(np.median(values)))
    apart = all(np.quantile(lower, 0.95) < np.quantile(upper, 0.05) for lower, upper in pairwise(series))
    if len(series) < 2 or not apart:
        return None
    medians, middles = (np.array([float(middle(values)) for values in series]) for middle in (np.median, _middle))
    return middles if _strays(series, medians) > _strays(series, middles) else medians


def _middle(values: Array) -> float:
    """Half way between the least and the largest."""
    return float(values.min() + values.max()) / 2


def _strays(series: Sequence[Array], levels: Array) -> int:
    """How many samples of recordings are nearer to the level of another one, or at none."""
    return sum(int(np.count_nonzero(match_levels(values, levels, default_within(levels)) != own)) for own, values in enumerate(series))


def _travel(recordings: Sequence[Recording], name: str) -> float:
    """How far a quantity moves within the recordings, in units of its range over all of them."""
    series = [recording.columns[name] for recording in recordings]
    span = float(np.ptp(np.concatenate(series)))
    turns = [turning_points(values, SWING * span) for values in series]
    return sum(float(np.abs(np.diff(v[t])).sum()) for v, t in zip(series, turns, strict=True)) / span if span else 0.0


def _neat(values: Array, levels: Array) -> Array:
    """Return the levels with as few digits as the spread of their samples allows: 249.9 +- 0.7 was meant to be 250."""
    off = values - levels[match_levels(values, levels, np.inf)]
    near = np.abs(off) < 2 * TIGHT * default_within(levels)
    nearest = match_levels(values, levels, np.inf)
    around = [off[near & (nearest == i)] if (near & (nearest == i)).any() else off[nearest == i] for i in range(len(levels))]
    neat = [_shortest(float(level), float(np.std(own))) for level, own in zip(levels, around, strict=True)]
    return np.array(neat if len(set(neat)) == len(levels) else levels)


def _shortest(value: float, tolerance: float) -> float:
    """Return the number with the fewest digits within the tolerance."""
    return next((round(value, d) + 0.0 for d in range(-6, 7) if abs(round(value, d) - value) <= tolerance), value)


def _within(values: Array, levels: Array) -> float | None:
    """How near a sample has to be to its level; None where half the distance of levels will do."""
    spacing = 2 * default_within(levels)
    nearest = match_levels(values, levels, np.inf)
    off = np.abs(values - levels[nearest])
    tight = max(TIGHT * spacing, *(7.0 * float(np.median(off[nearest == i])) for i in range(len(levels))))
    return two_digits(tight) if tight < spacing / 2 and np.mean((off > tight) & (off <= spacing / 2)) > TRANSITION else None


def goes_in_cycles(recordings: Sequence[Recording], held: Held, samples: int) -> bool:
    """Return True where the swept quantity goes there and back at every level of every recording."""
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


CYCLE_SAMPLES = 200
MANY = 6  # levels, beyond which a note does not repeat them
LARGEST_SHARE = 0.5  # of the samples, that are held out
BAND = (0.4, 0.55)  # of the range, held out where there are no levels
FEW_LEVELS, MANY_LEVELS = 3, 6  # from which an inner one, and every third, can be spared


def with_experiment(draft: Draft, recordings: Sequence[Recording], held: Held | None) -> Draft:
    """Return the draft with cycles or settled samples, levels and split, given what was `held`."""
    if held is not None:
        draft = _with_levels(_with_static_samples(draft, recordings, held), recordings, held)
    return _with_split(draft, recordings, held)


def inner_levels(levels: Sequence[float]) -> list[float]:
    """Levels to hold out: every third of many, the one above the middle of few; never the first or the last."""
    if len(levels) >= MANY_LEVELS:
        return list(levels[2:-1:3])
    if len(levels) > FEW_LEVELS:
        return [levels[(len(levels) + 1) // 2]]
    return [levels[1]] if len(levels) == FEW_LEVELS else []


def _with_static_samples(draft: Draft, recordings: Sequence[Recording], held: Held) -> Draft:
    """Return the draft with the samples at which steps of the pressure have settled, or with loops split into branches."""
    settled = staircase(recordings) if held.swept == "pressure" and "time" in recordings[0].columns else None
    if settled is not None:
        rule = {"rate_of": "pressure", "window": settled.window, "order": 2}
        why = f"kPa/s: the pressure rests on steps, {settled.share:.0%} of the samples change less, and only these are static"
        draft = draft.with_data("derive", {"pressure_rate": rule}, f"to find settled samples; a window of {settled.window:g} s")
        return draft.with_data("keep", [{"quantity": "pressure_rate", "abs_below": settled.limit}]).noted(("data", "keep", 0), why)
    if goes_in_cycles(recordings, held, CYCLE_SAMPLES):
        why = f"{held.swept} goes there and back at every level: the mean of both branches is static, half their difference is `hysteresis`"
        return draft.with_data("cycles", {"over": held.swept, "samples": CYCLE_SAMPLES}, why)
    return draft


def _with_levels(draft: Draft, recordings: Sequence[Recording], held: Held) -> Draft:
    at = [float(f"{level:.6g}") for level in held.at]
    levels: dict[str, Any] = {"of": held.of, "at": at}
    told = " ".join(f"{level:g}" for level in at) if len(at) <= MANY else f"{len(at)} levels from {at[0]:g} to {at[-1]:g}"
    unit = "" if default_unit(held.of) == "1" else f" {default_unit(held.of)}"
    why = f"{len(recordings)} file{'s' if len(recordings) > 1 else ''}, {held.of} held at {told}{unit}"
    if held.within is not None:
        levels["within"] = held.within
        why += "; samples further off are on the way to the next level"
    return draft.with_data("levels", levels, why)


def _with_split(draft: Draft, recordings: Sequence[Recording], held: Held | None) -> Draft:
    inner = inner_levels(draft.data["levels"]["at"]) if held is not None else []
    if held is not None and inner:
        why = "an inner level is held out" if len(inner) == 1 else "every third level is held out, the first and the last never"
        return draft.with_data("split", {"validate": {held.of: inner}}, why)
    swept = held.swept if held is not None else "pressure"
    values = np.concatenate([recording.columns[swept] for recording in recordings])
    low, high = (float(f"{values.min() + share * np.ptp(values):.6g}") for share in BAND)
    inside = np.mean((values >= low) & (values <= high))
    if not 0 < inside < LARGEST_SHARE:
        return draft
    why = f"no level can be spared: a band of {swept} is held out"
    return draft.with_data("split", {"validate": {swept: {"between": [[low, high]]}}}, why, False)
