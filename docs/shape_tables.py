"""Write the tables of docs/shape.md, with studies brought up to date first: `python
docs/shape_tables.py RUNS`.

The measured recordings must be there (docs/data.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path
from statistics import geometric_mean

import numpy as np
from pages import rms, run, write_page

from mapmore_cli.domain.declared import Word
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling.inverse import invert
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import pooled
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.recipe import Recipe
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.modelling.shape.region import region_of
from mapmore_cli.modelling.shape.stencils import asked_of
from mapmore_cli.modelling.shape.support import refuse_unsupported
from mapmore_cli.modelling.shape.violations import violations
from mapmore_cli.reporting.table import Cell, Table

PULLS: dict[str, Word] = {"pressure": "increasing", "strain": "decreasing"}
PUSHES: dict[str, Word] = {"pressure": "decreasing", "strain": "increasing"}
STUDIES = {
    "m2/dmsp-20-88-static": PULLS,
    "m2/peano-static": PULLS,
    "wrist/wrist-static-held-out": PULLS,
    "festo/festo_datasheet": PULLS,
    "festo/festo_10mm_10cm_strain": PULLS,
    "festo/festo_10mm_20cm_strain": PULLS,
    "festo/festo_10mm_30cm_strain": PULLS,
    "pgm/pgm_force": PULLS,
    "bellows/bellows_strain": PUSHES,
}
"""Static studies of the force, and what is known of it."""

FORMS, ORDERS = ("curves", "surface"), (2, 3, 4, 5)
MOST = 400  # samples of a curve that train or judge
NODES = 250_000  # of the grid on which a kept shape is looked for violations: ten times finer


@dataclass(frozen=True)
class Case:
    """A polynomial without a shape and with one, in this order, on one split of a study: errors on
    held-out rows, largest violations as parts of the range, and the share of these rows whose force
    several pressures make, outside of the slack.
    """

    study: str
    split: str
    levels: int
    form: str
    order: int
    errors: list[float]
    against: list[float]
    several: list[float]


def splits(curves: Sequence[Curve]) -> Iterator[tuple[str, list[Curve]]]:
    """Yield the split of the study, and others, made after everything else was fixed: three levels
    train, or every second.
    """
    yield "its own", list(curves)
    last, seen = len(curves) - 1, [[not curve.held_out.all() for curve in curves]]
    for name, kept in (
        ("three levels", {0, last // 2, last}),
        ("every second level", {*range(0, last, 2), last}),
    ):
        trains = [number in kept for number in range(len(curves))]
        if 2 < sum(trains) < len(curves) and trains not in seen:
            seen.append(trains)
            held_out = [np.full(one.size, not t) for one, t in zip(curves, trains, strict=True)]
            yield (
                name,
                [replace(c, held_out=out) for c, out in zip(curves, held_out, strict=True)],
            )


def _recipe(dataset: Dataset, form: str, order: int, fit: Fit) -> Recipe:
    if form == "surface":
        powers = [(i, j) for i, j in product(range(order + 1), repeat=2) if i + j <= order]
        terms = [f"pressure^{i}*strain^{j}" if i + j else "1" for i, j in powers]
    else:
        (along,) = {"pressure", "strain"} - {dataset.level}
        terms = ["1", along, *(f"{along}^{n}" for n in range(2, order + 1))]
    return Recipe(
        target="force",
        dictionary=tuple(terms),
        level=dataset.level if form == "curves" else None,
        fit=replace(fit, max_terms=len(terms), stop="bic"),
    )


@cache
def cases(config: str, runs: Path) -> list[Case]:
    """Return every polynomial of one study, where its training data support the shape."""
    dataset = run(config, runs, until="ingest").dataset()
    few = [
        curve.at(np.unique(np.linspace(0, curve.size - 1, MOST).astype(int)))
        for curve in sorted(dataset.curves, key=lambda curve: curve.level or 0.0)
    ]
    asked, found = Fit(shape=dict(STUDIES[config])), []
    for (split, curves), form, order in product(splits(few), FORMS, ORDERS):
        if form == "curves" and (dataset.level is None or min(c.size for c in curves) < order + 2):
            continue
        try:
            plain, shaped = (
                build(config, curves, _recipe(dataset, form, order, fit), dataset.quantities)
                for fit in (Fit(), asked)
            )
            names = [one.name for one in shaped.inputs]
            refuse_unsupported(curves, shaped.output.name, names, shaped.level, asked)
        except FitError:
            continue
        judged = [_judged(model, curves, asked) for model in (plain, shaped)]
        levels = sum(bool(curve.training.any()) for curve in curves)
        columns = map(list, zip(*judged, strict=True))
        found.append(Case(config.partition("/")[2], split, levels, form, order, *columns))
    return found


def _judged(model: Model, curves: Sequence[Curve], asked: Fit) -> tuple[float, float, float]:
    """Return the error on held-out rows, the largest violation, and the share of rows with several
    solutions.
    """
    region = region_of(model, curves, asked)
    assert region is not None
    rows = pooled([(curve, curve.held_out) for curve in curves])
    predicted = predict(model, rows)
    worst = max(one.share for one in violations(model, asked_of(asked), region, NODES))
    some = np.flatnonzero(region.holds(rows))[::10]
    strain = rows["strain"][some]
    inverse = invert(model, predicted[some], {"strain": strain}, "pressure")
    inside = region.holds({"pressure": inverse.values, "strain": strain[inverse.rows]})
    counts = np.bincount(inverse.rows[inside], minlength=len(some))
    return rms(predicted - rows["force"]), worst, float((counts > 1).mean())


def ratio_of(some: Sequence[Case]) -> float:
    """Return the geometric mean of held-out errors, with the shape over without."""
    return geometric_mean(one.errors[1] / one.errors[0] for one in some)


def _row(name: str, some: Sequence[Case]) -> tuple[Cell, ...]:
    ratios = [one.errors[1] / one.errors[0] for one in some]
    pairs = np.reshape([(*one.against, *one.several) for one in some], (-1, 4))
    head = (name, len(some), ratio_of(some), max(ratios))
    return *head, *(100 * pairs.max(axis=0)).tolist()


COLUMNS = (
    *("fits", "number", "error .2f", "worst .2f"),
    *("violation [%] .2g", "kept [%] .2g", "several [%] .2g", "kept several [%] .2g"),
)


def summary(runs: Path) -> Table:
    """Return what a shape brings over all studies and splits."""
    every = [case for config in STUDIES for case in cases(config, runs)]
    groups = {
        "curves": [one for one in every if one.form == "curves"],
        "surfaces": [one for one in every if one.form == "surface"],
        "more levels": [one for one in every if one.levels > 3],
        "three levels": [one for one in every if one.levels <= 3],
        "all": every,
    }
    rows = [_row(name, some) for name, some in groups.items()]
    refused = ", ".join(c.partition("/")[2] for c in STUDIES if not cases(c, runs)) or "none"
    note = f"Violations and several solutions without, and kept. Refused: {refused}."
    return Table.of("summary", "Polynomials of order 2 to 5", COLUMNS, rows, note)


def by_split(config: str, runs: Path) -> dict[tuple[str, str], list[Case]]:
    """Return the polynomials of a study by its name and split."""
    found: dict[tuple[str, str], list[Case]] = {}
    for one in cases(config, runs):
        found.setdefault((one.study, one.split), []).append(one)
    return found


def studies(runs: Path) -> Table:
    """Return the same, study by study and split by split."""
    parts = [part for config in STUDIES for part in by_split(config, runs).items()]
    rows = [_row(f"{study}, {split}", some) for (study, split), some in parts]
    return Table.of(
        "studies",
        "Error, violation and number of solutions for each study and split",
        COLUMNS,
        rows,
    )


TABLES = {"summary": summary, "studies": studies}

if __name__ == "__main__":
    write_page("shape.md", TABLES)
