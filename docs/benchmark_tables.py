"""Write the tables of docs/benchmarks.md from runs, which are brought up to date first: `python docs/benchmark_tables.py RUNS [TABLE ...]`.

The measured recordings must be there (docs/data.md). The benchmarks' test records are not among them: the end of each training record,
which a model has not seen, takes their place, by the same rule.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pages import CONFIGS, DOCS, finished, scores, write_tables

from mapmore_cli.modelling.kinds import simulate
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.spec.campaign import Entry
from mapmore_cli.storage.artefacts import read_dataset, read_fit, read_model


class Benchmark(NamedTuple):
    """A record, how many outputs its rule gives, what is held out of the training record, and what was published for the test record."""

    study: str
    unit: str
    given: int
    held_out: str
    published: str


BENCHMARKS = {
    "cascaded tanks": Benchmark("cascaded_tanks", "V", 4, "0.25", "GRU .396, polynomial NARX .413, LSTM .490, RNN .543"),
    "EMPS": Benchmark("emps", "m", 20, "0.5", "in the unit of the package: LSTM .074, RNN .089, FIR-MLP .121"),
    "Bouc-Wen": Benchmark("bouc_wen", "m", 250, "0.8", "PNLSS 1.87e-5, dynoNet 4.52e-5, NFIR 16.3e-5"),
}
"""M. Schoukens and others, https://www.nonlinearbenchmark.org; figures as the package nonlinear-benchmarks lists them."""

FRICTION = ("emps", "antagonist_pam", "mr_damper")


def benchmarks(runs: Path) -> Table:
    """Free runs over the held-out end of the training records, as the benchmarks' rule has it."""
    rows: list[tuple[Cell, ...]] = []
    for name, one in BENCHMARKS.items():
        changes = (f"data.split.validate={{last: {one.held_out}}}", "validate.against=[]", f"name={one.study}_benchmark")
        folder = finished(Entry(CONFIGS / "identification" / f"{one.study}.yaml", changes), runs).run_dir
        model, dataset = read_model(folder / "model.h5"), read_dataset(folder / "ingest.h5")
        (curve,) = dataset.curves
        columns = {quantity: values[curve.held_out] for quantity, values in curve.columns.items()}
        error = (simulate(model, columns).values - columns[dataset.target])[one.given :]
        rmse = float(np.sqrt(np.mean(error**2)))
        fit = read_fit(folder / "fit.h5").memory
        assert fit is not None
        rows.append((name, one.given, len(error), len(fit.model.terms), rmse, one.unit, one.published))
    titles = (Column("benchmark"), Column("outputs given"), Column("samples"), Column("terms"), Column("RMSE", "", "#.3g"), Column("unit"))
    return Table("benchmarks", "Free runs over the held-out end", (*titles, Column("published, test record")), tuple(rows))


def friction(runs: Path) -> Table:
    """Return what friction terms bring on held-out parts."""
    rows: list[tuple[Cell, ...]] = []
    for name in FRICTION:
        folder = finished(Entry(CONFIGS / "identification" / f"{name}.yaml", ()), runs).run_dir
        (own, *others) = scores(folder, "validate").values()
        rows.append((name, *(cell for one in (own, others[0]) for cell in (one.model, 100 * one.nrmse))))
    columns = (Column("record"), Column("model"), Column("NRMSE", "%", ".2f"), Column("without friction"), Column("its NRMSE", "%", ".2f"))
    return Table("friction", "Held-out parts of records with friction", columns, tuple(rows))


def tables(runs: Path) -> Mapping[str, Callable[[], Table]]:
    """Every table of the page, by its name there."""
    return {"benchmarks": lambda: benchmarks(runs), "friction": lambda: friction(runs)}


if __name__ == "__main__":
    found = tables(Path(sys.argv[1]))
    write_tables(DOCS / "benchmarks.md", {name: found[name] for name in sys.argv[2:] or found})
