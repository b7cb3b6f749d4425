"""Join the log of a second device, which recorded the pressure of the same tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mapmore_cli.annexes.drafting.by_person import named_by_person
from mapmore_cli.annexes.drafting.by_titles import known_by_titles
from mapmore_cli.annexes.drafting.cleaning import lenient
from mapmore_cli.annexes.drafting.draft import Draft, Named, Section
from mapmore_cli.annexes.drafting.reading import read_draft, table_of
from mapmore_cli.annexes.drafting.sources import started
from mapmore_cli.annexes.drafting.studies import FolderStudy
from mapmore_cli.checking.evidence import two_digits
from mapmore_cli.checking.names import POSITIONS
from mapmore_cli.domain.errors import DataError
from mapmore_cli.study.units import convert

# a time step is a gap if it is longer than this multiple of the usual step
BREAK = 5


def second_of(study: FolderStudy, studies: Sequence[FolderStudy]) -> FolderStudy | None:
    """Return the study that contains the pressure of the same tests, recorded by a second device.
    It is the only study in the same folder with the same number of files, with titles that name the
    time and the pressure, and without a title that names a force or a position.

    Return None if the study needs no second log, because it has no time or already has the
    pressure; or if none or several of the other studies fit.
    """
    beside = [
        other
        for other in studies
        if (other.folder, len(other.files)) == (study.folder, len(study.files))
        and {"time", "pressure"} <= other.quantities
        and other.quantities.isdisjoint({"force", *POSITIONS})
    ]
    is_lacking = "time" in study.quantities and "pressure" not in study.quantities
    return beside[0] if is_lacking and len(beside) == 1 else None


def with_second_log(
    draft: Draft, second: FolderStudy, folder: Path, target: str, named: Named
) -> Draft:
    """Return the draft, to which the pressure from a second log is joined. If a time shift is found
    at which the changes of the pressure match the changes of the target, the second log is shifted
    by this time. `named` are the columns of the second log that a person named.

    Raises DataError if one of the two logs has no clock, or if the second log has no pressure.
    """
    table = table_of(second, folder)
    columns, _ = known_by_titles(table)
    columns |= named_by_person(named, table, "--columns", columns)
    if not {"time", "pressure"} <= columns.keys() or "time" not in draft.data["columns"]:
        raise DataError(
            f"{second.files[0].name}: contains the pressure, but the two logs have no common clock",
            "name the column of the clock with --columns; or, if both logs have the same rows, "
            "write `data.join` by hand with `on: row`",
        )
    steps = np.diff(table[columns["time"].column].values[0])
    usual = convert(float(np.median(steps[steps > 0])), columns["time"].unit, "s")
    entry: Section = {
        **started(second, folder).data,
        "columns": {name: columns[name].as_spec() for name in ("time", "pressure")},
        "shift": "auto",
        "match": {"first": target, "second": "pressure"},
        "max_gap": two_digits(BREAK * usual),
    }
    sure = columns["pressure"].sure
    try:
        notes = read_draft(lenient(draft.with_data("join", [entry])), folder, target).notes
        how_shifted = next((note for note in notes if ": shift " in note), "").partition(": ")[2]
    # no time shift was found, because one of the signals never changes or several shifts fit
    except DataError:
        del entry["match"]
        entry["shift"] = 0.0
        how_shifted, sure = "do both logs have the same clock?", False
    return draft.with_data(
        "join",
        [entry],
        f"the pressure is in a second log; {how_shifted}; {columns['pressure'].why}",
        sure,
    )
