"""Two files of one test: the log with the pressure is joined to the one with the force, and one column is put beside another."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.spec.units import convert
from mapmore_cli.study.drafting.answers import Answers
from mapmore_cli.study.drafting.columns import Guess, guess_columns, range_of, told_guesses
from mapmore_cli.study.drafting.draft import Draft
from mapmore_cli.study.drafting.groups import Group, patterns, words_of
from mapmore_cli.study.drafting.moving import names_of
from mapmore_cli.study.drafting.recordings import raw_columns, read_draft, with_columns
from mapmore_cli.study.inspection.evidence import read_label, two_digits

POSITIONS = {"strain", "displacement", "length"}
REST = 20.0  # usual steps of the second log, beyond which it rested
OVERLAP = 0.5  # of the shorter log, in which both clocks run, where they are one


def second_of(group: Group, groups: Sequence[Group]) -> Group | None:
    """Return the log with the pressure of the same tests: the one group in the folder whose titles have it, and that has as many files.

    None where the group has a pressure of its own, lacks force, position or time, or more than one other comes into question.
    """
    if not {"time", "force"} <= _named(group) or "pressure" in _named(group) or not POSITIONS & _named(group):
        return None
    place, count = group.files[0].parent, len(group.files)
    found = [
        other
        for other in groups
        if other.files[0].parent == place and len(other.files) == count and {"time", "pressure"} <= _named(other)
        and not _named(other) & {"force", *POSITIONS}
    ]  # fmt: skip
    return found[0] if len(found) == 1 else None


def _named(group: Group) -> set[str]:
    """Return the quantities that the titles of a group name."""
    labels = (read_label(title) for title in group.layout.titles or ())
    return {label.quantity for label in labels if label is not None}


def with_second_log(
    draft: Draft, second: Group, folder: Path, clock: Guess, starts: tuple[float, float], answers: Answers | None = None
) -> Draft:
    """Return the draft with the pressure of a second log; `clock` is the time column of the first, which runs from and to `starts`."""
    titles = dict(zip(second.layout.columns, second.layout.titles or (), strict=False))
    below = dict(zip(second.layout.columns, second.layout.below, strict=False))
    raw = raw_columns(second, folder)
    guesses = guess_columns(titles, raw, below)
    guesses |= told_guesses(answers, titles, raw) if answers is not None else {}
    if not {"time", "pressure"} <= guesses.keys():
        raise DataError(f"{second.files[0].name}: its time and its pressure are no numbers", "write `join` by hand")
    time = convert(raw[guesses["time"].column][0], guesses["time"].unit, "s")
    low, high = (float(convert(value, clock.unit, "s")) for value in starts)
    common = min(high, float(time[-1])) - max(low, float(time[0]))
    one_clock = common > OVERLAP * min(high - low, float(np.ptp(time)))
    shift = 0.0 if one_clock else float(f"{low - time[0]:.6g}")
    steps = np.diff(time)
    forward = steps[steps > 0]
    if not forward.size:
        raise DataError(f"{second.files[0].name}: its time never goes on", "write `join` by hand")
    entry: dict[str, Any] = {
        "files": patterns(second.files, folder),
        "reader": second.layout.reader,
        **second.layout.settings,
        "columns": {name: guesses[name].as_spec() for name in ("time", "pressure")},
        "shift": shift,
    }
    usual = float(np.median(forward))  # of stamps in whole seconds, many are alike
    if (steps > REST * usual).any():
        entry["max_gap"] = two_digits(REST * usual)
    clocks = "both clocks seem to be one" if one_clock else "both logs are taken to begin together"
    why = f"the pressure is in a log of its own; {clocks}: look at `shift`; {guesses['pressure'].why}"
    return draft.with_data("join", [entry], why, False)


def with_found_shift(draft: Draft, folder: Path, target: str) -> Draft:
    """Return the draft with the shift that the changes of the target and of the pressure tell, where they do; else as it is."""
    (log,) = draft.data["join"]
    found = {key: value for key, value in log.items() if key != "shift"} | {
        "shift": "auto",
        "match": {"first": target, "second": "pressure"},
    }
    lenient = draft.with_data("missing", "drop").with_data("repeated_time", "average").with_data("glitches", "drop")
    try:
        dataset = read_draft(lenient.with_data("join", [found]), folder, target)
    except DataError:
        return draft
    told = next((note for note in dataset.notes if ": shift " in note), "").partition(": ")[2]
    before = draft.notes["data", "join"].why.partition("; look")[0].rpartition("; ")[0]
    return draft.with_data("join", [found], f"the pressure is in a log of its own; {told or before}", False)


def with_column_beside(draft: Draft, first: Group, other: Group, folder: Path) -> tuple[Draft, list[str], str]:
    """Return the draft of two files of one column each, joined row by row, with input and target; the file that comes first drives."""
    drive, response = names_of([0, 1], {0: "_".join(words_of(first.files[0].name)), 1: "_".join(words_of(other.files[0].name))})
    ((column, values),) = raw_columns(first, folder).items()
    why = f"taken as what drives, as its file comes first; without a unit; {range_of(values, '1')}"
    draft = with_columns(draft, {drive: Guess(column, "1", why, False)}, {}, {})
    entry: dict[str, Any] = {
        "files": patterns(other.files, folder),
        "reader": other.layout.reader,
        **other.layout.settings,
        "columns": {response: {"column": other.layout.columns[0]}},
        "on": "row",
    }
    why = "a single column as well, of as many rows: taken as what follows"
    return draft.with_data("join", [entry], why, False), [drive], response
