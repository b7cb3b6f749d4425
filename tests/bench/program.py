"""The program as its users meet it: start-up, a run that is up to date, and the model that it
made.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from common import weight_of
from timing import in_turn, median_seconds

from mapmore_cli.modelling.expressions import evaluate, parse
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.storage.artefacts import read_model

STUDY = Path(__file__).parents[2] / "configs" / "m2" / "dmsp-20-88-static.yaml"
POINTS = 1_000_000
RUNS = 5
LIBRARIES = "import numpy, typer, pydantic\nclass Model(pydantic.BaseModel):\n    x: int"
"""What a command that reads a spec cannot do without."""


def mapmore(*arguments):
    command = [sys.executable, "-m", "mapmore_cli", *map(str, arguments)]
    return lambda: subprocess.run(command, check=True, capture_output=True, env=os.environ)


def start_up(runs_folder):
    """Seconds of the shortest command, of a run with everything to do and of one with nothing,
    beside Python's start and its libraries'.
    """
    run = mapmore("run", STUDY, "--runs", runs_folder)
    whole_run = median_seconds(run, 1)
    return {
        "python": median_seconds(
            lambda: subprocess.run([sys.executable, "-c", "pass"], check=True), RUNS
        ),
        "libraries": median_seconds(
            lambda: subprocess.run([sys.executable, "-c", LIBRARIES], check=True), RUNS
        ),
        "version": median_seconds(mapmore("--version"), RUNS),
        "first_run": whole_run,
        "run_up_to_date": median_seconds(run, RUNS),
        "check": median_seconds(mapmore("check", STUDY), RUNS),
    }


def small_table(folder):
    """Seconds of `init` and of the first `run` for a table of 60 points: Sarosi's formula and a
    slack foot, with noise of 0.2 %.
    """
    pressure, strain = (
        column.ravel()
        for column in np.meshgrid(np.linspace(50, 600, 12), np.linspace(0.0, 0.2, 5), indexing="ij")
    )
    force = np.maximum(
        (2.4 * pressure + 300) * np.exp(-9 * strain) - 1.2 * pressure * strain - 350, 0.0
    )
    force += 0.002 * force.max() * np.random.default_rng(0).standard_normal(len(force))
    table, spec = Path(folder) / "table.csv", Path(folder) / "table.yaml"
    rows = np.column_stack([pressure, strain, force])
    np.savetxt(
        table, rows, fmt="%.6g", delimiter=",", header="pressure_kPa,strain,force_N", comments=""
    )
    draft = mapmore("init", table, "-o", spec, "--force")
    run = mapmore("run", spec, "--runs", Path(folder) / "table", "--force")
    return {"points": len(force), "init": median_seconds(draft, 3), "run": median_seconds(run, 3)}


def evaluation(runs_folder):
    """The fused model of that run at a million points, and the terms of the segments that count
    there, evaluated on rows in order.

    The latter is the least that any evaluation has to do.
    """
    model = read_model(next(Path(runs_folder).rglob("model.h5")))
    rng = np.random.default_rng(0)
    body = model.pieces
    levels = [curve.level for curve in body.curves]
    columns = {
        "pressure": rng.uniform(levels[0], levels[-1], POINTS),
        "strain": rng.uniform(0, max(curve.limits["strain"][1] for curve in body.curves), POINTS),
    }
    parts = [
        (segment, np.flatnonzero(weight_of(body, {segment.id}, columns)))
        for segment in body.segments
    ]
    ordered = [
        ([parse(term) for term in segment.terms], {name: x[rows] for name, x in columns.items()})
        for segment, rows in parts
    ]
    took = in_turn(
        {
            "fused_model": lambda: predict(model, columns),
            "active_terms": lambda: [evaluate(term, at) for terms, at in ordered for term in terms],
        },
        RUNS,
    )
    return {
        "points": POINTS,
        "active_terms_per_point": sum(len(segment.terms) * len(rows) for segment, rows in parts)
        / POINTS,
        **took,
        "evaluations_per_second": POINTS / took["fused_model"],
    }
