"""Add to a draft the settings that its recordings need: for words that mean missing values, for odd
time stamps, and for files that cannot be read.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.annexes.drafting.reading import read_draft, with_words
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Dataset, Recording
from mapmore_cli.ingestion.clock import REPEATS
from mapmore_cli.ingestion.dataset import BAD
from mapmore_cli.ingestion.files import find_sources
from mapmore_cli.study.sections.data import Data

# rule that cuts a recording where its clock was set back
RESET = {"longer_than": 60.0, "action": "split"}


def lenient(draft: Draft) -> Draft:
    """Return the draft with settings that leave out samples with faulty cells or faulty time
    stamps, if there are only a few.
    """
    for key, value in (("missing", "drop"), ("repeated_time", "spread"), ("glitches", "drop")):
        draft = draft.with_data(key, draft.data.get(key, value))
    return draft


def cleaned(draft: Draft, folder: Path, target: str) -> tuple[Draft, Sequence[Recording]]:
    """Return the draft with all settings that its recordings need, and the recordings.

    A recording is cut where its clock is set back. Unreadable files are left out by name. If most
    files would have to be left out because of their clock, the clock is left out instead. A clock
    by which another log is joined is never left out. Raises DataError if no recording can be read.
    """
    draft = lenient(draft)
    try:
        return _read_tolerantly(draft, folder, target)[:2]
    except DataError as fault:
        first = fault
    ways = [draft.with_data("skip_bad_files", True)]
    columns = draft.data["columns"]
    if "time" in columns:
        why = f"s: the recording is cut where its clock is set back: {first.message}"
        cut = draft.with_data("gaps", RESET, why)
        ways = [cut, *ways, cut.with_data("skip_bad_files", True)]
        if "join" not in draft.data:
            others = {key: column for key, column in columns.items() if key != "time"}
            why = f"time is left out: {first.message}"
            bare = draft.with_data("columns", others, why, False)
            ways += [bare, bare.with_data("skip_bad_files", True)]
    for way in ways:
        with suppress(DataError):
            dataset, recordings, is_most = _read_tolerantly(way, folder, target)
            if is_most or way is ways[-1]:
                return dataset, recordings
    raise first


def _read_tolerantly(
    draft: Draft, folder: Path, target: str
) -> tuple[Draft, Sequence[Recording], bool]:
    """Return a draft that can be read, its recordings, and True if they come from at least half of
    the files. The words that mean a missing value, and the names of files that cannot be read, are
    added to the draft.
    """
    warnings: list[str] = []
    rule = draft.data["missing"]
    missing, dataset = with_words(
        lambda rule: read_draft(draft.with_data("missing", rule), folder, target, warnings.append),
        rule["tokens"] if isinstance(rule, dict) else (),
    )
    draft, is_most = draft.with_data("missing", missing), True
    if draft.data.get("skip_bad_files") is True:
        sources = find_sources(Data.model_validate(draft.data).files, folder, bad=True)
        names = dict.fromkeys(source.name for source in sources)
        read = {recording.source for recording in dataset.recordings}
        bad = [name for name in names if name not in read]
        why = "; ".join(warning for warning in dict.fromkeys(warnings) if BAD in warning)
        draft = draft.with_data("skip_bad_files", bad, why, False)
        is_most = 2 * len(read) >= len(names)
    hidden = tuple(warning for warning in dict.fromkeys(warnings) if " hidden " in warning)
    return _with_losses(replace(draft, tips=hidden), dataset), dataset.recordings, is_most


def _with_losses(draft: Draft, dataset: Dataset) -> Draft:
    """Return the draft with notes that give the numbers of empty cells and of odd time stamps. The
    keys `missing`, `repeated_time` and `glitches` are removed if the recordings do not need them.
    Cells and time stamps of a joined log are not counted.
    """
    dropped = sum((Counter(recording.dropped) for recording in dataset.recordings), Counter[str]())
    repeats = (re.search(rf": (\d+) {REPEATS}", note) for note in dataset.notes)
    losses = {
        "missing": (dropped["missing value"], "rows have an empty cell"),
        "repeated_time": (
            sum(int(match[1]) for match in repeats if match is not None),
            f"{REPEATS}: the logger rounds them",
        ),
        "glitches": (dropped["glitch of the clock"], "time stamps lie before an earlier one"),
    }
    for key, (count, words) in losses.items():
        rule = draft.data[key]
        if isinstance(rule, dict):
            tokens = ", ".join(map(repr, rule["tokens"]))
            why = (
                f"{count} samples have a cell that is empty or holds {tokens}; it is read as a "
                "missing value"
            )
            draft = draft.noted(("data", key), why, sure=False)
        elif count:
            draft = draft.noted(("data", key), f"{count} {words}")
        elif "join" not in draft.data:
            draft = draft.without_data(key)
    return draft
