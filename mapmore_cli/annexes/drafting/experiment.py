"""What was done with the muscle: what was held or moved, the data to hold out, what to compare
with, and its second component.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.annexes.drafting.recordings import cleaned, read_draft
from mapmore_cli.checking.evidence import (
    Settling,
    beyond,
    force_set,
    neighbourhood,
    remembered,
    settling,
    two_digits,
)
from mapmore_cli.checking.rules.curves import BEYOND
from mapmore_cli.checking.rules.samples import UNSETTLED
from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve, Dataset, Recording
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.signals.cycles import split_cycles, turning_points
from mapmore_cli.modelling.signals.plateau import default_within, find_levels, match_levels
from mapmore_cli.spec.units import default_unit

SWING = 0.1  # of the pooled range: smaller reversals are noise
LESS = 0.5  # of the other's travel, that the held quantity makes at most
RESTS = 0.5  # of the samples between the ends of the range, that are settled on a staircase
TRANSITION = 0.02  # of the samples, that may lie between levels before `within` matters
TIGHT = 0.06  # of the distance of levels
CYCLE_SAMPLES = 200
MANY = 6  # levels, beyond which a note does not repeat them
LARGEST_SHARE = 0.5  # of the samples, that are held out
BAND = (0.4, 0.55)  # of the range, held out where there are no levels
FEW_LEVELS, MANY_LEVELS = 3, 6  # from which an inner one, and every third, can be spared
FEWEST, MOST = (
    200,
    6_000,
    # samples of a record that is worth a model with memory, and to which records are resampled for
    # a
    # quick first try
)
BREAK = 5  # steps without a sample, that are a gap
# times the error of the input of now, that earlier ones leave at most where there is memory
HELPS = 0.8
WORTH = 0.02  # of the spread of the response: an error below leaves nothing to explain
STRETCHES = (
    (0.4, 0.6),
    (0.25, 0.5),
    (0.5, 0.75),
    (0.1, 0.35),
    (0.65, 0.9),
)  # of the time, that are held out where the end cannot be
OUTSIDE = 0.05  # of the held-out samples, that may lie beyond what trains
FURTHER = (
    0.05  # of the training range of the target, which overshoots; inputs may go `BEYOND` theirs
)
LAST, MOST_HELD = 0.5, 0.55  # of the samples
MOVED = 0.25  # of the range of the target, that it goes through in what is held out
COMPETITORS = ("sarosi", "polynomial_2", "polynomial_5", "muscle_like", "polynomial_3")
APART, ONE_WAY = (
    0.01,
    0.5,
    # of the largest force: half the difference worth a model; and of that its mean at least: noise
    # has
    # no side
)
LONGEST_NAME = 80
SEGMENTS = 4
ARCH = 2  # order of a polynomial that is one
COVERED = 0.5  # of the places that all curves reach, that each does


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
    own = _one_each(recordings, of)
    levels = own if own is not None and len(levels) > len(own) else levels
    return (
        Held(of, _neat(values, levels), _within(values, levels), swept) if len(levels) > 1 else None
    )


def _one_each(recordings: Sequence[Recording], name: str) -> Array | None:
    """Return the level of each recording, ascending, where each has a range of its own: one level
    that drifts, as while a muscle is pulled.

    It is the median, unless this is so far off the middle that the samples of a recording come
    nearer to the level of another: they would be a cycle there.
    """
    series = sorted(
        (one.columns[name] for one in recordings if one.rows_kept),
        key=lambda values: float(np.median(values)),
    )
    apart = all(
        np.quantile(lower, 0.95) < np.quantile(upper, 0.05) for lower, upper in pairwise(series)
    )
    if len(series) < 2 or not apart:
        return None
    medians = np.array([np.median(values) for values in series])
    middles = np.array([(values.min() + values.max()) / 2 for values in series])

    def strays(levels: Array) -> int:
        """How many samples of recordings are nearer to the level of another one, or at none."""
        return sum(
            int(np.count_nonzero(match_levels(values, levels, default_within(levels)) != own))
            for own, values in enumerate(series)
        )

    return middles if strays(medians) > strays(middles) else medians


def _travel(recordings: Sequence[Recording], name: str) -> float:
    """How far a quantity moves within the recordings, in units of its range over all of them."""
    series = [recording.columns[name] for recording in recordings]
    span = float(np.ptp(np.concatenate(series)))
    turns = [turning_points(values, SWING * span) for values in series]
    return (
        sum(float(np.abs(np.diff(v[t])).sum()) for v, t in zip(series, turns, strict=True)) / span
        if span
        else 0.0
    )


def _neat(values: Array, levels: Array) -> Array:
    """Return the levels with as few digits as the spread of their samples allows: 249.9 +- 0.7 was
    meant to be 250.
    """
    nearest = match_levels(values, levels, np.inf)
    off = values - levels[nearest]
    near = np.abs(off) < 2 * TIGHT * default_within(levels)
    neat = []
    for place, level in enumerate(levels.tolist()):
        own = nearest == place
        spread = float(np.std(off[near & own] if (near & own).any() else off[own]))
        neat.append(
            next(
                (
                    round(level, d) + 0.0
                    for d in range(-6, 7)
                    if abs(round(level, d) - level) <= spread
                ),
                level,
            )
        )
    return np.array(neat if len(set(neat)) == len(levels) else levels)


def _within(values: Array, levels: Array) -> float | None:
    """How near a sample has to be to its level; None where half the distance of levels will do."""
    spacing = 2 * default_within(levels)
    nearest = match_levels(values, levels, np.inf)
    off = np.abs(values - levels[nearest])
    tight = max(
        TIGHT * spacing, *(7.0 * float(np.median(off[nearest == i])) for i in range(len(levels)))
    )
    return (
        two_digits(tight)
        if tight < spacing / 2 and np.mean((off > tight) & (off <= spacing / 2)) > TRANSITION
        else None
    )


def goes_in_cycles(recordings: Sequence[Recording], held: Held) -> bool:
    """Return True where the swept quantity goes there and back at every level of every
    recording.
    """
    for recording in recordings:
        place = match_levels(
            recording.columns[held.of], held.at, held.within or default_within(held.at)
        )
        for level in np.unique(place[place >= 0]):
            try:
                split_cycles(recording.columns[held.swept][place == level], {}, CYCLE_SAMPLES)
            except DataError:
                return False
    return True


def staircase(recordings: Sequence[Recording]) -> Settling | None:
    """How the pressure settles, where it rests in between: most samples in the middle of its range
    are slow. None for sweeps.
    """
    found = settling(recordings)
    return (
        found
        if found is not None and found.share_between > RESTS and found.share < 1 - TRANSITION
        else None
    )


def _with_experiment(draft: Draft, recordings: Sequence[Recording], held: Held | None) -> Draft:
    """Return the draft with cycles or settled samples, levels and split, given what was `held`."""
    if held is not None:
        draft = _with_levels(_with_static_samples(draft, recordings, held), recordings, held)
    return _with_split(draft, recordings, held)


def inner_levels(levels: Sequence[float]) -> list[float]:
    """Levels to hold out: every third of many, the one above the middle of few; never the first or
    the last.
    """
    if len(levels) >= MANY_LEVELS:
        return list(levels[2:-1:3])
    if len(levels) > FEW_LEVELS:
        return [levels[(len(levels) + 1) // 2]]
    return [levels[1]] if len(levels) == FEW_LEVELS else []


def _with_static_samples(draft: Draft, recordings: Sequence[Recording], held: Held) -> Draft:
    """Return the draft with the samples at which steps of the pressure have settled, or with loops
    split into branches.
    """
    settled = (
        staircase(recordings)
        if held.swept == "pressure" and "time" in recordings[0].columns
        else None
    )
    if settled is not None:
        rule = {"rate_of": "pressure", "window": settled.window, "order": 2}
        why = (
            f"kPa/s: the pressure rests on steps, {settled.share:.0%} of the samples change "
            "less, and only these are static"
        )
        draft = draft.with_data(
            "derive",
            {"pressure_rate": rule},
            f"to find settled samples; a window of {settled.window:g} s",
        )
        return draft.with_data(
            "keep", [{"quantity": "pressure_rate", "abs_below": settled.limit}]
        ).noted(("data", "keep", 0), why)
    if goes_in_cycles(recordings, held):
        why = (
            f"{held.swept} goes there and back at every level: the mean of both branches is "
            "static, half their difference is `hysteresis`"
        )
        return draft.with_data("cycles", {"over": held.swept, "samples": CYCLE_SAMPLES}, why)
    return draft


def _with_levels(draft: Draft, recordings: Sequence[Recording], held: Held) -> Draft:
    at = [float(f"{level:.6g}") for level in held.at]
    levels: dict[str, Any] = {"of": held.of, "at": at}
    told = (
        " ".join(f"{level:g}" for level in at)
        if len(at) <= MANY
        else f"{len(at)} levels from {at[0]:g} to {at[-1]:g}"
    )
    unit = "" if default_unit(held.of) == "1" else f" {default_unit(held.of)}"
    why = (
        f"{len(recordings)} file{'s' if len(recordings) > 1 else ''}, {held.of} held at "
        f"{told}{unit}"
    )
    if held.within is not None:
        levels["within"] = held.within
        why += "; samples further off are on the way to the next level"
    return draft.with_data("levels", levels, why)


def _with_split(draft: Draft, recordings: Sequence[Recording], held: Held | None) -> Draft:
    inner = inner_levels(draft.data["levels"]["at"]) if held is not None else []
    if held is not None and inner:
        why = (
            "an inner level is held out"
            if len(inner) == 1
            else "every third level is held out, the first and the last never"
        )
        return draft.with_data("split", {"validate": {held.of: inner}}, why)
    swept = held.swept if held is not None else "pressure"
    values = np.concatenate([recording.columns[swept] for recording in recordings])
    low, high = (float(f"{values.min() + share * np.ptp(values):.6g}") for share in BAND)
    inside = np.mean((values >= low) & (values <= high))
    if not 0 < inside < LARGEST_SHARE:
        return draft
    why = f"no level can be spared: a band of {swept} is held out"
    return draft.with_data("split", {"validate": {swept: {"between": [[low, high]]}}}, why, False)


# What moves all the time
# --------------------------------------------------------------------------------------------------


def _moves(recordings: Sequence[Recording], target: str) -> bool:
    """Return True where a static model has nothing to hold on to: a position under pressure, or a
    force whose pressure never rests.
    """
    if sum(one.rows_kept for one in recordings) < FEWEST or "time" not in recordings[0].columns:
        return False
    if target != "force" or "pressure" not in recordings[0].columns:
        return True
    found = settling(recordings)
    return found is not None and found.share < 1 - UNSETTLED


def _with_memory(
    draft: Draft, recordings: Sequence[Recording], inputs: Sequence[str], target: str
) -> Draft:
    """Return the draft with even steps, and the second half held out."""
    times = [one.columns["time"] for one in recordings if one.rows_kept > 1]
    usual = float(np.median(np.concatenate([np.diff(time) for time in times])))
    total = sum(float(np.ptp(time)) for time in times)
    step = two_digits(max(usual, total / MOST))
    draft = draft.with_data(
        "resample",
        step,
        f"s: terms with memory need even steps; the record has one sample in {usual:.3g} s",
    )
    gaps = sum(int(np.count_nonzero(np.diff(time) > BREAK * max(step, usual))) for time in times)
    if gaps or "gaps" in draft.data:
        why = f"s: {gaps} gap{'s' if gaps != 1 else ''}, at which memory begins anew"
        draft = draft.with_data(
            "gaps", {"longer_than": two_digits(BREAK * max(step, usual)), "action": "split"}, why
        )
    draft = _with_part_held_out(draft, recordings, [*inputs, target])
    draft = draft.with_section(
        "target",
        {"column": target},
        "it moves all the time: a model with memory, scored in free run",
    )
    return draft.with_section(
        "validate",
        {"normaliser": "range"},
        "errors are divided by the range: the zero is arbitrary",
    )


def _with_part_held_out(
    draft: Draft, recordings: Sequence[Recording], names: Sequence[str]
) -> Draft:
    """Return the draft with a hold-out that lies within what trains: the second half, else a
    stretch of the time.
    """
    times = [one.columns["time"] for one in recordings]
    outside = _outside(
        recordings, names, [np.arange(len(time)) >= LAST * len(time) for time in times]
    )
    new = (
        f"{outside:.0%} of the second half lies beyond the first one"
        if outside < 1
        else "the second half rests, or is all new"
    )
    if outside <= OUTSIDE:
        return draft.with_data(
            "split", {"validate": {"last": LAST}}, "the second half of every recording is held out"
        )
    low, high = (float(edge(np.concatenate(times))) for edge in (np.min, np.max))
    for begin, end in STRETCHES:
        first, last = (float(f"{low + share * (high - low):.10g}") for share in (begin, end))
        if (
            _outside(recordings, names, [(time >= first) & (time <= last) for time in times])
            <= OUTSIDE
        ):
            why = f"s: {new}, and this stretch moves within the others"
            return draft.with_data(
                "split", {"validate": {"time": {"between": [[first, last]]}}}, why
            )
    why = f"{new}, and no stretch moves within the others: its error is that of an extrapolation"
    return draft.with_data("split", {"validate": {"last": LAST}}, why, False)


def _outside(
    recordings: Sequence[Recording], names: Sequence[str], held: Sequence[BoolArray]
) -> float:
    """Return the largest share, over quantities, of held-out samples beyond the range of the
    others; 1 where nothing or most is held out.

    And where the target, the last of the names, hardly moves there: a rest tests nothing.
    """
    kept = np.concatenate(held)
    pooled = {name: np.concatenate([one.columns[name] for one in recordings]) for name in names}
    target = pooled[names[-1]]
    if not kept.any() or np.mean(kept) > MOST_HELD or np.ptp(target[kept]) < MOVED * np.ptp(target):
        return 1.0
    margins = {**dict.fromkeys(names, BEYOND), names[-1]: FURTHER}
    return max(
        float(np.mean(beyond(values[kept], values[~kept], margins[name])))
        for name, values in pooled.items()
    )


# What to compare with, and the second component
# -----------------------------------------------------------------------------------


def _with_comparison(draft: Draft, dataset: Dataset) -> Draft:
    """Return the draft with the formulas that can be fitted, beside which its model is scored, and
    as a force where that was set.
    """
    turned = dataset.target != "force" and "force" in dataset.curves[0].columns
    if dataset.target != "force" and not turned:
        return draft
    samples = sum(int(curve.training.sum()) for curve in dataset.curves)
    known = [(name, literature.get(name)) for name in COMPETITORS]
    formulas = [
        name
        for name, one in known
        if {*one.inputs} <= {*dataset.quantities} and len(one.parameters) < samples
    ]
    if turned:
        why = (
            f"the model of the {dataset.target} is inverted, so that scores are of the force, "
            "beside the formulas"
        )
        return draft.with_section("validate", {"as": "force", "against": formulas}).noted(
            ("validate", "as"), why
        )
    return draft.with_section("validate", {"against": formulas}) if formulas else draft


def of_experiment(
    draft: Draft,
    recordings: Sequence[Recording],
    folder: Path,
    target: str,
    position: str | None,
    hold: str | None,
) -> Draft:
    """Return the draft with the experiment: static where something was held or nothing tells the
    time, else with memory.

    `hold` is what a person says was held. Where the force was set, the position is what was
    measured, and the target.
    """
    held = find_held(recordings, ("pressure", position), hold) if position is not None else None
    if held is None and _moves(recordings, target):
        return _with_memory(
            draft,
            recordings,
            [one for one in ("pressure", position) if one is not None and one != target],
            target,
        )
    step = (
        force_set(recordings, position)
        if target == "force" and held is not None and position is not None
        else None
    )
    if step is not None and position is not None:
        draft = _with_experiment(draft, recordings, find_held(recordings, ("pressure", "force")))
        why = (
            f"the force was set in steps of {step:.4g} N, and {position} measured: the noise "
            "lies there"
        )
        draft, target = draft.with_section("target", {"column": position}, why), position
    else:
        draft = with_target(_with_experiment(draft, recordings, held), target)
    return _with_comparison(draft, read_draft(draft, folder, target))


def with_target(draft: Draft, target: str) -> Draft:
    """Return the draft of a static force, or of another column."""
    return draft.with_section("target", "static" if target == "force" else {"column": target})


def followed(draft: Draft, inputs: Sequence[str], target: str, folder: Path) -> Draft:
    """Return the draft with a model of what follows on what drives: with memory where something
    tells of it.

    That is where earlier samples of what drives explain what that of now does not.
    """
    draft, dataset = cleaned(draft, folder, target)
    found = None
    if min(one.rows_kept for one in dataset.recordings) >= FEWEST:
        found = remembered(
            *([one.columns[name] for one in dataset.recordings] for name in (inputs[0], target))
        )
    remembers = found is not None and found.now > WORTH and found.before < HELPS * found.now
    if found is not None and remembers and "time" not in dataset.recordings[0].columns:
        told = (
            f"error {found.now:.0%} of its spread by the input of now, {found.before:.0%} by "
            "earlier ones as well"
        )
        why = (
            f"s: no column is a clock, and the response remembers ({told}): say how long a "
            "sample takes"
        )
        draft = draft.with_data("sample_time", 1.0, why, False)
        dataset = read_draft(draft, folder, target)
    if _moves(dataset.recordings, target) and (target != "force" or remembers or len(inputs) > 2):
        return _with_memory(draft, dataset.recordings, inputs, target)
    return _with_comparison(draft.with_section("target", {"column": target}), dataset)


def hysteresis_beside(draft: Draft, folder: Path) -> Draft | None:
    """Return the study of the hysteresis that the load cycles of a static one show; None where
    there are none, or branches are one.
    """
    if draft.spec["target"] != "static" or "cycles" not in draft.data:
        return None
    curves = read_draft(draft, folder, "force").curves
    largest = max(float(np.abs(curve.columns["force"]).max()) for curve in curves)
    halves = np.concatenate([curve.columns["hysteresis"] for curve in curves])
    half = float(np.sqrt(np.mean(halves**2)))
    if half < APART * largest or abs(float(halves.mean())) < ONE_WAY * half:
        return None
    formulas = [
        name
        for name in draft.spec.get("validate", {}).get("against", ())
        if name.startswith("polynomial")
    ]
    beside = _in_segments(
        draft.without("model", "validate", "segment", "dictionary", "fit", "fuse"), curves
    )
    beside = replace(
        beside, spec={**beside.spec, "name": f"{draft.name[:LONGEST_NAME]}-hysteresis"}, found=None
    )
    beside = beside.with_section(
        "fit", {"max_terms": 3, "stop": "bic"}, "up to three terms, as many as pay for themselves"
    )
    why = (
        f"half the difference of the branches, {half / largest:.1%} of the largest force: the "
        "component that the static study leaves out"
    )
    beside = beside.with_section("target", "hysteresis", why)
    return beside.with_section("validate", {"against": formulas}) if formulas else beside


def _in_segments(draft: Draft, curves: Sequence[Curve]) -> Draft:
    """One function of each curve, or one smooth surface where the loops at neighbouring levels do
    not tell of each other.

    It is not searched: what errs least on left-out blocks of loops, which are noisier than the
    force, erred more at other levels. Settled by leaving inner levels out of the loops of eight
    records, measured and simulated. One arch for each curve erred less than four segments, and a
    surface less than curves where these do not tell of each other, for it follows no single loop
    (alike on one record). Where curves reach to different places a surface is bent by what it has
    not seen.
    """
    over, of = draft.data["cycles"]["over"], draft.data["levels"]["of"]
    training = [curve for curve in curves if curve.training.any()]
    found = neighbourhood(training, over, "hysteresis")
    reached = [curve.columns[over] for curve in training]
    if (
        found is None
        or found.tells
        or min(map(np.ptp, reached)) < COVERED * np.ptp(np.concatenate(reached))
    ):
        terms = [{"polynomial": {"of": [over], "order": ARCH}}]
        return draft.with_section(
            "dictionary", terms, "one arch for each curve: loops are noisier than the force"
        )
    why = (
        f"a loop hardly follows from those at the next levels ({found}): a smooth surface of "
        "all; were the cycles driven alike?"
    )
    draft = draft.with_section(
        "segment", {of: "none", over: {"method": "even", "count": SEGMENTS}}
    ).noted(("segment", of), why, False)
    return draft.with_section("dictionary", [{"polynomial": {"of": [over, of], "order": ARCH}}])
