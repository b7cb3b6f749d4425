"""Write the tables of docs/benchmarks.md from runs, which are brought up to date first: `python
docs/benchmark_tables.py RUNS [TABLE ...]`.

The measured recordings must be there (docs/data.md). The benchmarks' test records are not among
them: the end of each training record, which a model has not seen, takes their place, by the same
rule.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from pages import rms, run, scores, write_page

from mapmore_cli.modelling.kinds import simulate
from mapmore_cli.reporting.table import Cell, Table


class Benchmark(NamedTuple):
    """A record, how many outputs its rule gives, what is held out of the training record, and what
    was published for the test record.
    """

    study: str
    unit: str
    given: int
    held_out: str
    published: str


BENCHMARKS = {
    "cascaded tanks": Benchmark(
        "cascaded_tanks", "V", 4, "0.25", "GRU .396, polynomial NARX .413, LSTM .490, RNN .543"
    ),
    "EMPS": Benchmark(
        "emps", "m", 20, "0.5", "in the unit of the package: LSTM .074, RNN .089, FIR-MLP .121"
    ),
    "Bouc-Wen": Benchmark(
        "bouc_wen", "m", 250, "0.8", "PNLSS 1.87e-5, dynoNet 4.52e-5, NFIR 16.3e-5"
    ),
}
"""M. Schoukens and others, https://www.nonlinearbenchmark.org; figures as the package
nonlinear-benchmarks lists them.
"""

FRICTION = ("antagonist_pam", "mr_damper")


def benchmarks(runs: Path) -> Table:
    """Return the errors in free run at the held-out end of each training recording."""
    rows: list[tuple[Cell, ...]] = []
    for name, one in BENCHMARKS.items():
        changes = (
            f"data.split.validate={{last: {one.held_out}}}",
            "validate.against=[]",
            f"name={one.study}_benchmark",
        )
        files = run(f"identification/{one.study}", runs, *changes)
        model, dataset, fit = files.model(), files.dataset(), files.fit().memory
        assert fit is not None
        (curve,) = dataset.curves
        columns = {quantity: values[curve.held_out] for quantity, values in curve.columns.items()}
        error = (simulate(model, columns).values - columns[dataset.target])[one.given :]
        rows.append(
            (name, one.given, len(error), len(fit.model.terms), rms(error), one.unit, one.published)
        )
    titles = ("benchmark", "outputs given", "samples", "terms", "RMSE #.3g", "unit")
    return Table.of(
        "benchmarks",
        "Errors in free run at the held-out end of each recording",
        (*titles, "published, test record"),
        rows,
    )


def friction(runs: Path) -> Table:
    """Return what friction terms bring on held-out parts."""
    rows: list[tuple[Cell, ...]] = []
    for name in FRICTION:
        own, *others = scores(run(f"identification/{name}", runs)).values()
        rows.append(
            (name, *(cell for one in (own, others[0]) for cell in (one.model, 100 * one.nrmse)))
        )
    columns = ("record", "model", "NRMSE [%] .2f", "without friction", "its NRMSE [%] .2f")
    return Table.of(
        "friction", "Errors on held-out parts of recordings with friction", columns, rows
    )


if __name__ == "__main__":
    write_page("benchmarks.md", {"benchmarks": benchmarks, "friction": friction})
