"""Write the table of docs/limits.md on the ends of curves: `python docs/limits_tables.py RUNS`.

The measured recordings must be there (docs/data.md).
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from pages import own, run, write_page

from mapmore_cli.domain.models import Model, Pieces
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.reporting.table import Cell, Table

STUDIES = (
    "m1/dmsp-20-88-m1-static",
    "m1/peano-m1-static",
    "pgm/pgm_force",
    "bellows/bellows_strain",
)
PIECES = ("fit.max_terms=2", "model={type: mapmore}", "validate.against=[]")
"""What all of them are made of: pieces of two terms without a formula behind them."""

WAYS = ("saturate", "continue_linear", "continue")
STEP = 1e-7
"""Of the length of a curve, from which slopes on both sides of an end are computed."""


def row(study: str, way: str, runs: Path) -> tuple[Cell, ...]:
    """Return how far the slope of a study's pieces jumps where a curve ends, in per cent of the
    largest slope, and their error on held-out data.
    """
    name = study.rpartition("/")[2]
    files = run(study, runs, f"name={name}.{way}", *PIECES, f"fuse.extrapolation={way}")
    return name, way, 100 * max(jumps(files.model())), 100 * own(files).nrmse


def ends(runs: Path) -> Table:
    """Return a row for every study and what its pieces do beyond the end of a curve."""
    columns = (
        "study",
        "beyond a curve's end",
        "jump of the slope [% of the largest slope] .1f",
        "NRMSE, held out [%] .3g",
    )
    title = "The slope of the force where the shorter of two curves ends"
    rows = [row(study, way, runs) for study in STUDIES for way in WAYS]
    return Table.of("ends", title, columns, rows)


def jumps(model: Model) -> list[float]:
    """Return halfway between every two neighbouring levels how far the slope jumps where the
    shorter curve ends, over the largest slope up to the end of the longer one.
    """
    (along,) = (one.name for one in model.inputs if one.name != model.level)
    body = model.body
    assert isinstance(body, Pieces)
    assert body.level is not None
    found = list[float]()
    for one, other in pairwise(body.curves):
        assert one.level is not None
        assert other.level is not None
        shorter, longer = sorted(curve.limits[along][1] for curve in (one, other))
        low = min(curve.limits[along][0] for curve in (one, other))
        step = STEP * (longer - low)
        x = np.concatenate([shorter + step * np.arange(-1, 2), np.linspace(low, longer, 2001)])
        level = np.full(len(x), (one.level + other.level) / 2)
        force = predict(model, {body.level: level, along: x})
        before, after = np.diff(force[:3]) / step
        slopes = np.diff(force[3:]) / np.diff(x[3:])
        found.append(abs(float(after - before)) / float(np.abs(slopes).max()))
    return found


if __name__ == "__main__":
    write_page("limits.md", {"ends": ends})
