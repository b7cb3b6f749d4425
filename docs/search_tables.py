"""Write the table of docs/search.md from runs, which are brought up to date first: `python docs/search_tables.py RUNS`.

Names of studies behind `RUNS` make a table of these alone.

The measured recordings must be there (docs/data.md), and scikit-learn (extra `baselines`).
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from pages import DOCS, run, scores, write_tables

from mapmore_cli.domain.scores import BASELINES
from mapmore_cli.pipeline.search import SEARCH, read_search
from mapmore_cli.reporting.table import Cell, Column, Table

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

WORSE = 1.5
"""Times the best of all, above which a result is told."""


def row(study: str, runs: Path) -> tuple[Cell, ...]:
    """The found structure, its error on the held-out data in per cent, and those of the expert's, the black boxes and the formulas."""
    name, own, rivals = study.rpartition("/")[2], OF_DATA.get(study, ()), STUDIES[study]
    folder = run(study, runs, f"name={name}.found", *own, *BARE, f"validate.against=[{', '.join(rivals)}]")
    shipped = None if study.startswith("..") else _error(run(study, runs, f"name={name}.shipped", *own, "validate.against=[]"))
    search = read_search(folder / SEARCH)
    errors = {model: 100 * score.nrmse for model, score in scores(folder, "validate").items()}
    found = errors["mapmore"]
    box = min((model for model in BASELINES if model in errors), key=lambda model: errors[model])
    formula = min((errors[model] for model in FORMULAS if model in errors), default=None)
    best = min(error for error in (found, shipped, errors[box], formula) if error is not None)
    told = ("yes" if search.notes else "no") if found > WORSE * best else ""
    seconds = sum(tried.seconds for tried in search.tried)
    ratio = None if shipped is None else found / shipped
    return (name, search.found.words, found, shipped, ratio, errors[box], box, formula, round(seconds), told)


def _error(folder: Path) -> float:
    """The error of a run on its held-out data, %."""
    return 100 * scores(folder, "validate")["mapmore"].nrmse


def found_structures(runs: Path, studies: Iterable[str]) -> Table:
    """A row for every study."""
    heads = (Column("study"), Column("structure found"), *(Column(word, "%", ".3g") for word in ("found", "shipped")))
    boxes = (Column("found / shipped", "", ".2f"), Column("best black box", "%", ".3g"), Column("which"))
    rest = (Column("best formula", "%", ".3g"), Column("work", "s"), Column("told on its page"))
    rows = [row(study, runs) for study in studies]
    return Table("search", "NRMSE on the held-out data", (*heads, *boxes, *rest), tuple(rows), (summary(rows),))


def summary(rows: list[tuple[Cell, ...]]) -> str:
    """The mean ratio, how often a black box errs more, and how many results that are much worse than the best are told."""
    ratios = [one[4] for one in rows if one[4] is not None]
    below = sum(one[2] < one[5] for one in rows)  # type: ignore[operator]
    far = [one[9] for one in rows if one[9]]
    told = f"Above {WORSE:g} times the best of all: {len(far)}, of which {far.count('yes')} say so."
    mean = f"Geometric mean of found / shipped: {np.exp(np.mean(np.log(ratios))):.2f}. " if ratios else ""
    return f"{mean}Below the best black box in {below} of {len(rows)}. {told}"


if __name__ == "__main__":
    write_tables(DOCS / "search.md", {"search": lambda: found_structures(Path(sys.argv[1]), sys.argv[2:] or STUDIES)})
