"""Write the tables of docs/baselines.md from runs, which are brought up to date first: `python docs/baseline_tables.py RUNS [TABLE ...]`.

The measured recordings must be there (docs/data.md), and scikit-learn (extra `baselines`).
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

from pages import CONFIGS, DOCS, run, scores, write_tables

from mapmore_cli.domain.scores import BASELINES, OWN, REPEATABILITY, SIMPLE
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.spec.loader import load
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
    """Return a row for every study."""
    heads = (Column("study"), Column("data"), Column("held out"), Column("training samples"))
    columns = (*heads, *(Column(model, "%", ".3g") for model in ("mapmore", *RIVALS)))
    rows = tuple((study.rpartition("/")[2], kind, held, *row(study, runs)) for study, kind, held in STUDIES)
    return Table("baselines", "NRMSE on the held-out data", columns, rows)


POLYNOMIALS = ("plane", "quadratic", "cubic")


def studies_of_papers() -> list[str]:
    """Return the simulated studies that have their paper's competitors alone, and hold something out."""
    found = []
    for folder in ("m1", "m2", "wrist", "muscle-like"):
        for path in sorted(path for path in (CONFIGS / folder).glob("*.yaml") if not path.name.startswith("_")):
            loaded = load(path)
            spec = loaded.spec
            if spec.data.split.hold_out is not None and not spec.validation.simple and "/datasets/" in loaded.resolved:
                found.append(f"{folder}/{path.stem}")
    return found


def beside(study: str, runs: Path) -> dict[str, float]:
    """NRMSE on the held-out data, in per cent, of the model, its page's competitors, and polynomials of its inputs."""
    folder = run(study, runs, f"name={study.rpartition('/')[2]}.polynomials", "validate.simple=true")
    return {model: 100 * one.nrmse for model, one in scores(folder, "validate").items() if model != REPEATABILITY}


def polynomials(runs: Path) -> Table:
    """Return a row for every study of a paper."""
    rows: list[tuple[Cell, ...]] = []
    ahead = 0
    for study in studies_of_papers():
        found = beside(study, runs)
        best = min((model for model in found if model not in (*SIMPLE, OWN)), key=found.__getitem__, default=None)
        shown = [found[name] for name in POLYNOMIALS]
        rows.append((study.rpartition("/")[2], found[OWN], best, None if best is None else found[best], *shown))
        ahead += min(shown) < found[OWN]
    columns = (Column("study"), Column("mapmore", "%", ".3g"), Column("best of its page"), Column("its error", "%", ".3g"))
    note = f"A polynomial is ahead of mapmore in {ahead} of {len(rows)} studies, picked afterwards."
    polynomial = (Column(name, "%", ".3g") for name in POLYNOMIALS)
    return Table("polynomials", "NRMSE on the held-out data", (*columns, *polynomial), tuple(rows), (note,))


if __name__ == "__main__":
    made = {"baselines": baselines, "polynomials": polynomials}
    write_tables(DOCS / "baselines.md", {name: partial(made[name], Path(sys.argv[1])) for name in sys.argv[2:] or made})
