"""What was done with the muscle: what was held or moved, the data to hold out, and what to compare
with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.checking.evidence import settling, two_digits
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.signals.cycles import SWING, split_cycles, turning_points
from mapmore_cli.modelling.signals.plateau import default_within, find_levels, match_levels
from mapmore_cli.spec.units import default_unit

LESS = 0.5  # of the other's travel, that the held quantity makes at most
TIGHT = 0.06  # of the distance of levels, that samples of one lie within
BETWEEN = 0.02  # of the samples, that may lie between levels
RESTS = 0.5  # of the samples between the ends of the range, that are settled on a staircase
CYCLE_SAMPLES = 200
FEWEST, MOST = 200, 6_000  # samples of a record with memory, at first
BREAK = 5  # steps without a sample, that are a gap
LAST = 0.3  # of the samples, held out where no level and no recording can be
COMPETITORS = ("sarosi", "polynomial_2", "polynomial_5", "muscle_like", "polynomial_3")


@dataclass(frozen=True)
class Held:
    """The held quantity `of`, its levels `at`, `within` where samples between levels have to be
    kept out, and the quantity `swept`.
    """

    of: str
    at: Array
    within: float | None
    swept: str


def find_held(
    recordings: Sequence[Recording], names: tuple[str, str], hold: str | None = None
) -> Held | None:
    """Find which of two quantities was held while the other moved: the one that travels less than
    half as far, relative to its range.

    Or the one that a person says was held (`hold`). None where both move, where nothing was held
    (`none`), or at a single level.
    """
    if hold == "none":
        return None
    travels = {name: _travel(recordings, name) for name in names}
    of, swept = sorted(names, key=lambda name: (name != hold, travels[name]))
    values = np.concatenate([recording.columns[of] for recording in recordings])
    if not np.ptp(values) or (hold is None and travels[of] > LESS * travels[swept]):
        return None
    levels = find_levels(values)
    own = _level_of_each(recordings, of)
    levels = own if own is not None and len(levels) > len(own) else levels
    if len(levels) < 2:
        return None
    at, within = _neat_levels(values, levels)
    reached = np.unique(match_levels(values, at, within or default_within(at)))
    return Held(of, at[reached[reached >= 0]], within, swept)


def _level_of_each(recordings: Sequence[Recording], name: str) -> Array | None:
    """Return the middle of each recording, ascending, where each has a range of its own: one level
    that drifts, as while a muscle is pulled.
    """
    series = [one.columns[name] for one in recordings if one.rows_kept]
    ends = sorted(tuple(np.quantile(values, (0.05, 0.95)).tolist()) for values in series)
    apart = all(lower[1] < upper[0] for lower, upper in pairwise(ends))
    middles = sorted((float(values.min()) + float(values.max())) / 2 for values in series)
    return np.array(middles) if len(series) > 1 and apart else None


def _travel(recordings: Sequence[Recording], name: str) -> float:
    """Return how far a quantity moves within the recordings, in units of its range over all of
    them.
    """
    series = [recording.columns[name] for recording in recordings]
    span = float(np.ptp(np.concatenate(series)))
    turns = [turning_points(values, SWING * span) for values in series]
    way = sum(float(np.abs(np.diff(v[t])).sum()) for v, t in zip(series, turns, strict=True))
    return way / span if span else 0.0


def _neat_levels(values: Array, levels: Array) -> tuple[Array, float | None]:
    """Return the levels with as few digits as the scatter of their samples allows, and how near a
    sample has to be to its level: 249.9 +- 0.7 was meant to be 250. None where few samples lie
    between levels.
    """
    half = default_within(levels)
    nearest = match_levels(values, levels, np.inf)
    off = np.abs(values - levels[nearest])
    scatter = [float(np.median(off[nearest == place])) for place in range(len(levels))]
    rounded = []
    for level, spread in zip(levels.tolist(), scatter, strict=True):
        near = min(spread, TIGHT * half)
        shorter = (round(level, digits) + 0.0 for digits in range(-6, 7))
        rounded.append(next((one for one in shorter if abs(one - level) <= near), level))
    tight = max(2 * TIGHT * half, *(7 * spread for spread in scatter))
    is_worth_it = tight < half and np.mean((off > tight) & (off <= half)) > BETWEEN
    distinct = np.array(rounded if len(set(rounded)) == len(levels) else levels)
    return distinct, two_digits(tight) if is_worth_it else None


def goes_in_cycles(recordings: Sequence[Recording], held: Held) -> bool:
    """Return True where the swept quantity goes there and back at every level of every
    recording.
    """
    within = held.within or default_within(held.at)
    for recording in recordings:
        place = match_levels(recording.columns[held.of], held.at, within)
        for level in np.unique(place[place >= 0]):
            try:
                split_cycles(recording.columns[held.swept][place == level], {}, CYCLE_SAMPLES)
            except DataError:
                return False
    return True


def with_experiment(
    draft: Draft,
    recordings: Sequence[Recording],
    target: str,
    inputs: Sequence[str],
    held: Held | None,
) -> Draft:
    """Return the draft with its target, static samples and levels, and what is held out: static
    where something was held, or no clock is known, else with memory.
    """
    draft = draft.with_section("target", "static" if target == "force" else {"column": target})
    samples = sum(one.rows_kept for one in recordings)
    if held is None and "time" in recordings[0].columns and samples >= FEWEST:
        return _as_memory_study(draft.with_section("target", {"column": target}), recordings)
    if held is not None:
        draft = _with_levels(_with_static_samples(draft, recordings, held), recordings, held)
    draft = _with_split(draft, recordings)
    if target != "force":
        return draft
    formulas = [
        name
        for name in COMPETITORS
        if {*literature.get(name).inputs} <= {*inputs}
        and len(literature.get(name).parameters) < samples
    ]
    return draft.with_section("validate", {"against": formulas}) if formulas else draft


def levels_to_hold_out(levels: Sequence[float]) -> list[float]:
    """Return levels to hold out: every third of six or more, one of fewer; never the first or the
    last.
    """
    if len(levels) >= 6:
        return list(levels[2:-1:3])
    return [levels[(len(levels) + 1) // 2 if len(levels) > 3 else 1]] if len(levels) > 2 else []


def _with_static_samples(draft: Draft, recordings: Sequence[Recording], held: Held) -> Draft:
    """Return the draft with the samples at which steps of the pressure have settled, or with loops
    split into branches.
    """
    is_timed = held.swept == "pressure" and "time" in recordings[0].columns
    settled = settling(recordings) if is_timed else None
    if settled is not None and settled.share_between > RESTS:
        rule = {"rate_of": "pressure", "window": settled.window, "order": 2}
        rate = draft.data.get("derive", {}) | {"pressure_rate": rule}
        draft = draft.with_data("derive", rate).with_data(
            "keep", [{"quantity": "pressure_rate", "abs_below": settled.limit}]
        )
        why = f"kPa/s: the pressure rests on steps; {settled.share:.0%} of the samples are static"
        return draft.noted(("data", "keep", 0), why)
    if goes_in_cycles(recordings, held):
        why = (
            f"{held.swept} goes there and back at every level: the mean of both branches is "
            "static, half their difference is `target: hysteresis`"
        )
        return draft.with_data("cycles", {"over": held.swept, "samples": CYCLE_SAMPLES}, why)
    return draft


def _with_levels(draft: Draft, recordings: Sequence[Recording], held: Held) -> Draft:
    at = [float(f"{level:.6g}") for level in held.at]
    levels: dict[str, Any] = {"of": held.of, "at": at}
    unit = "" if default_unit(held.of) == "1" else f" {default_unit(held.of)}"
    files = f"{len(recordings)} file{'s' if len(recordings) > 1 else ''}"
    why = f"{files}, {held.of} held at {' '.join(f'{level:g}' for level in at)}{unit}"
    if held.within is not None:
        levels["within"] = held.within
        why += "; samples further off are on the way to the next level"
    return draft.with_data("levels", levels, why)


def _with_split(draft: Draft, recordings: Sequence[Recording]) -> Draft:
    """Return the draft with inner levels held out, else every third recording, else the last
    samples where these are in order.
    """
    levels = draft.data.get("levels")
    names = [one.id for one in recordings]
    if levels is not None and (inner := levels_to_hold_out(levels["at"])):
        return draft.with_data("split", {"validate": {levels["of"]: inner}}, "inner levels")
    if levels is None and len(names) > 2:
        return draft.with_data("split", {"validate": {"recordings": names[1:-1:3]}})
    if "cycles" in draft.data:
        return draft
    return draft.with_data("split", {"validate": {"last": LAST}}, "the last of every recording")


def _as_memory_study(draft: Draft, recordings: Sequence[Recording]) -> Draft:
    """Return the draft with even steps, and the end of every recording held out."""
    times = [one.columns["time"] for one in recordings if one.rows_kept > 1]
    usual = float(np.median(np.concatenate([np.diff(time) for time in times])))
    step = two_digits(max(usual, sum(float(np.ptp(time)) for time in times) / MOST))
    draft = draft.with_data(
        "resample",
        step,
        f"s: terms with memory need even steps; the record has one sample in {usual:.3g} s",
    )
    limit = two_digits(BREAK * max(step, usual))
    gaps = sum(int(np.count_nonzero(np.diff(time) > limit)) for time in times)
    if gaps or "gaps" in draft.data:
        why = f"s: {gaps} gap{'s' if gaps != 1 else ''}, at which memory begins anew"
        draft = draft.with_data("gaps", {"longer_than": limit, "action": "split"}, why)
    draft = draft.with_data("split", {"validate": {"last": LAST}}, "the last of every recording")
    return draft.with_section(
        "validate",
        {"normaliser": "range"},
        "errors are divided by the range: the zero is arbitrary",
    )
