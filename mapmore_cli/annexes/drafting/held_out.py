"""Choose the data that are held out of training."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.annexes.drafting.draft import Conditions, Draft, Section
from mapmore_cli.annexes.drafting.experiment import Experiment, set_values
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.recording import Recording

# fraction of samples held out at random, if the last samples lie outside the range of the others
SHARE = 0.2
# fraction held out at the end of each recording, if no level or recording can be held out
LAST = 0.3
# words with which a person may name held-out data, besides the name of an input
WHOLE, LAST_SAMPLES = "recordings", "last"


def with_split(
    draft: Draft, done: Experiment, wanted: str | None, *, has_memory: bool = False
) -> Draft:
    """Return the draft with held-out data. If a person names data, these are held out. Otherwise,
    the first possibility in this list is used: inner levels; inner values from names of files;
    whole recordings; the last samples of each recording. If the study has no memory and the last
    samples lie outside the range of the others, other samples are used instead of them. The note
    says whether held-out levels, values or samples lie between or outside the training data.

    Raises UsageError if the data that a person names cannot be held out.
    """
    levels, groups = draft.data.get("levels"), draft.data.get("groups", {})
    values = {levels["of"]: levels["at"]} if levels else done.conditions
    inside = {name: some for name, places in values.items() if (some := inner(sorted({*places})))}
    # in the order of the levels, inner recordings lie between the others
    of = done.held.of if done.held else None
    in_order = sorted(
        done.recordings, key=lambda recording: float(np.median(recording.columns[of])) if of else 0
    )
    logs = [*dict.fromkeys(recording.log or recording.id for recording in in_order)]
    is_whole = len(logs) > 2 and not levels and {"gain", "offset"}.isdisjoint(groups)
    way = wanted or next(iter(inside), WHOLE if is_whole else LAST_SAMPLES)
    held_out: Section = {}
    if way == LAST_SAMPLES:
        held_out, why = _last_or_between(done, is_free=wanted is None and not has_memory)
    elif way == WHOLE:
        held_out, why = _whole_recordings(done, logs), "whole recordings"
    else:
        places = inside.get(way) or _band(way, done.recordings, values)
        held_out, why = {way: places} if places else {}, "between: inner values"
    if not held_out:
        raise UsageError(
            f"--validate {way}: there are too few values or recordings to hold some of them out",
            f"write `--validate {LAST_SAMPLES}` for the last samples, or name an input",
        )
    return draft.with_data("split", {"validate": held_out}, f"{'you; ' if wanted else ''}{why}")


def inner(levels: Sequence[float]) -> list[float]:
    """Return the levels to hold out: every third level of six or more, or one level if there are
    fewer. The first and the last level are never held out.
    """
    if len(levels) >= 6:
        return list(levels[2:-1:3])
    return [levels[(len(levels) + 1) // 2 if len(levels) > 3 else 1]] if len(levels) > 2 else []


def _last_or_between(done: Experiment, is_free: bool) -> tuple[Section, str]:
    """Return the last samples of every recording, or other samples instead, and the reason.

    The last samples are returned if `is_free` is False, because a person asked for them or the
    study has memory. They are also returned if most of them lie inside the range of the earlier
    samples. Otherwise, inner values of a quantity that moves
    steadily are returned. If no quantity has enough values for that, samples are drawn at random.
    """
    names = _beyond(done)
    if not names:
        return {LAST_SAMPLES: LAST}, "between: the last samples of every recording"
    if not is_free:
        why = (
            "beyond: the last samples of every recording, with "
            f"{', '.join(names)} mostly outside the range of the samples before"
        )
        return {LAST_SAMPLES: LAST}, why
    for name in names:
        if values := inner(set_values(done.recordings, name)):
            return {name: values}, f"between: inner values, because {name} moves steadily"
    why = f"between: samples drawn at random, because of steady movements ({', '.join(names)})"
    return {"fraction": SHARE, "seed": 1}, why


def _whole_recordings(done: Experiment, logs: Sequence[str]) -> Section:
    """Return the recordings to hold out: every third log except the first and the last or, if there
    are only two logs, the second. If a log was cut into pieces, all its pieces are held out. If the
    recordings differ in the value of a single quantity, every third of these values is held out
    instead.
    """
    if len(done.apart) == 1:
        name = done.apart[0]
        values = sorted({float(one.columns[name][0]) for one in done.recordings})
        held = values[1:-1:3] or values[1:]
        return {name: held} if held else {}
    held_logs = logs[1:-1:3] or logs[1:]
    ids = [one.id for one in done.recordings if (one.log or one.id) in held_logs]
    return {WHOLE: ids} if ids else {}


def _beyond(done: Experiment) -> list[str]:
    """Return the inputs for which more than half of the last samples of all recordings lie outside
    the range of the earlier samples. The pieces of a log are one recording, as in the split.
    """
    names: list[str] = []
    for name in done.inputs:
        series: dict[str, list[Array]] = {}
        for recording in done.recordings:
            series.setdefault(recording.log or recording.id, []).append(recording.columns[name])
        whole = [*map(np.concatenate, series.values())]
        parts_of = [np.split(x, [round((1 - LAST) * len(x))]) for x in whole]
        before, last = (np.concatenate(parts) for parts in zip(*parts_of, strict=True))
        outside = (last < before.min()) | (last > before.max())
        names += [name] if 2 * np.count_nonzero(outside) > outside.size else []
    return names


def _band(name: str, recordings: Sequence[Recording], values: Conditions) -> Section:
    """Return the band of an input that contains the middle fifth of its samples. The result is
    empty if the band has no width, or if the input has levels or values in the names of files
    (`values`).
    """
    if name in values:
        return {}
    pooled = np.concatenate([recording.columns[name] for recording in recordings])
    low, high = (float(f"{end:.3g}") for end in np.quantile(pooled, (0.4, 0.6)))
    return {"between": [[low, high]]} if low < high else {}
