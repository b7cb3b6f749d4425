"""Write the table of docs/search.md from runs, which are brought up to date first: `python
docs/search_tables.py RUNS [ROW ...]`.

Names of rows behind `RUNS` make these anew, and leave the others as they are. Each row is written
as soon as it is made.

The measured recordings must be there (docs/data.md), and scikit-learn (extra `baselines`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pages import DOCS, asked, read_rows, run, scores, write_tables

from mapmore_cli.annexes.search.stage import rivals_beside
from mapmore_cli.domain.scores import OWN
from mapmore_cli.modelling.learners import LEARNERS
from mapmore_cli.modelling.simple import SIMPLE
from mapmore_cli.reporting.alerts import alerts_of
from mapmore_cli.reporting.table import Cell, Table
from mapmore_cli.storage.run_folder import RunFiles

PAGE = DOCS / "search.md"
BARE = (
    "dictionary=null",
    "segment=null",
    "fit=null",
    "fuse=null",
    "report=null",
    "model={type: auto}",
    "validate.simple=true",
)
"""What leaves `data`, `split` and `target` of a study."""

OF_FORCE = (*LEARNERS, "sarosi", "sarosi_hinged", "kerscher", "polynomial_5")
QUICK = tuple(name for name in LEARNERS if name != "gaussian_process")
"""Against models with a past, whose delayed inputs are too many for a Gaussian process."""

WORSE = 1.5
"""Times the best of all, above which a result is told."""

SLACK, NEAR = 1.01, 1.2
"""Times the better of black box and simple model, up to which a result is as good, and near."""


class Set(NamedTuple):
    """A study, what it is compared with, and what it holds out: its own split, another one in
    sight, and one made after the list.
    """

    study: str
    rivals: tuple[str, ...]
    other: str = ""
    new: str = ""
    changes: tuple[str, ...] = ()
    own: str = ""


SETS = {
    "festo_datasheet": Set(
        "festo/festo_datasheet", OF_FORCE, "{pressure: [100, 400]}", "{pressure: [100, 500]}"
    ),
    "pgm_force": Set("pgm/pgm_force", OF_FORCE, "{pressure: [50, 250]}", "{pressure: [50, 100]}"),
    "festo_10mm_10cm_pressure": Set(
        "festo/festo_10mm_10cm_pressure",
        OF_FORCE,
        "",
        "{pressure: {between: [[113, 173], [318, 378]]}}",
    ),
    "festo_10mm_20cm_pressure": Set(
        "festo/festo_10mm_20cm_pressure",
        OF_FORCE,
        "",
        "{pressure: {between: [[137, 197], [527, 587]]}}",
    ),
    "festo_10mm_30cm_pressure": Set(
        "festo/festo_10mm_30cm_pressure",
        OF_FORCE,
        "",
        "{pressure: {between: [[296, 356], [463, 523]]}}",
    ),
    "festo_10mm_10cm_strain": Set(
        "festo/festo_10mm_10cm_strain", OF_FORCE, "", "{strain: {between: [[0.03, 0.05]]}}"
    ),
    "festo_10mm_20cm_strain": Set(
        "festo/festo_10mm_20cm_strain", OF_FORCE, "", "{strain: {between: [[0.03, 0.05]]}}"
    ),
    "bellows_strain": Set(
        "bellows/bellows_strain", OF_FORCE, "", '{strain: ["8.33 %", "33.33 %", "41.67 %"]}'
    ),
    "festo_20mm": Set(
        "../docs/search/festo_20mm",
        OF_FORCE,
        "{pressure: {between: [[100, 160], [300, 360], [500, 560]]}}",
        "{pressure: {between: [[139, 199], [308, 368]]}}",
    ),
    "fmax_by_length": Set(
        "../docs/search/fmax_by_length",
        tuple(LEARNERS),
        "{pressure: [300, 500]}",
        "{length: {between: [[233 mm, 298 mm], [509 mm, 574 mm]]}}",
    ),
    "printed_cylinder": Set(
        "../docs/search/printed_cylinder",
        QUICK,
        "{pressure: [2 bar, 6 bar]}",
        "{pressure: [2 bar, 4 bar]}",
    ),
    "textile_arm": Set(
        "../docs/search/textile_arm",
        QUICK,
        "{files: [1009_data_collect_2.txt.gz]}",
        "{time: {between: [[28.6 s, 48.8 s]]}}",
    ),
    "coiled_loops": Set(
        "coiled/coiled_loops",
        QUICK,
        "",
        "{time: {between: [[6.9 s, 27.2 s]]}}",
        ("data.derive=null",),
    ),
    "coiled_steps": Set(
        "coiled/coiled_steps",
        QUICK,
        "",
        "{time: {between: [[6.3 s, 10.8 s]]}}",
        ("data.derive=null",),
    ),
    "cascaded_tanks": Set(
        "identification/cascaded_tanks",
        QUICK,
        "{time: {between: [[1000 s, 1800 s]]}}",
        "{time: {between: [[1340 s, 2567 s]]}}",
        own="{last: 0.3}",
    ),
    "buck": Set(
        "identification/buck",
        QUICK,
        "{files: [buck_id.csv]}",
        "{time: {between: [[0.004 s, 0.007 s]]}}",
    ),
    "motor_generator": Set(
        "identification/motor_generator", QUICK, "", "{time: {between: [[224710 s, 324610 s]]}}"
    ),
    "emps": Set(
        "identification/emps",
        QUICK,
        "{time: {between: [[5 s, 8 s], [15 s, 18 s]]}}",
        "{time: {between: [[7.6 s, 20 s]]}}",
    ),
    "antagonist_pam": Set(
        "identification/antagonist_pam",
        QUICK,
        "{last: 0.3}",
        "{time: {between: [[1.17 s, 2.07 s], [6.71 s, 7.61 s], [12.2 s, 13.1 s], [15.5 s, "
        "16.4 s]]}}",
    ),
    "mr_damper": Set(
        "identification/mr_damper",
        QUICK,
        "{last: 0.3}",
        "{time: {between: [[1.35 s, 2.1 s], [6.2 s, 6.95 s], [9.33 s, 10.1 s], [11.9 s, 12.7 s]]}}",
    ),
    "pwm_finger": Set(
        "../docs/search/pwm_finger",
        QUICK,
        "{files: [flex_60_q.csv, flex_180_q.csv]}",
        "{files: [flex_20_q.csv, flex_60_q.csv]}",
    ),
    "bender": Set("../docs/search/bender", QUICK, "", "{time: {between: [[108 s, 163 s]]}}"),
    "single_bellows": Set(
        "../docs/search/single_bellows", QUICK, "", "{time: {between: [[116 s, 179 s]]}}"
    ),
}
"""Measured sets. The splits in `new` hold out the same kind of thing elsewhere: places, levels or
files drawn by one seed (20261125), before any of them was run. The one other inner strain of the 10
mm muscles needed no drawing."""

LATEST = {
    "festo_datasheet": "{strain: {between: [[0.05128, 0.07332], [0.09057, 0.1126]]}}",
    "pgm_force": "{strain: {between: [[0.0689, 0.0972], [0.1459, 0.1742], [0.2134, 0.2417]]}}",
    "festo_10mm_10cm_pressure": "{strain: {between: [[-0.005, 0.005]]}}",
    "festo_10mm_20cm_pressure": "{pressure: {between: [[164, 206], [261, 303], [430, 472]]}}",
    "festo_10mm_30cm_pressure": "{pressure: {between: [[149, 216], [333, 400], [509, 576]]}}",
    "festo_10mm_10cm_strain": "{strain: {between: [[0.112, 0.122]]}}",
    "festo_10mm_20cm_strain": "{strain: {between: [[-0.005, 0.005]]}}",
    "bellows_strain": '{strain: ["58.33 %"]}',
    "festo_20mm": "{pressure: {between: [[119, 159], [351, 392]]}}",
    "fmax_by_length": "{pressure: [620]}",
    "printed_cylinder": "{displacement: {between: [[4.58 mm, 8.69 mm], [13.8 mm, 17.9 mm], "
    "[25.1 mm, 29.2 mm]]}}",
    "textile_arm": "{time: {between: [[21.6 s, 27.4 s]]}}",
}
"""Splits of the tables that were drawn by another seed (20261127) once list and rule were as they
are, ends of levels among them, and looked at once. Of the lengths the lowest pressure was drawn:
all forces are 0 there, which leaves no scale, and the highest was taken.
"""

NEWEST = {
    "festo_datasheet": "{pressure: [100, 300]}",
    "pgm_force": "{pressure: [50, 200]}",
    "festo_10mm_10cm_pressure": "{pressure: {between: [[167, 236], [322, 391], [497, 566]]}}",
    "festo_10mm_20cm_pressure": "{pressure: {between: [[98, 162], [207, 271], [387, 450]]}}",
    "festo_10mm_30cm_pressure": "{strain: {between: [[0.126, 0.136]]}}",
    "festo_10mm_10cm_strain": "{pressure: {between: [[99, 139], [531, 570]]}}",
    "festo_10mm_20cm_strain": "{strain: {between: [[0.119, 0.129]]}}",
    "bellows_strain": '{strain: ["16.67 %", "25.00 %"]}',
    "festo_20mm": "{strain: {between: [[-0.005, 0.005]]}}",
    "fmax_by_length": "{length: {between: [[155 mm, 277 mm], [418 mm, 540 mm], [663 mm, 785 mm]]}}",
    "printed_cylinder": "{pressure: [7 bar]}",
    "textile_arm": "{time: {between: [[35.37 s, 45.08 s]]}}",
    "coiled_loops": "{time: {between: [[6.407 s, 23.78 s]]}}",
    "coiled_steps": "{time: {between: [[3.107 s, 4.083 s], [11.04 s, 12.01 s]]}}",
    "cascaded_tanks": "{time: {between: [[665.2 s, 932 s], [1841 s, 2108 s], [2687 s, 2954 s], "
    "[3161 s, 3428 s]]}}",
    "buck": "{time: {between: [[0.003165 s, 0.004643 s], [0.005725 s, 0.007204 s]]}}",
    "motor_generator": "{time: {between: [[36590 s, 172300 s]]}}",
    "emps": "{time: {between: [[14.01 s, 15.75 s], [21.27 s, 23.02 s]]}}",
    "antagonist_pam": "{last: 0.38}",
    "mr_damper": "{time: {between: [[2.867 s, 7.6 s]]}}",
    "pwm_finger": "{files: [flex_100_q.csv, flex_180_q.csv]}",
    "bender": "{last: 0.25}",
    "single_bellows": "{last: 0.34}",
}
"""Splits that were drawn last (seed 20261202), once folds and lists were as they are, and looked at
once. Three of them had been looked at before, and one held no sample: bands were drawn instead
(seeds 20261203 and 20261204).
"""

ROWS = {
    **{name: (one, one.own, "yes") for name, one in SETS.items()},
    **{f"{name}, other split": (one, one.other, "yes") for name, one in SETS.items() if one.other},
    **{f"{name}, new split": (one, one.new, "yes") for name, one in SETS.items()},
    **{f"{name}, latest split": (SETS[name], split, "earlier") for name, split in LATEST.items()},
    **{f"{name}, newest split": (SETS[name], split, "no") for name, split in NEWEST.items()},
}
SIGHT = {
    "yes": "splits that were in sight",
    "earlier": "splits drawn after list and rule",
    "no": "newest splits, looked at once",
}
"""Whether a split was looked at while list and rule were made, in words."""


def row(name: str, runs: Path) -> tuple[Cell, ...]:
    """Return the found structure and its held-out error in per cent, beside the best black box and
    the best simple model or formula.
    """
    one, split, in_sight = ROWS[name]
    folder = f"name={name.replace(', ', '.').replace(' ', '_')}"
    held_out = (f"data.split={{validate: {split}}}",) if split else ()
    files = run(
        one.study,
        runs,
        folder,
        *one.changes,
        *held_out,
        *BARE,
        f"validate.against=[{', '.join(one.rivals)}]",
    )
    search = files.search()
    assert search is not None
    errors = {model: 100 * score.nrmse for model, score in scores(files).items()}
    box = min((model for model in LEARNERS if model in errors), key=lambda model: errors[model])
    simple = min(
        (model for model in errors if model not in (*LEARNERS, OWN, "repeatability")),
        key=lambda model: errors[model],
    )
    best = min(errors[box], errors[simple])
    kind = "table" if name.partition(",")[0] in LATEST else "recording"
    told = "" if errors[OWN] <= WORSE * best else says_so(alerts_without_rivals(files))
    seconds = round(sum(tried.seconds for tried in search.tried))
    shown = (
        search.found.words,
        search.found.parameters,
        errors[OWN],
        errors[box],
        box,
        errors[simple],
        simple,
        errors[OWN] / best,
    )
    return (name, kind, in_sight, *shown, seconds, told)


def alerts_without_rivals(files: RunFiles) -> list[str]:
    """Return the kinds of alerts that the page of a run would show if its study named no
    competitors, the worst first.
    """
    search, validation = files.search(), files.validation()
    assert search is not None
    shown = {OWN, *SIMPLE, *rivals_beside(search)}
    scores = tuple(score for score in validation.scores if score.model in shown)
    alerts = alerts_of(
        files.dataset(), files.model(), replace(validation, scores=scores), search=search
    )
    return list(dict.fromkeys(alert.kind for alert in alerts))


def says_so(alerts: Sequence[str]) -> str:
    """Return `yes` if an alert says that another model has a smaller error, and otherwise `no`."""
    return "yes" if {"competitor", "black box"} & {*alerts} else "no"


def table(runs: Path, name: str) -> Table:
    """Return the table with one row made anew."""
    heads = (
        "study",
        "kind",
        "in sight",
        "structure found",
        "parameters .0f",
        "found [%] .3g",
        "best black box [%] .3g",
        "which",
    )
    rest = (
        "best simple model [%] .3g",
        "its name",
        "found / better of both .2f",
        "work [s] .0f",
        "told on its page",
    )
    kept = {cells[0]: tuple(map(_number, cells)) for cells in read_rows(PAGE, "search")[1:]} | {
        name: row(name, runs)
    }
    rows = [kept[one] for one in ROWS if one in kept]
    return Table.of("search", "NRMSE on the held-out data", (*heads, *rest), rows, *summary(rows))


def _number(cell: str) -> Cell:
    """Return what a cell of the table holds: a number, nothing, or words."""
    try:
        return None if cell == "–" else float(cell)
    except ValueError:
        return cell


def summary(rows: list[tuple[Cell, ...]]) -> list[str]:
    """Return how often what was found is as good as black box and simple model, for tables and
    recordings, in sight and new.
    """
    told = []
    for kind in ("table", "recording"):
        for in_sight, words in SIGHT.items():
            ratios = np.array(
                [one[10] for one in rows if one[1:3] == (kind, in_sight)], dtype=float
            )
            if len(ratios):
                good, near = np.mean(ratios <= SLACK), np.mean(ratios <= NEAR)
                mean = (
                    f"geometric mean {np.exp(np.mean(np.log(ratios))):.2f}, worst "
                    f"{ratios.max():.2f}"
                )
                told.append(
                    f"{len(ratios)} {kind}s, {words}: as good as both in {good:.0%}, within "
                    f"{NEAR:g} times in {near:.0%}; {mean}."
                )
    far = [one[12] for one in rows if one[12]]
    return [
        *told,
        f"Above {WORSE:g} times the better of both: {len(far)}, of which {far.count('yes')} "
        "say so on their page.",
    ]


if __name__ == "__main__":
    runs, names = asked()
    for chosen in names or ROWS:
        write_tables(PAGE, {"search": partial(table, runs, chosen)})
