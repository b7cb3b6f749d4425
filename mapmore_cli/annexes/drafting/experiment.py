"""Find out how the experiment was done: which quantity was held constant, which samples are static,
and which data are held out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.annexes.drafting.answers import Hold
from mapmore_cli.annexes.drafting.draft import Conditions, Draft, Section
from mapmore_cli.annexes.drafting.second_log import BREAK
from mapmore_cli.checking.evidence import MUCH, settling, two_digits
from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.signals.cycles import split_cycles
from mapmore_cli.modelling.signals.plateau import default_within, find_levels, match_levels
from mapmore_cli.study.units import default_unit

# fraction of the distance between levels within which samples belong to a level, if there are
# samples between levels
NEAR = 0.1
# smallest number of samples of a recording for a model with memory, and of a branch of a cycle
FEWEST = 200
# largest number of samples of a recording that a draft of a model with memory takes at first
MOST = 6_000
# smallest number of samples of a recording, if many short recordings together have enough
LEAST = 100
# fraction of the samples that is held out at random, if the last samples lie outside the range of
# the others
SHARE = 0.2
# movement within a recording that is smaller than this fraction of the differences between
# recordings is scatter
MUCH_LESS = 0.1
# fraction of each recording that is held out at its end, if no level and no recording can be held
# out
LAST = 0.3
# words with which a person may name held-out data, besides the name of an input
WHOLE, LAST_SAMPLES = "recordings", "last"
COMPETITORS = ("sarosi", "polynomial_2", "polynomial_5", "muscle_like", "polynomial_3")


@dataclass(frozen=True)
class Held:
    """The quantity `of` that was held constant, its levels `at`, the quantity that was `swept`, and
    the reason `why`. If samples between levels must be left out, `within` is the largest distance
    of a sample from its level.
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
    """Return the quantity that was held constant while another input moved; None if nothing was
    held constant, or only at a single level.

    The quantity that a person names is used. If nobody names one, it is the only input whose values
    are in names of files or which stays constant in each recording. If there is none in a table
    without a clock, it is the only input that takes a few values repeatedly. `conditions` are
    values from names.

    Raises
    ------
    UsageError
        If the quantity that a person names is no input.
    """
    asked = None if hold is None else hold.name
    if asked == "none":
        return None
    if asked not in (None, *inputs):
        raise UsageError(
            f"--hold: no input is called {asked}", f"name one of {', '.join(inputs)}, or none"
        )
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
    """Return the levels of a quantity that stays near one value in each recording; None if it has
    no such levels, or only one. The gap between neighbouring levels is more than twice the movement
    at any level.
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
    """Return the mean value `middle`, rounded to as few digits as the scatter around it allows."""
    shorter = (round(middle, digits) + 0.0 for digits in range(-6, 13))
    return next((one for one in shorter if abs(one - middle) <= scatter), middle)


def _set_values(recordings: Sequence[Recording], name: str) -> list[float]:
    """Return the values of a quantity if it takes each of them at least three times on average; an
    empty list otherwise, and if there are only two values, as for a switch.
    """
    values, counts = np.unique(
        np.concatenate([one.columns[name] for one in recordings]), return_counts=True
    )
    return values.tolist() if len(values) > 2 and counts.mean() >= 3 else []


def goes_in_cycles(recordings: Sequence[Recording], held: Held) -> bool:
    """Return True if the swept quantity moves there and back at every level of every recording."""
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
    """The recordings of a study, the names of its inputs and its target, the held quantity, the
    values in names of files, and the quantities that distinguish the recordings of one file
    (`apart`).
    """

    recordings: Sequence[Recording]
    inputs: Sequence[str]
    target: str
    held: Held | None
    conditions: Conditions
    apart: Sequence[str] = ()

    @property
    def is_timed(self) -> bool:
        """Return True if the samples have a clock."""
        return "time" in self.recordings[0].columns


def with_experiment(
    done: Experiment,
    draft: Draft,
    held_out: str | None,
    read: Callable[[Draft], Sequence[Recording]],
) -> Draft:
    """Return the draft with its target, static samples, levels and held-out data. The study is
    static if a person names the held quantity, if the target is a force at a held quantity, or if
    there is no clock; otherwise it has memory.

    `held_out` is the answer of a person about held-out data; `read` returns the recordings of a
    draft. Raises UsageError if these data cannot be held out.
    """
    held, target, recordings = done.held, done.target, done.recordings
    samples = sum(one.rows_kept for one in recordings)
    is_static = held is not None and (held.why == "you" or target == "force")
    is_static = is_static or (held is None and _is_at_rest(done))
    if not is_static and done.is_timed and samples >= FEWEST:
        draft = _as_memory_study(draft, recordings).with_section("target", target)
        if "gaps" in draft.data:  # the pieces of a recording have ids of their own
            done = replace(done, recordings=read(draft))
        return _with_split(draft, done, held_out, has_memory=True)
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
    """Return True if each recording is a single point: no input moves in any of them, and the
    standard deviation of the target within a recording is at most a tenth of that between
    recordings.
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
    """Return the levels to hold out: every third level of six or more, or one level if there are
    fewer. The first and the last level are never held out.
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
        why = (
            f"kPa/s: the pressure was held after each step; {settled.share:.0%} of the samples "
            "are static"
        )
        return draft.noted(("data", "keep", 0), why)
    if len(held.at) > 2 and goes_in_cycles(recordings, held):
        why = (
            f"{held.swept} increases and decreases at every level; the mean of both branches is "
            "static"
        )
        return draft.with_data("cycles", {"over": held.swept}, why)
    return draft


def _with_levels(draft: Draft, held: Held) -> Draft:
    levels: Section = {"of": held.of, "at": [float(f"{level:.6g}") for level in held.at]}
    why = f"{held.why}: {held.of} was held, in {default_unit(held.of, draft.spec.get('units', {}))}"
    if held.within is not None:
        levels["within"] = held.within
        why += "; samples farther away are on the way to the next level"
    return draft.with_data("levels", levels, why)


def _with_split(
    draft: Draft, done: Experiment, wanted: str | None, *, has_memory: bool = False
) -> Draft:
    """Return the draft with held-out data: the data that a person names; otherwise inner levels; if
    there are no levels, inner values from names of files, or recordings; otherwise the last samples
    of each recording, unless the study has no memory and these lie outside the others. The note
    says whether the held-out data lie between or outside the training data.

    Raises UsageError if the data that a person names cannot be held out.
    """
    levels, groups = draft.data.get("levels"), draft.data.get("groups", {})
    values = {levels["of"]: levels["at"]} if levels else done.conditions
    inside = {name: some for name, places in values.items() if (some := inner(sorted({*places})))}
    logs = [*dict.fromkeys(one.log or one.id for one in done.recordings)]
    is_whole = len(logs) > 2 and not levels and {"gain", "offset"}.isdisjoint(groups)
    way = wanted or next(iter(inside), WHOLE if is_whole else LAST_SAMPLES)
    held_out: Section = {}
    if way == LAST_SAMPLES:
        held_out, why = _last_or_between(done, is_free=wanted is None and not has_memory)
    elif way == WHOLE:
        held_out, why = _whole_recordings(done, logs), "between: whole recordings"
    else:
        places: object = inside.get(way) or _band(way, done.recordings, values)
        held_out, why = {way: places} if places else {}, "between: inner values"
    if not held_out:
        raise UsageError(
            f"--validate {way}: there are too few values or recordings to hold some of them out",
            f"write {LAST_SAMPLES}, or an input",
        )
    return draft.with_data("split", {"validate": held_out}, f"{'you; ' if wanted else ''}{why}")


def _last_or_between(done: Experiment, is_free: bool) -> tuple[Section, str]:
    """Return the last samples of every recording. If these lie outside the others, and the program
    `is_free` to choose, return inner values of a quantity that moves steadily, or a random share of
    the samples if there is no such quantity.
    """
    names = _beyond(done)
    if not names:
        return {LAST_SAMPLES: LAST}, "between: the last samples of every recording"
    if not is_free:
        why = (
            f"beyond: the last samples of every recording, in which {', '.join(names)} leaves "
            "the range of the samples before"
        )
        return {LAST_SAMPLES: LAST}, why
    for name in names:
        if values := inner(_set_values(done.recordings, name)):
            return {name: values}, f"between: inner values, because {name} moves steadily"
    share = {"fraction": SHARE, "seed": 1}
    return share, f"between: samples drawn at random, because {', '.join(names)} moves steadily"


def _whole_recordings(done: Experiment, logs: Sequence[str]) -> Section:
    """Return every third log for holding out, with all its pieces if it was cut. Inner logs are
    preferred. Recordings that one quantity distinguishes are named by its values.
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
    """Return the inputs for which more than half of the last samples of all recordings lie outside
    the values of the earlier samples.
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
    """Return the middle fifth of the samples of an input that moves steadily; nothing for an input
    with too few values.
    """
    if name in values:
        return {}
    pooled = np.concatenate([one.columns[name] for one in recordings])
    low, high = (float(f"{one:.3g}") for one in np.quantile(pooled, (0.4, 0.6)))
    return {"between": [[low, high]]} if low < high else {}


def _as_memory_study(draft: Draft, recordings: Sequence[Recording]) -> Draft:
    """Return the draft with equal time steps, and gaps at which memory restarts."""
    times = [one.columns["time"] for one in recordings if one.rows_kept > 1]
    usual = float(np.median(np.concatenate([np.diff(time) for time in times])))
    lengths = [float(np.ptp(time)) for time in times]
    most = min(sum(lengths) / MOST, float(np.median(lengths)) / LEAST)
    step = two_digits(max(usual, most))
    draft = draft.with_data(
        "resample",
        step,
        "s: a model with memory needs equal time steps; "
        f"the usual step of the data is {usual:.3g} s",
    )
    limit = two_digits(BREAK * max(step, usual))
    gaps = sum(int(np.count_nonzero(np.diff(time) > limit)) for time in times)
    if gaps or "gaps" in draft.data:
        set_back = draft.notes.get(("data", "gaps"))
        counted = [f"s: {gaps} gap{'s' if gaps != 1 else ''}"] if gaps else []
        why = "; ".join([*counted, *([set_back.why] if set_back else [])])
        cut = {"longer_than": limit, "action": "split"}
        draft = draft.with_data("gaps", cut, f"{why}; the memory restarts there")
    return draft.with_section(
        "validate",
        {"normaliser": "range"},
        "errors are divided by the range, because the zero of the target is arbitrary",
    )
