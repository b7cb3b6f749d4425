"""Choose between a static study and a study with memory, and add the settings that this kind of
study needs to the draft.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.annexes.drafting.draft import Draft, Section
from mapmore_cli.annexes.drafting.experiment import Experiment, Held, goes_in_cycles, own_levels
from mapmore_cli.annexes.drafting.held_out import with_split
from mapmore_cli.annexes.drafting.second_log import BREAK
from mapmore_cli.checking.evidence import MUCH, settling, two_digits
from mapmore_cli.domain.recording import Recording
from mapmore_cli.modelling import literature
from mapmore_cli.study.units import default_unit

# smallest number of samples of a study with memory, in all recordings together
FEWEST = 200
# with more samples in all recordings together, a study with memory gets longer time steps
MOST = 6_000
# number of samples that a recording of median length must keep if time steps are made longer
LEAST = 100
# largest standard deviation of the target within a recording that is treated as a single point, as
# a fraction of the standard deviation between recordings
MUCH_LESS = 0.1
COMPETITORS = ("sarosi", "polynomial_2", "polynomial_5", "muscle_like", "polynomial_3")


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
    samples = sum(recording.rows_kept for recording in recordings)
    is_static = _is_at_rest(done) if held is None else held.why == "you" or target == "force"
    if not is_static and "time" in recordings[0].columns and samples >= FEWEST:
        draft = _as_memory_study(draft, recordings).with_section("target", target)
        # the recordings are read again, because gaps cut them into pieces with their own ids
        if "gaps" in draft.data:
            done = replace(done, recordings=read(draft))
        return with_split(draft, done, held_out, has_memory=True)
    if held is not None:
        draft = _with_levels(_with_static_samples(draft, recordings, held), held)
    draft = with_split(draft, done, held_out)
    if target != "force":
        return draft.with_section("target", target)
    formulas = [
        formula.name
        for formula in map(literature.get, COMPETITORS)
        if recordings[0].columns.keys() >= {*formula.inputs} and len(formula.parameters) < samples
    ]
    draft = draft.with_section("target", "static")
    return draft.with_section("validate", {"against": formulas}) if formulas else draft


def _is_at_rest(done: Experiment) -> bool:
    """Return True if each recording is a single point: no input moves in any of them, and the
    standard deviation of the target within a recording is at most a tenth of its standard deviation
    between recordings.
    """
    recordings = done.recordings
    moving = [
        name
        for name in done.inputs
        if any(np.ptp(recording.columns[name]) > 0 for recording in recordings)
        and not own_levels(recordings, name)
    ]
    series = [recording.columns[done.target] for recording in recordings if recording.rows_kept]
    within = max(float(np.std(x)) for x in series)
    between = float(np.std([np.mean(x) for x in series]))
    return not moving and within <= MUCH_LESS * between


def _with_static_samples(draft: Draft, recordings: Sequence[Recording], held: Held) -> Draft:
    """Return the draft for a static study. If the swept quantity is the pressure and was changed in
    steps, only samples at which it has settled are kept. Otherwise, if there are more than two
    levels and the swept quantity moves up and down at every level, each loop is split into its two
    branches.
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


def _as_memory_study(draft: Draft, recordings: Sequence[Recording]) -> Draft:
    """Return the draft with equal time steps and, if there are gaps in time, with the key `gaps`,
    so that the memory of the model begins again after each gap.
    """
    times = [recording.columns["time"] for recording in recordings if recording.rows_kept > 1]
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
