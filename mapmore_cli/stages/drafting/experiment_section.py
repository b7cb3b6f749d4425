"""What was done with the muscle: load cycles or steps, levels, and the data to hold out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mapmore_cli.domain.recording import Recording
from mapmore_cli.spec.units import default_unit
from mapmore_cli.stages.drafting.draft import Draft
from mapmore_cli.stages.drafting.evidence import Held, find_held, goes_in_cycles, staircase

CYCLE_SAMPLES = 200
MANY = 6  # levels, beyond which a note does not repeat them
BAND = (0.4, 0.55)  # of the range, held out where there are no levels
FEW_LEVELS, MANY_LEVELS = 3, 6  # from which an inner one, and every third, can be spared


def with_experiment(draft: Draft, recordings: Sequence[Recording], position: str | None) -> Draft:
    """The draft with cycles or settled samples, levels and split; `position` is the strain or what stands for it."""
    held = find_held(recordings, ("pressure", position)) if position is not None else None
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
    """Steps of the pressure are kept where they have settled, loops are split into branches."""
    settled = staircase(recordings) if held.swept == "pressure" and "time" in recordings[0].columns else None
    if settled is not None:
        rule = {"rate_of": "pressure", "window": settled.window, "order": 2}
        why = f"kPa/s: the pressure rests on steps, {settled.share:.0%} of the samples change less, and only these are static"
        draft = draft.with_data("derive", {"pressure_rate": rule}, f"to find settled samples; a window of {settled.window:g} s")
        return draft.with_data("keep", [{"quantity": "pressure_rate", "abs_below": settled.limit}]).noted(("data", "keep", 0), why)
    if goes_in_cycles(recordings, held, CYCLE_SAMPLES):
        why = f"{held.swept} goes there and back at every level: the mean of both branches is the static force"
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
    if "force" not in recordings[0].columns:
        why = "the second half of every recording is held out"
        return draft.with_data("split", {"validate": {"last": 0.5}}, why)
    swept = held.swept if held is not None else "pressure"
    values = np.concatenate([recording.columns[swept] for recording in recordings])
    low, high = (float(f"{values.min() + share * np.ptp(values):.6g}") for share in BAND)
    why = f"no level can be spared: a band of {swept} is held out"
    return draft.with_data("split", {"validate": {swept: {"between": [[low, high]]}}}, why, False)
