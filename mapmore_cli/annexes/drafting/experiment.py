"""What was done: what was held, which samples are static, and what is held out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.annexes.drafting.answers import Hold
from mapmore_cli.annexes.drafting.draft import Conditions, Draft, Section
from mapmore_cli.annexes.drafting.recordings import BREAK
from mapmore_cli.checking.evidence import MUCH, settling, two_digits
from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.signals.cycles import split_cycles
from mapmore_cli.modelling.signals.plateau import default_within, find_levels, match_levels
from mapmore_cli.study.units import default_unit

NEAR = 0.1  # of the distance of levels, that samples of one lie within where it was gone between
FEWEST = 200  # samples of a record with memory, and of a branch of a cycle
MOST = 6_000  # samples of a record with memory, at first
LEAST = 100  # samples of a recording, where many short ones have more than that together
SHARE = 0.2  # of the samples, drawn where the last ones lie beyond the others
MUCH_LESS = 0.1  # of what moves between recordings, that what moves in one is scatter
LAST = 0.3  # of the samples, held out where no level and no recording can be
WHOLE, LAST_SAMPLES = "recordings", "last"  # what a person may hold out besides an input
COMPETITORS = ("sarosi", "polynomial_2", "polynomial_5", "muscle_like", "polynomial_3")


@dataclass(frozen=True)
class Held:
    """The held quantity `of`, its levels `at`, `within` where samples between levels have to be
    kept out, the quantity that was `swept`, and `why`.
    """

    of: str
    at: list[float]
    within: float | None
    swept: str
    why: str


def find_held(
    recordings: Sequence[Recording],
    inputs: Sequence[str],
    hold: Hold | None,
    conditions: Conditions,
) -> Held | None:
    """Return what was held while another input moved: what a person says; else the one quantity
    that names tell, or that stays at a value of its own in each recording; else, in a table without
    a clock, the one that takes few values again and again.

    None where nothing was held, or at a single level. `conditions` are values that names tell.

    Raises
    ------
    UsageError
        Where what a person says is no input.
    """
    asked = None if hold is None else hold.name
    if asked == "none":
        return None
    if asked not in (None, *inputs):
        raise UsageError(f"--hold: no input is called {asked}", f"say {', '.join(inputs)}, or none")
    levels = {
        name: values for name in inputs if (values := _own_levels(recordings, name, conditions))
    }
    is_table = "time" not in recordings[0].columns
    if asked is None and is_table and not levels:
        levels = {name: values for name in inputs if (values := _set_values(recordings, name))}
    if asked is None and len(levels) != 1:
        return None
    of = asked or next(iter(levels))
    swept = next((name for name in inputs if name not in (of, *levels, *conditions)), None)
    at, within = levels.get(of, []), None
    if not at:
        at = find_levels(np.concatenate([one.columns[of] for one in recordings])).tolist()
        within = two_digits(NEAR * 2 * default_within(np.array(at))) if len(at) > 1 else None
    if swept is None or len(at) < 2:
        return None
    is_one = is_table and len(recordings) == 1
    stays = "takes few values" if is_one else "one value in each recording"
    why = "you" if asked else "names" if of in conditions else stays
    return Held(of, at, within, swept, why)


def _own_levels(
    recordings: Sequence[Recording], name: str, conditions: Conditions
) -> list[float] | None:
    """Return the values of a quantity that stays near one in each recording: twice the gap between
    two is more than it moves at any. None where it moves more, or is one everywhere.
    """
    if name in conditions:
        levels = sorted(set(conditions[name]))
        return levels if len(levels) > 1 else None
    series = [one.columns[name] for one in recordings if one.rows_kept]
    ends = np.array(sorted(np.quantile(values, (0.05, 0.95)).tolist() for values in series))
    reach = np.maximum.accumulate(ends[:, 1])
    first = np.flatnonzero(ends[1:, 0] > reach[:-1]) + 1
    lows, highs = ends[[0, *first], 0], reach[[*(first - 1), -1]]
    gaps, widths = lows[1:] - highs[:-1], highs - lows
    if not gaps.size or 2 * gaps.min() <= widths.max():
        return None
    middles = zip((lows + widths / 2).tolist(), (widths / 4).tolist(), strict=True)
    return [_neat(middle, scatter) for middle, scatter in middles]


def _neat(middle: float, scatter: float) -> float:
    """Return the middle with as few digits as the scatter allows."""
    shorter = (round(middle, digits) + 0.0 for digits in range(-6, 13))
    return next((one for one in shorter if abs(one - middle) <= scatter), middle)


def _set_values(recordings: Sequence[Recording], name: str) -> list[float]:
    """Return the values that a quantity takes three times or more on the average; none where they
    are two, as of a switch.
    """
    values, counts = np.unique(
        np.concatenate([one.columns[name] for one in recordings]), return_counts=True
    )
    return values.tolist() if len(values) > 2 and counts.mean() >= 3 else []


def goes_in_cycles(recordings: Sequence[Recording], held: Held) -> bool:
    """Return True where the swept quantity goes there and back at every level of every
    recording.
    """
    at = np.array(held.at)
    within = held.within or default_within(at)
    for recording in recordings:
        place = match_levels(recording.columns[held.of], at, within)
        for level in np.unique(place[place >= 0]):
            try:
                split_cycles(recording.columns[held.swept][place == level], {}, FEWEST)
            except DataError:
                return False
    return True


@dataclass(frozen=True)
class Experiment:
    """The recordings of a study, the names of its inputs and its target, what was held, the values
    that names tell, and the quantities that tell recordings `apart` in a file.
    """

    recordings: Sequence[Recording]
    inputs: Sequence[str]
    target: str
    held: Held | None
    conditions: Conditions
    apart: Sequence[str] = ()

    @property
    def is_timed(self) -> bool:
        """Whether the samples have a clock."""
        return "time" in self.recordings[0].columns


def with_experiment(
    done: Experiment,
    draft: Draft,
    held_out: str | None,
    read: Callable[[Draft], Sequence[Recording]],
) -> Draft:
    """Return the draft with its target, static samples and levels, and what is held out: static
    where a person says what was held, or it is the force at what was held, or no clock is known;
    else with memory.

    `held_out` is what a person says of it; `read` returns the recordings of a draft. Raises
    UsageError where that cannot be held out.
    """
    held, target, recordings = done.held, done.target, done.recordings
    samples = sum(one.rows_kept for one in recordings)
    is_static = held is not None and (held.why == "you" or target == "force")
    is_static = is_static or (held is None and _is_at_rest(done))
    if not is_static and done.is_timed and samples >= FEWEST:
        draft = _as_memory_study(draft, recordings).with_section("target", target)
        if "gaps" in draft.data:  # pieces of a recording have ids of their own
            done = replace(done, recordings=read(draft))
        return _with_split(draft, done, held_out)
    if held is not None:
        draft = _with_levels(_with_static_samples(draft, recordings, held), held)
    draft = _with_split(draft, done, held_out)
    if target != "force":
        return draft.with_section("target", target)
    inputs = {*recordings[0].columns, *done.conditions}
    known = {name: literature.get(name) for name in COMPETITORS}
    formulas = [
        name
        for name, formula in known.items()
        if {*formula.inputs} <= inputs and len(formula.parameters) < samples
    ]
    draft = draft.with_section("target", "static")
    return draft.with_section("validate", {"against": formulas}) if formulas else draft


def _is_at_rest(done: Experiment) -> bool:
    """Return True where each recording is a point: no input moves in any, and the target moves in
    each at most a tenth as far as from recording to recording, by standard deviations.
    """
    recordings = done.recordings
    moving = [
        name
        for name in done.inputs
        if name not in done.conditions
        and any(np.ptp(one.columns[name]) > 0 for one in recordings)
        and not _own_levels(recordings, name, done.conditions)
    ]
    series = [one.columns[done.target] for one in recordings if one.rows_kept]
    within = max(float(np.std(x)) for x in series)
    between = float(np.std([np.mean(x) for x in series]))
    return not moving and within <= MUCH_LESS * between


def inner(levels: Sequence[float]) -> list[float]:
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
    if settled is not None and settled.share_between > MUCH:
        rule = {"rate_of": "pressure", "window": settled.window, "order": 2}
        rate = draft.data.get("derive", {}) | {"pressure_rate": rule}
        draft = draft.with_data("derive", rate).with_data(
            "keep", [{"quantity": "pressure_rate", "abs_below": settled.limit}]
        )
        why = f"kPa/s: the pressure rests on steps; {settled.share:.0%} of the samples are static"
        return draft.noted(("data", "keep", 0), why)
    if len(held.at) > 2 and goes_in_cycles(recordings, held):
        why = f"{held.swept} goes there and back at every level: the mean of both is static"
        return draft.with_data("cycles", {"over": held.swept}, why)
    return draft


def _with_levels(draft: Draft, held: Held) -> Draft:
    levels: Section = {"of": held.of, "at": [float(f"{level:.6g}") for level in held.at]}
    why = f"{held.why}: {held.of} was held, in {default_unit(held.of, draft.spec.get('units', {}))}"
    if held.within is not None:
        levels["within"] = held.within
        why += "; samples further off are on the way to the next level"
    return draft.with_data("levels", levels, why)


def _with_split(draft: Draft, done: Experiment, wanted: str | None) -> Draft:
    """Return the draft with something held out: what a person said; else inner levels; without
    levels inner values that names tell, else recordings; else the last samples of each, unless
    these lie beyond the others. The note says whether that is between or beyond what trains.

    Raises UsageError if nothing of what a person said can be held out.
    """
    levels, groups = draft.data.get("levels"), draft.data.get("groups", {})
    values = {levels["of"]: levels["at"]} if levels else done.conditions
    inside = {name: some for name, places in values.items() if (some := inner(sorted({*places})))}
    logs = [*dict.fromkeys(one.log or one.id for one in done.recordings)]
    is_whole = len(logs) > 2 and not levels and {"gain", "offset"}.isdisjoint(groups)
    way = wanted or next(iter(inside), WHOLE if is_whole else LAST_SAMPLES)
    held_out: Section = {}
    if way == LAST_SAMPLES:
        held_out, why = _last_or_between(done, is_free=wanted is None and not done.is_timed)
    elif way == WHOLE:
        held_out, why = _whole_recordings(done, logs), "between: whole recordings"
    else:
        places: object = inside.get(way) or _band(way, done.recordings, values)
        held_out, why = {way: places} if places else {}, "between: inner values"
    if not held_out:
        raise UsageError(
            f"--validate: {way} leaves nothing to hold out", f"say {LAST_SAMPLES}, or an input"
        )
    return draft.with_data("split", {"validate": held_out}, f"{'you; ' if wanted else ''}{why}")


def _last_or_between(done: Experiment, is_free: bool) -> tuple[Section, str]:
    """Return the last samples of every recording. Where one is `is_free` to choose, and they lie
    beyond the others, inner values of what goes on in order, else a share of the samples.
    """
    names = _beyond(done)
    if not names:
        return {LAST_SAMPLES: LAST}, "between: the last of every recording"
    if not is_free:
        why = f"beyond: the last of every recording, where {', '.join(names)} was never before"
        return {LAST_SAMPLES: LAST}, why
    for name in names:
        if values := inner(_set_values(done.recordings, name)):
            return {name: values}, f"between: inner values, since {name} goes on in order"
    share = {"fraction": SHARE, "seed": 1}
    return share, f"between: samples drawn by chance, since {', '.join(names)} goes on in order"


def _whole_recordings(done: Experiment, logs: Sequence[str]) -> Section:
    """Return every third of the logs, with all pieces of each that was cut: those inside, if there
    are any. Recordings that one quantity tells apart are named by its values.
    """
    held = logs[1:-1:3] or logs[1:]
    if len(done.apart) == 1:
        name = done.apart[0]
        values = sorted({float(one.columns[name][0]) for one in done.recordings})
        some = values[1:-1:3] or values[1:]
        return {name: some} if some else {}
    ids = [one.id for one in done.recordings if (one.log or one.id) in held]
    return {WHOLE: ids} if ids else {}


def _beyond(done: Experiment) -> list[str]:
    """Return the inputs of which more than half of the last samples of all recordings lie outside
    the values of the samples before.
    """
    names: list[str] = []
    for name in done.inputs:
        series = [one.columns[name] for one in done.recordings if name in one.columns]
        ends = [round((1 - LAST) * len(x)) for x in series]
        if not any(ends):
            continue
        before = np.concatenate([x[:end] for x, end in zip(series, ends, strict=True)])
        last = np.concatenate([x[end:] for x, end in zip(series, ends, strict=True)])
        outside = (last < before.min()) | (last > before.max())
        names += [name] if outside.size and np.mean(outside) > 0.5 else []
    return names


def _band(name: str, recordings: Sequence[Recording], values: Conditions) -> Section:
    """Return the middle fifth of the samples of an input that moves on; nothing for one that has
    too few values.
    """
    if name in values:
        return {}
    pooled = np.concatenate([one.columns[name] for one in recordings])
    low, high = (float(f"{one:.3g}") for one in np.quantile(pooled, (0.4, 0.6)))
    return {"between": [[low, high]]} if low < high else {}


def _as_memory_study(draft: Draft, recordings: Sequence[Recording]) -> Draft:
    """Return the draft with even steps, and gaps at which memory begins anew."""
    times = [one.columns["time"] for one in recordings if one.rows_kept > 1]
    usual = float(np.median(np.concatenate([np.diff(time) for time in times])))
    lengths = [float(np.ptp(time)) for time in times]
    most = min(sum(lengths) / MOST, float(np.median(lengths)) / LEAST)
    step = two_digits(max(usual, most))
    draft = draft.with_data("resample", step, f"s: memory needs even steps; it has {usual:.3g} s")
    limit = two_digits(BREAK * max(step, usual))
    gaps = sum(int(np.count_nonzero(np.diff(time) > limit)) for time in times)
    if gaps or "gaps" in draft.data:
        draft = draft.with_data(
            "gaps",
            {"longer_than": limit, "action": "split"},
            f"s: {gaps} gap{'s' if gaps != 1 else ''}, at which memory begins anew",
        )
    return draft.with_section(
        "validate",
        {"normaliser": "range"},
        "errors are divided by the range: the zero is arbitrary",
    )
