"""The table of docs/init-and-check.md: what `init` proposes for folders of measured data, with and
without answers, and what `check` finds in it.

`python docs/drafted_tables.py [FOLDER ...]` makes the rows of some folders in `MAPMORE_DATA` (by
default `../shared/data`), or of all, which takes about half a minute. Nothing is fitted. Every
draft is checked as it is: with its guesses, the `CHECK`s included.
"""

from __future__ import annotations

import os
import shlex
import sys
from collections import Counter
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from pages import DOCS, read_rows, write_tables

from mapmore_cli.annexes.drafting.answers import Answers, answers_of
from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.annexes.drafting.start import start
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.pipeline.inspection import inspect
from mapmore_cli.reporting.table import Column, Table
from mapmore_cli.study.loader import load

PAGE = DOCS / "init-and-check.md"
COLUMNS = (
    "folder",
    "said",
    "spec",
    "target",
    "inputs",
    "held constant",
    "held out",
    "CHECK",
    "check",
)
Row = tuple[str, ...]


def data_folder() -> Path:
    """Where the measured data lie."""
    return Path(os.environ.get("MAPMORE_DATA", Path(__file__).parents[2] / "shared" / "data"))


SAID: Mapping[str, str] = {
    "antagonist_pam": "--target force_N --inputs p1_kPa,p2_kPa,x_mm,dx_mm_s",
    "bellows_tensile": "--target force_N_total --inputs pressure_kPa_smoothed,strain_pct "
    "--hold strain",
    "bender": '--columns "time=0:s,p1=1:mbar,p2=3:mbar,angle=11:deg"',
    "coiled_isotonic_loops": "--target position_mm --inputs pressure_psi,load",
    "coiled_isotonic_steps": '--columns "time=2:s,pressure=3:psi,displacement=4:mm"',
    "drive": "--target qm:m --inputs vir:V",
    "festo_10mm_isometric": '--columns "force:N,pressure:kPa,time:s" --hold strain=kinked:%',
    "festo_20mm": '--columns "force:N*1.7444-18.595,pressure:kPa,time:s" --hold displacement:mm '
    "--length 228mm",
    "mr_damper": "--target forc:N --inputs dist:mm",
    "printed_cylinder": '--columns "time:ms,_,_,_,displacement:mm,pressure:bar,force:N"',
    "pwm_finger": "--target q --inputs left_pressure:kPa,right_pressure:kPa",
    "regulator_only": "--target veab_sensor_kPa --inputs cmd_kPa",
    "single_bellows": '--columns "time=Time:ms,force=Force:N*-1,pressure=Pressure:psi,'
    'strain=Tensile strain (Displacement):%" --hold strain',
    "system_identification": "--target y --inputs input",
    "textile_arm": '--columns "time=0:s,pressure=4:psi,x=14:m" --target x',
}
"""What a person who knows the columns would say on the line, by folder."""


def said_on_the_line(words: str) -> Answers:
    """Return the answers that options on the line give."""
    given = shlex.split(words)
    options = {key.removeprefix("--"): value for key, value in batched(given)}
    return answers_of(**options)


def batched(words: list[str]) -> zip[tuple[str, str]]:
    """Return options with their values."""
    return zip(words[::2], words[1::2], strict=True)


def rows_of(folder: Path) -> list[Row]:
    """Return a row for each spec that `init` proposes for a folder, without a word and with
    answers, or one that says why there is none.
    """
    rows = _rows(folder, Answers(), "nothing")
    if folder.name in SAID:
        rows += _rows(folder, said_on_the_line(SAID[folder.name]), SAID[folder.name])
    return rows


def _rows(folder: Path, answers: Answers, said: str) -> list[Row]:
    with TemporaryDirectory() as place:
        try:
            drafts = start(folder, Path(place), answers=answers).drafts
        except UsageError:
            return [(folder.name, said, "-", "asks", *"-" * (len(COLUMNS) - 4))]
        return [
            (folder.name, said, *proposed(draft), _checked(draft, Path(place))) for draft in drafts
        ]


def proposed(draft: Draft) -> Row:
    """Name, target, inputs, levels, what is held out, and the open questions of a draft."""
    entries = [entry for entry in draft.data["files"] if isinstance(entry, dict)]
    entries += [{"set": one["columns"]} for one in draft.data.get("join", [])]
    told = [*draft.data["columns"], *(name for entry in entries for name in entry.get("set", {}))]
    inputs = [name for name in dict.fromkeys(told) if name not in ("time", draft.output)]
    levels = draft.data.get("levels")
    held = f"{len(levels['at'])} levels of {levels['of']}" if levels else "nothing"
    held_out = draft.data.get("split", {}).get("validate", {})
    parts = [f"{way} {_in_words(value)}" for way, value in held_out.items()] or ["nothing"]
    open_ = str(draft.text().count("CHECK: "))
    return draft.name, draft.spec["target"], ", ".join(inputs), held, ", ".join(parts), open_


def _in_words(value: object) -> str:
    """Return levels as they are, a share in per cent, and names by their number."""
    if not isinstance(value, list):
        return f"{100 * value:.0f} %" if isinstance(value, float) else str(value)
    if isinstance(value[0], str):
        return f"({len(value)})"
    return " ".join(f"{one:g}" for one in value)


def _checked(draft: Draft, place: Path) -> str:
    """Return what `check` finds in a draft."""
    path = place / f"{draft.name}.yaml"
    path.write_text(draft.text(), encoding="utf-8")
    counts = Counter(issue.severity for issue in inspect(load(path)).issues)
    told = [
        f"{counts[word]} {word}{'s' if counts[word] > 1 else ''}"
        for word in ("error", "warning", "hint")
        if counts[word]
    ]
    return ", ".join(told) or "clean"


def table(made: Mapping[str, list[Row]]) -> Table:
    """Return the table with the rows of some folders made anew, and those of the others as they
    were, by folder.
    """
    kept = [tuple(row) for row in read_rows(PAGE, "drafts")[1:] if row[0] not in made]
    every = sorted(
        [*kept, *(row for found in made.values() for row in found)], key=lambda row: row[0]
    )
    return Table.of(
        "drafts",
        "What init proposes, and what check finds in it",
        tuple(map(Column, COLUMNS)),
        tuple(every),
    )


if __name__ == "__main__":
    chosen = [data_folder() / name for name in sys.argv[1:]] or sorted(
        path for path in data_folder().iterdir() if path.is_dir()
    )
    made = {folder.name: rows_of(folder) for folder in chosen}
    write_tables(PAGE, {"drafts": partial(table, made)})
