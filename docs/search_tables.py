"""Write the tables of docs/search.md from runs, which are brought up to date first: `python docs/search_tables.py RUNS`.

Names of studies behind `RUNS` make their rows anew, and leave the others as they are. Each row is written as soon as it is made.

The measured recordings must be there (docs/data.md), and scikit-learn (extra `baselines`).
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import numpy as np
from pages import DOCS, own, read_rows, run, scores, write_tables

from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.results import Search
from mapmore_cli.domain.scores import BASELINES, OWN, SIMPLE
from mapmore_cli.fitting.searching import formula_beside
from mapmore_cli.pipeline.search import SEARCH, read_search
from mapmore_cli.reporting.score_tables import verdict
from mapmore_cli.reporting.table import Cell, Table
from mapmore_cli.storage.run_folder import RunFiles

PAGE = DOCS / "search.md"
FORMULAS = ("sarosi", "sarosi_hinged", "polynomial_2", "polynomial_5", "kerscher")
LEARNERS = tuple(name for name in BASELINES if name != "gaussian_process")
"""Against models with a past, whose delayed inputs are too many for a Gaussian process."""

OF_FORCE = (*BASELINES, *FORMULAS)
STUDIES = {
    "festo/festo_datasheet": OF_FORCE,
    "pgm/pgm_force": OF_FORCE,
    "festo/festo_10mm_10cm_pressure": OF_FORCE,
    "coiled/coiled_steps": LEARNERS,
    "coiled/coiled_loops": LEARNERS,
    "identification/cascaded_tanks": LEARNERS,
    "identification/antagonist_pam": LEARNERS,
    "identification/mr_damper": LEARNERS,
    "identification/buck": LEARNERS,
    "../docs/search/festo_20mm": OF_FORCE,
    "../docs/search/fmax_by_length": BASELINES,
    **{f"../docs/search/{name}": LEARNERS for name in ("printed_cylinder", "single_bellows", "textile_arm", "bender", "pwm_finger")},
    "identification/emps": LEARNERS,
}
"""Studies of measured data, and what they are compared with: shipped ones, whose structure an expert chose, and minimal ones."""

BARE = ("dictionary=null", "segment=null", "fit=null", "fuse=null", "report=null", "model={type: auto}")
"""What leaves `data`, `split` and `target` of a study."""

OF_DATA = {
    "identification/cascaded_tanks": ("data.split={validate: {last: 0.3}}",),
    "coiled/coiled_steps": ("data.derive=null", "validate.against=[]"),
    "coiled/coiled_loops": ("data.derive=null", "validate.against=[]"),
}
"""Of a study that holds nothing out; of those whose rates are there for competitors."""

OTHERS = {
    "festo_datasheet": ("festo/festo_datasheet", "{pressure: [100, 400]}"),
    "pgm_force": ("pgm/pgm_force", "{pressure: [50, 250]}"),
    "festo_10mm_20cm_pressure": ("festo/festo_10mm_20cm_pressure", ""),
    "festo_10mm_30cm_pressure": ("festo/festo_10mm_30cm_pressure", ""),
    "festo_10mm_20cm_strain": ("festo/festo_10mm_20cm_strain", ""),
    "festo_10mm_10cm_strain": ("festo/festo_10mm_10cm_strain", ""),
    "bellows_strain": ("bellows/bellows_strain", ""),
    "festo_20mm": ("../docs/search/festo_20mm", "{pressure: {between: [[100, 160], [300, 360], [500, 560]]}}"),
    "fmax_by_length": ("../docs/search/fmax_by_length", "{pressure: [300, 500]}"),
    "printed_cylinder": ("../docs/search/printed_cylinder", "{pressure: [2 bar, 6 bar]}"),
    "textile_arm": ("../docs/search/textile_arm", "{files: [1009_data_collect_2.txt.gz]}"),
    "pwm_finger": ("../docs/search/pwm_finger", "{files: [flex_60_q.csv, flex_180_q.csv]}"),
    "buck": ("identification/buck", "{files: [buck_id.csv]}"),
    "motor_generator": ("identification/motor_generator", ""),
    "mr_damper": ("identification/mr_damper", "{last: 0.3}"),
    "antagonist_pam": ("identification/antagonist_pam", "{last: 0.3}"),
    "emps": ("identification/emps", "{time: {between: [[5 s, 8 s], [15 s, 18 s]]}}"),
    "cascaded_tanks": ("identification/cascaded_tanks", "{time: {between: [[1000 s, 1800 s]]}}"),
}
"""Other splits of the same data, and other data: their shipped studies, and what is held out instead."""

WORSE = 1.5
"""Times the best of all, above which a result is told."""


def row(study: str, runs: Path) -> tuple[Cell, ...]:
    """Return the found structure, its held-out error in per cent, and those of the expert's, the black boxes and the formulas."""
    name, changes, rivals = study.rpartition("/")[2], OF_DATA.get(study, ()), STUDIES[study]
    files = run(study, runs, f"name={name}.found", *changes, *BARE, f"validate.against=[{', '.join(rivals)}]")
    experts = None if study.startswith("..") else run(study, runs, f"name={name}.shipped", *changes, "validate.against=[]")
    shipped = None if experts is None else 100 * own(experts).nrmse
    search = read_search(files.folder / SEARCH)
    errors = {model: 100 * score.nrmse for model, score in scores(files).items()}
    found = errors["mapmore"]
    box = min((model for model in BASELINES if model in errors), key=lambda model: errors[model])
    formula = min((errors[model] for model in FORMULAS if model in errors), default=None)
    best = min(error for error in (found, shipped, errors[box], formula) if error is not None)
    told = ("yes" if says_so(files, search) else "no") if found > WORSE * best else ""
    seconds = sum(tried.seconds for tried in search.tried)
    ratio = None if shipped is None else found / shipped
    return (name, search.found.words, found, shipped, ratio, errors[box], box, formula, round(seconds), told)


def other_splits(runs: Path, name: str) -> Table:
    """Return the table of other splits with one row made anew: the found structure and its error, beside the best black box."""
    study, split = OTHERS[name]
    rivals = STUDIES.get(study, LEARNERS if study.startswith("identification") else OF_FORCE)
    held_out = (f"data.split={{validate: {split}}}",) if split else ()
    files = run(study, runs, f"name={name}.other", *held_out, *BARE, f"validate.against=[{', '.join(rivals)}]")
    errors = {model: 100 * score.nrmse for model, score in scores(files).items()}
    box = min((model for model in BASELINES if model in errors), key=lambda model: errors[model])
    made = (name, split or "as shipped", read_search(files.folder / SEARCH).found.words, errors["mapmore"], errors[box], box)
    every = {cells[0]: tuple(map(_number, cells)) for cells in read_rows(PAGE, "others")[1:]} | {name: made}
    rows = [every[one] for one in OTHERS if one in every]
    below = sum(row[3] < row[4] for row in rows)  # type: ignore[operator]
    ratios = np.array([row[3] / row[4] for row in rows])  # type: ignore[operator]
    mean = f"found / best black box: {np.exp(np.mean(np.log(ratios))):.2f} in the geometric mean, at most {ratios.max():.2f}"
    told = f"Below the best black box in {below} of {len(rows)}; {mean}."
    heads = ("study", "held out", "structure found", "found [%] .3g")
    return Table.of("others", "NRMSE on other held-out data", (*heads, "best black box [%] .3g", "which"), rows, told)


def says_so(files: RunFiles, search: Search) -> bool:
    """Whether the page of a study that names no competitors says that another model errs less: on its first lines, by verdict or note."""
    shown = {OWN, *SIMPLE, formula_beside(search)}
    rows = [row for row in files.validation().scores if row.model in shown]
    text = verdict(rows, OWN, Quantity(rows[0].target, ""))
    return "is worse" in text or any("errs" in note for note in search.notes)


def found_structures(runs: Path, study: str) -> Table:
    """Return the table with the row of a study made anew."""
    heads = ("study", "structure found", *(f"{word} [%] .3g" for word in ("found", "shipped")))
    boxes = ("found / shipped .2f", "best black box [%] .3g", "which")
    rest = ("best formula [%] .3g", "work [s] .0f", "told on its page")
    kept = {cells[0]: tuple(map(_number, cells)) for cells in read_rows(PAGE, "search")[1:]}
    every = {**kept, study.rpartition("/")[2]: row(study, runs)}
    rows = [every[name] for one in STUDIES if (name := one.rpartition("/")[2]) in every]
    return Table.of("search", "NRMSE on the held-out data", (*heads, *boxes, *rest), rows, summary(rows))


def _number(cell: str) -> Cell:
    """Return what a cell of the table holds: a number, nothing, or words."""
    try:
        return None if cell == "–" else float(cell)
    except ValueError:
        return cell


def summary(rows: list[tuple[Cell, ...]]) -> str:
    """Return the mean ratio, how often a black box errs more, and how many results that are much worse than the best are told."""
    ratios = [one[4] for one in rows if one[4] is not None]
    below = sum(one[2] < one[5] for one in rows)  # type: ignore[operator]
    far = [one[9] for one in rows if one[9]]
    told = f"Above {WORSE:g} times the best of all: {len(far)}, of which {far.count('yes')} say so."
    mean = f"Geometric mean of found / shipped: {np.exp(np.mean(np.log(ratios))):.2f}. " if ratios else ""
    return f"{mean}Below the best black box in {below} of {len(rows)}. {told}"


if __name__ == "__main__":
    for chosen in sys.argv[2:] or [*STUDIES, *OTHERS]:
        name, make = ("search", found_structures) if chosen in STUDIES else ("others", other_splits)
        write_tables(PAGE, {name: partial(make, Path(sys.argv[1]), chosen)})
