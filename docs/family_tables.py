"""Write the tables of docs/families.md: `python docs/family_tables.py RUNS`.

The measured recordings must be there (docs/data.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from statistics import geometric_mean

import numpy as np
from pages import rms, run, shipped, write_page

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.fitting.kinds.choices import model_choices
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature.backbone import fit_formula, pooled_training
from mapmore_cli.modelling.literature.family import adapted
from mapmore_cli.reporting.table import Cell, Table

STUDY = "festo/festo_10mm_lengths"
OF = "rest_length"
POINTS: Mapping[str, tuple[int, ...]] = {
    "none": (),
    "rest": (0,),
    "rest and second": (0, 1),
    "rest and third": (0, 2),
    "second and third": (1, 2),
    "first three": (0, 1, 2),
}
"""The levels of strain that a new specimen is measured at, counted from rest on."""


@cache
def measured(runs: Path) -> tuple[str, Dataset]:
    """Return the definition of the family, and all recordings as training data."""
    everything = ("name=festo_10mm_lengths_all", "data.split={}")
    return str(model_choices(shipped(STUDY, *everything).spec).model.name), run(
        STUDY, runs, *everything, until="ingest"
    ).dataset()


def lengths(runs: Path) -> list[float]:
    """Return the rest lengths, m."""
    return sorted({float(curve.columns[OF][0]) for curve in measured(runs)[1].curves})


@cache
def fitted(name: str, length: float, runs: Path, own: bool = False) -> FormulaFit:
    """Return a formula fitted to the muscles of the other lengths, or to the one of this length
    alone.
    """
    dataset = measured(runs)[1]
    held = [
        replace(c, held_out=np.full(c.size, (float(c.columns[OF][0]) == length) != own))
        for c in dataset.curves
    ]
    return fit_formula(name, [curve for curve in held if curve.training.any()], dataset.target)


def specimen(length: float, runs: Path) -> dict[str, Array]:
    """All samples of the muscle of a length."""
    dataset = measured(runs)[1]
    return pooled_training(
        [curve for curve in dataset.curves if float(curve.columns[OF][0]) == length]
    )


def nrmse(fit: FormulaFit, columns: Mapping[str, Array], rows: BoolArray) -> float:
    """RMSE over the largest force of the muscle, per cent."""
    error = literature.of(fit).predict(fit.parameters, columns) - columns["force"]
    return 100 * rms(error[rows]) / float(np.abs(columns["force"]).max())


def lengths_table(runs: Path) -> Table:
    """Each length predicted from the others."""
    family = measured(runs)[0]
    rows: list[tuple[Cell, ...]] = []
    for length in lengths(runs):
        columns = specimen(length, runs)
        everything = np.ones(len(columns["force"]), dtype=bool)
        found = [
            nrmse(fitted(name, length, runs), columns, everything)
            for name in (family, "sarosi_hinged", "sarosi")
        ]
        rows.append(
            (
                1000 * length,
                *found,
                nrmse(fitted("sarosi_hinged", length, runs, own=True), columns, everything),
            )
        )
    rows.append(
        ("geometric mean", *map(geometric_mean, zip(*(row[1:] for row in rows), strict=True)))
    )
    heads = ("family", "pooled sarosi_hinged", "pooled sarosi", "own fit of sarosi_hinged")
    columns_ = ("length [mm] .0f", *(f"{head} [%] .2f" for head in heads))
    return Table.of(
        "lengths", "NRMSE of a length that is predicted from the two others", columns_, rows
    )


def adapt_table(runs: Path) -> Table:
    """Return a new length adapted by its first levels, scored at its other levels."""
    family = measured(runs)[0]
    rows: list[tuple[Cell, ...]] = []
    for words, numbers in POINTS.items():
        before, after, alone = [], [], []
        for length in lengths(runs):
            columns, fit = specimen(length, runs), fitted(family, length, runs)
            strains = np.unique(columns["strain"])
            known = np.isin(columns["strain"], strains[list(numbers)])
            few = {name: values[known] for name, values in columns.items()}
            own = adapted(fit, few, few["force"], length)
            before.append(nrmse(fit, columns, ~known))
            after.append(nrmse(own, columns, ~known))
            if len(numbers) > 1:
                alone.append(
                    nrmse(
                        literature.get("sarosi_hinged").fit(few, few["force"]),
                        columns,
                        ~known,
                    )
                )
        means = [geometric_mean(one) if one else None for one in (before, after, alone)]
        rows.append((words, len(numbers), *means))
    heads = ("family as it is", "adapted", "fit to these levels alone")
    columns_ = ("levels measured", "count", *(f"{head} [%] .2f" for head in heads))
    return Table.of(
        "adapt",
        "NRMSE at the other levels of a new length, geometric mean over the lengths",
        columns_,
        rows,
    )


TABLES = {"lengths": lengths_table, "adapt": adapt_table}

if __name__ == "__main__":
    write_page("families.md", TABLES)
