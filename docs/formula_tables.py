"""Write the table of docs/formulas.md: `python docs/formula_tables.py RUNS`.

Every formula is fitted to the training data of shipped studies, and its error stands beside the
least that an independent global search finds (`global_fits`).
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from global_fits import FITS, least_rmse
from pages import run, shipped, write_page

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature import hinge
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.literature.formulas.sarosi_hysteresis_loss import HysteresisLoss
from mapmore_cli.reporting.table import Cell, Table

STUDIES = (
    "m1/dmsp-20-88-m1-static",
    "m1/peano-m1-static",
    "m1/dmsp-20-88-m1-hysteresis",
    "m1/peano-m1-hysteresis",
    "wrist/wrist-static",
    "m2/dmsp-20-88-damping",
    "m2/peano-damping",
    "muscle-like/muscle-like-16cm",
)

OF_ANY = ("sarosi", "polynomial_2", "polynomial_5")
"""What M1 fits to hysteresis too."""

LOSS = "sarosi_hysteresis_loss"


class Fitted(NamedTuple):
    """A formula fitted to the training data of a study, and the least error that it can have."""

    fit: FormulaFit
    ours: float
    least: float

    @property
    def ratio(self) -> float:
        """Our error over the least."""
        return self.ours / self.least


def formulas_of(study: str) -> list[str]:
    """Return the formulas that may stand against the target of a study."""
    spec = shipped(study).spec
    if spec.target == "hysteresis":
        return [*OF_ANY]
    component = spec.target if spec.target in ("static", "damping") else None
    inputs = {*spec.data.columns, *spec.data.derive, "pressure"}
    known = [
        name
        for name in FITS
        if (one := literature.get(name)).component == component
        or (component is None and inputs >= {*one.inputs})
    ]
    return [*known, LOSS] if component == "damping" else known


def fitted(study: str, name: str, runs: Path) -> Fitted:
    """Fit a formula to the training data of a study, by the package and by the global search."""
    spec = shipped(study).spec
    lengths = {"length": spec.muscle.length, "diameter": spec.muscle.diameter}
    sizes = {key: np.asarray(value) for key, value in lengths.items()}
    if name == LOSS:
        needed = f"m2/{Path(str(spec.needs.static)).stem}"
        return _loss(pooled(needed, runs)[0], lengths["length"])
    columns, y = pooled(study, runs)
    fit = literature.get(name).of_muscle(lengths).fit(columns, y)
    return Fitted(fit, rmse(fit), least_rmse(name, {**sizes, **columns}, y))


def _loss(cycles: Columns, length: float | None) -> Fitted:
    """Return Sárosi's formula on both branches of load cycles."""
    formula = literature.get(LOSS)
    assert isinstance(formula, HysteresisLoss)
    assert length is not None
    fit = formula.fit_cycles(cycles, length)
    ways = (cycles["force"] + way * cycles["hysteresis"] for way in (1, -1))
    least = [least_rmse("sarosi", cycles, branch) for branch in ways]
    return Fitted(fit, rmse(fit), float(np.sqrt(np.mean(np.square(least)))))


@cache
def pooled(study: str, runs: Path) -> tuple[dict[str, Array], Array]:
    """Return the training samples of a study and their target."""
    dataset = run(study, runs, until="ingest").dataset()
    columns = pooled_training(dataset.curves)
    return columns, columns[dataset.target]


def rmse(fit: FormulaFit) -> float:
    """Return the training error of a fit."""
    return float(np.sqrt(fit.sse / fit.samples))


def competitors(runs: Path) -> Table:
    """Return a row for every formula of every study."""
    columns = (
        *("study", "formula", "ours [N] .5g", "global [N] .5g", "ratio .4f"),
        *("rank", "condition .2g", "status"),
    )
    rows = [*_rows(runs)]
    worst = max(row[4] for row in rows if isinstance(row[4], float))
    note = f"The largest ratio of {len(rows)} is {worst:.4f}."
    return Table.of(
        "competitors", "Training error compared with that of a global search", columns, rows, note
    )


def _rows(runs: Path) -> Iterator[tuple[Cell, ...]]:
    for study in STUDIES:
        for name in formulas_of(study):
            one = fitted(study, name, runs)
            rank, condition, status = one.fit.rank, one.fit.condition, one.fit.status
            yield (
                *(study.rpartition("/")[2], name, one.ours, one.least, one.ratio),
                *(rank, condition, status),
            )


# The constants of the hinge's fit
# --------------------------------------------------------------------------------------------------

HINGED = ("m1/dmsp-20-88-m1-static", "m1/peano-m1-static")
LEVELS = (3, 5)
WITHIN = 0.01  # of the largest strain: samples that stand for a level
REPEATS = 20  # of each, as a slow recording has them


def hinge_constants(runs: Path) -> Table:
    """Return what half and twice each constant of `literature/hinge.py` make of the errors between
    a few strain levels.
    """
    base, rows = between_levels(runs), list[tuple[Cell, ...]]()
    for name, why in reasons().items():
        value = getattr(hinge, name)
        changed = [_error_with(name, value, factor, runs) / base for factor in (0.5, 2)]
        rows.append((name, str(value), *changed, why))
    columns = ("constant", "value", "at half .3f", "at twice .3f", "why")
    title = "Error with half or twice a constant divided by the error with the constant"
    note = (
        f"Fitted to {LEVELS[0]} or {LEVELS[1]} strain levels of {len(HINGED)} simulated muscles, "
        f"the formula has an error of {100 * base:.3g} % of the largest force at all other levels "
        "(geometric mean)."
    )
    return Table.of("hinge", title, columns, rows, note)


def reasons() -> dict[str, str]:
    """Return why each constant has its value, as the comment above it says."""
    found = re.findall(r"((?:^# .+\n)+)([A-Z0-9_]+) = ", inspect.getsource(hinge), re.MULTILINE)
    return {name: text.replace("# ", "").replace("\n", " ").strip() for text, name in found}


def _error_with(name: str, value: Any, factor: float, runs: Path) -> float:
    """Return the error with a constant changed; whole numbers stay whole."""
    changed = [type(one)(one * factor) for one in (value if isinstance(value, tuple) else (value,))]
    setattr(hinge, name, tuple(changed) if isinstance(value, tuple) else changed[0])
    try:
        return between_levels(runs)
    finally:
        setattr(hinge, name, value)


def between_levels(runs: Path) -> float:
    """Return the geometric mean of the errors between strain levels, over the largest force."""
    errors = []
    for study in HINGED:
        columns, y = pooled(study, runs)
        strain = columns["strain"] / columns["strain"].max()
        for count in LEVELS:
            at = np.abs(strain * (count - 1) % 1.0 - 0.5) > 0.5 - WITHIN * (count - 1)
            few = {name: np.repeat(values[at], REPEATS) for name, values in columns.items()}
            formula = literature.get("sarosi_hinged")
            fit = formula.fit(few, np.repeat(y[at], REPEATS))
            missed = formula.predict(fit.parameters, columns) - y
            errors.append(float(np.sqrt(np.mean(missed[~at] ** 2)) / np.abs(y).max()))
    return float(np.exp(np.mean(np.log(errors))))


if __name__ == "__main__":
    write_page("formulas.md", {"competitors": competitors, "hinge": hinge_constants})
