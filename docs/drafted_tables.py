"""The table of docs/init-and-check.md: what `init` proposes for folders of measured data, with and
without answers, and what it gives.

`python docs/drafted_tables.py [FOLDER ...]` makes the rows of all folders in `MAPMORE_DATA` (by
default `../shared/data`) anew, or those of some. All of them take about twenty minutes. Every draft
is checked and run as it is: with its guesses, the `CHECK`s included.
"""

from __future__ import annotations

import math
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
from mapmore_cli.annexes.drafting.proof import proven
from mapmore_cli.annexes.drafting.start import Search, start
from mapmore_cli.domain.errors import MapmoreError, UsageError
from mapmore_cli.domain.scores import OWN, deciding
from mapmore_cli.pipeline.inspection import inspect
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.reporting.table import Column, Table
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.study.loader import LoadedSpec, load

PAGE = DOCS / "init-and-check.md"
PLAINER = ("plane", "cubic", "sarosi", "arx")
COLUMNS = (
    "folder",
    "said",
    "spec",
    "target",
    "held constant",
    "structure",
    "CHECK",
    "check",
    "run: NRMSE",
    *PLAINER,
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


def rows_of(folder: Path, budget: float = 20.0) -> list[Row]:
    """Return a row for each spec that `init` proposes for a folder, without a word and with
    answers, or one that says why there is none.
    """
    search = partial(proven, budget=budget)
    rows = _rows(folder, Answers(), "nothing", search)
    if folder.name in SAID:
        rows += _rows(folder, said_on_the_line(SAID[folder.name]), SAID[folder.name], search)
    return rows


def _rows(folder: Path, answers: Answers, said: str, search: Search) -> list[Row]:
    with TemporaryDirectory() as place:
        try:
            drafts = start(folder, Path(place), answers=answers, search=search).drafts
        except UsageError:
            return [(folder.name, said, "-", "asks", *"-" * (len(COLUMNS) - 4))]
        return [
            (folder.name, said, *proposed(draft), *tried(draft, Path(place))) for draft in drafts
        ]


def proposed(draft: Draft) -> Row:
    """Name, target, levels and open questions of a draft."""
    told = draft.spec["target"]
    levels = draft.data.get("levels")
    held = f"{len(levels['at'])} levels of {levels['of']}" if levels else "nothing"
    found = draft.found.found.words if draft.found is not None else "not searched"
    return draft.name, told, held, found, str(draft.text().count("CHECK: "))


def tried(draft: Draft, place: Path) -> Row:
    """Return what `check` finds in a draft, the error of the model that `run` makes of it, and
    those of plainer models.
    """
    path = place / f"{draft.name}.yaml"
    path.write_text(draft.text(), encoding="utf-8")
    loaded = load(path)
    return _checked(loaded), *_run(loaded, place / "runs")


def _checked(loaded: LoadedSpec) -> str:
    counts = Counter(issue.severity for issue in inspect(loaded).issues)
    told = [
        f"{counts[word]} {word}{'s' if counts[word] > 1 else ''}"
        for word in ("error", "warning", "hint")
        if counts[word]
    ]
    return ", ".join(told) or "clean"


def _run(loaded: LoadedSpec, runs: Path) -> Row:
    try:
        files = RunFiles(bring_up_to_date(loaded, runs, "validate").run_dir)
    except MapmoreError as fault:
        return f"refused: {fault.message}", *"-" * len(PLAINER)
    rows = {score.model: score for score in deciding(files.validation().scores)}
    where = "held out" if rows[OWN].split == "validate" else "training"
    errors = {name: row.nrmse for name, row in rows.items()}
    return f"{_told(rows[OWN].nrmse)} {where}", *(_told(errors.get(name)) for name in PLAINER)


def _told(error: float | None) -> str:
    return "-" if error is None or not math.isfinite(error) else f"{100 * error:.2g} %"


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
        "What init proposes, and what comes of it",
        tuple(map(Column, COLUMNS)),
        tuple(every),
    )


if __name__ == "__main__":
    chosen = [data_folder() / name for name in sys.argv[1:]] or sorted(
        path for path in data_folder().iterdir() if path.is_dir()
    )
    for folder in chosen:  # each as soon as it is made: the rest may take long
        write_tables(PAGE, {"drafts": partial(table, {folder.name: rows_of(folder)})})
