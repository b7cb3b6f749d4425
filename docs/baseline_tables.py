"""Write the table of docs/baselines.md from runs, which are brought up to date first: `python docs/baseline_tables.py RUNS`.

The measured recordings must be there (docs/data.md), and scikit-learn (extra `baselines`).
"""

from __future__ import annotations

import sys
from pathlib import Path

from pages import DOCS, run, scores, write_tables

from mapmore_cli.domain.scores import BASELINES
from mapmore_cli.reporting.table import Column, Table
from mapmore_cli.storage.artefacts import read_dataset

STUDIES = (
    ("m2/dmsp-20-88-static", "simulated", "pressure"),
    ("m2/peano-static", "simulated", "pressure"),
    ("festo/festo_10mm_10cm_pressure", "measured", "two bands of pressure"),
    ("festo/festo_10mm_10cm_strain", "measured", "a strain"),
    ("festo/festo_10mm_30cm_strain", "measured", "a strain"),
    ("pgm/pgm_force", "measured", "two pressures"),
)
"""Shipped studies of static force, and what each holds out."""

RIVALS = ("sarosi", *BASELINES)


def row(study: str, runs: Path) -> tuple[float | int, ...]:
    """Training samples, and the NRMSE of every model on the held-out data of a study, in per cent."""
    name = study.rpartition("/")[2]
    folder = run(study, runs, f"name={name}.baselines", f"validate.against=[{', '.join(RIVALS)}]")
    samples = sum(int(curve.training.sum()) for curve in read_dataset(folder / "ingest.h5").curves)
    found = scores(folder, "validate")
    return (samples, *(100 * found[model].nrmse for model in ("mapmore", *RIVALS)))


def baselines(runs: Path) -> Table:
    """A row for every study."""
    heads = (Column("study"), Column("data"), Column("held out"), Column("training samples"))
    columns = (*heads, *(Column(model, "%", ".3g") for model in ("mapmore", *RIVALS)))
    rows = tuple((study.rpartition("/")[2], kind, held, *row(study, runs)) for study, kind, held in STUDIES)
    return Table("baselines", "NRMSE on the held-out data", columns, rows)


if __name__ == "__main__":
    write_tables(DOCS / "baselines.md", {"baselines": lambda: baselines(Path(sys.argv[1]))})
