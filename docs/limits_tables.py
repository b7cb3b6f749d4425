"""Write the tables of docs/limits.md, on the ends of curves and on the tested ranges:
`python docs/limits_tables.py RUNS`.

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

TESTED = {
    "festo/festo_10mm_10cm_strain": ("Festo muscle, 10 mm, 83 mm long", "strain"),
    "festo/festo_10mm_20cm_strain": ("Festo muscle, 10 mm, 182 mm long", "strain"),
    "festo/festo_10mm_30cm_strain": ("Festo muscle, 10 mm, 281 mm long", "strain"),
    "festo/festo_datasheet": ("Festo muscle, 20 mm, data sheet", "strain"),
    "bellows/bellows_strain": ("soft bellows", "strain"),
    "pgm/pgm_force": ("pneumatic gel muscle", "strain"),
    "cylinder/printed_cylinder": ("3D-printed cylinder", "displacement"),
    "coiled/coiled_steps": ("coiled muscle, pressure steps, 200 g", "displacement"),
    "coiled/coiled_loops": ("coiled muscle, slow cycles, 200 g", "displacement"),
}
"""Measured studies, the actuator of each, and the quantity that says how far it moved."""

MILLIMETRES = {"1": 1.0, "m": 1000.0, "mm": 1.0}


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


def tested(runs: Path) -> Table:
    """Return the smallest and largest pressure and movement of each measured study."""
    columns = (
        "actuator",
        "pressure, from [kPa] .4g",
        "to [kPa] .4g",
        "moved",
        "from .3g",
        "to .3g",
    )
    title = "Measured actuators on which models were tested, and the range of the data"
    return Table.of("tested", title, columns, [ranges(study, runs) for study in TESTED])


def ranges(study: str, runs: Path) -> tuple[Cell, ...]:
    """Return the row of a measured study: smallest and largest values over all its curves."""
    actuator, moved = TESTED[study]
    dataset = run(study, runs, until="ingest").dataset()
    pressure, movement = (
        np.concatenate([curve.columns[name] for curve in dataset.curves])
        for name in ("pressure", moved)
    )
    movement = MILLIMETRES[dataset.unit(moved)] * movement
    shown = moved if moved == "strain" else f"{moved} [mm]"
    return actuator, pressure.min(), pressure.max(), shown, movement.min(), movement.max()


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
    write_page("limits.md", {"ends": ends, "tested": tested})
