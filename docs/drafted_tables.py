"""The table of docs/init-and-check.md: what `init` proposes for folders of measured data, with and
without answers, and what it gives.

`python docs/drafted_tables.py [FOLDER ...]` makes the rows of all folders in `MAPMORE_DATA` (by
default `../shared/data`) anew, or those of some. All of them take about twenty minutes. Every draft
is checked and run as it is: with its guesses, the `CHECK`s included.
"""

from __future__ import annotations

import math
import os
import sys
from collections import Counter
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from pages import DOCS, read_rows, write_tables

from mapmore_cli.annexes.drafting.answers import Answers, read_columns
from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.annexes.drafting.start import start
from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.domain.scores import OWN, deciding
from mapmore_cli.pipeline.inspection import inspect
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.reporting.table import Column, Table
from mapmore_cli.spec.loader import LoadedSpec, load
from mapmore_cli.storage.run_folder import RunFiles

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


SAID: Mapping[str, tuple[str, Answers]] = {
    folder: (words, Answers(read_columns(columns), target, length=length))
    for folder, columns, target, length, words in (
        ("printed_cylinder", "time:ms,_,_,_,displacement:mm,pressure:bar,force:N", None, None, ""),
        (
            "single_bellows",
            "time=Time:ms,strain=Tensile strain "
            "(Displacement):%,force=Force:N*-1,pressure=Pressure:psi",
            None,
            None,
            "",
        ),
        ("textile_arm", "time=0:s,pressure=4:psi,x=14:m", "x", None, "--target x"),
        ("bender", "time=0:s,p1=1:mbar,p2=3:mbar,angle=11:deg", "angle", None, "--target angle"),
        ("festo_20mm", "force:N*1.7444-18.595,pressure:kPa,time:s", None, 0.228, "--length 228mm"),
        (
            "pwm_finger",
            "time=time:s,p1=left_pressure:kPa,p2=right_pressure:kPa,q=q",
            "q",
            None,
            "--target q",
        ),
        (
            "mr_damper",
            "time=Tout:s,displacement=dist:mm,force=forc:N",
            "force",
            None,
            "--target force",
        ),
        ("drive", "time=t:s,input=vir:V,position=qm:m", "position", None, "--target position"),
    )
    for words in (f'--columns "{columns}" {words}'.strip(),)
}
"""What a person who knows the rig would say on the line, by folder."""


def rows_of(folder: Path) -> list[Row]:
    """Return a row for each spec that `init` proposes for a folder, without a word and with
    answers, or one that says why there is none.
    """
    found = _rows(folder, Answers(), "nothing")
    if folder.name in SAID:
        words, answers = SAID[folder.name]
        found += _rows(folder, answers, words)
    return found


def _rows(folder: Path, answers: Answers, said: str) -> list[Row]:
    with TemporaryDirectory() as place:
        try:
            found = start(folder, Path(place), answers=answers)
        except DataError as refusal:
            return [
                (
                    folder.name,
                    said,
                    "-",
                    refusal.message.rpartition(": ")[2],
                    *"-" * (len(COLUMNS) - 4),
                )
            ]
        return [
            (folder.name, said, *proposed(draft), *tried(draft, Path(place)))
            for draft in found.drafts
        ]


def proposed(draft: Draft) -> Row:
    """Name, target, levels and open questions of a draft."""
    target = draft.spec["target"]
    told = target if isinstance(target, str) else target["column"]
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
