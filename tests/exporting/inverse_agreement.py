"""The inverse in C at many targets beside a brute-force scan of the map.

python tests/exporting/inverse_agreement.py RUNS STUDY...     a row of docs/export.md for each study
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from agreement import compiled

from mapmore_cli.modelling.inverse import LOWEST, knots
from mapmore_cli.modelling.kinds import predict

TARGETS, SCAN, BLOCK = 10_000, 2000, 500
"""Targets, parts of the range that the scan looks at, and targets that are scanned at a time."""


@dataclass(frozen=True)
class Inversion:
    """A row: how many targets had one solution, several, or a range of them; the largest error;
    roots of the scan, and those missed.
    """

    study: str
    one: int
    several: int
    flat: int
    error: float
    roots: int
    missed: int

    def __str__(self):
        return (
            f"| {self.study} | {self.one} | {self.several} | {self.flat} | {self.error:.1e} | "
            f"{self.roots} | {self.missed} |"
        )


def inversion(study, model, name="pressure", n=TARGETS):
    """Targets at random places of the training range; the error is the output's, relative to it, or
    to one unit where it is smaller.
    """
    with tempfile.TemporaryDirectory() as folder:
        built = compiled(model, Path(folder), more=("-O2",), inverse=(name,))
    rng = np.random.default_rng(0)
    at = {
        quantity.name: rng.uniform(*knots(model, quantity.name)[[0, -1]], n)
        for quantity in model.inputs
    }
    wanted = predict(model, at)
    others = {one: x for one, x in at.items() if one != name}
    found, status = built.invert(wanted, others, name, LOWEST)
    assert not np.isnan(found).any(), "every target can be reached"
    error = np.abs(predict(model, {**others, name: found}) - wanted) / np.maximum(
        np.abs(wanted), 1.0
    )
    rows, roots, step = scanned(built, model, name, wanted, others)
    near = {**{one: x[rows] for one, x in others.items()}, name: roots}
    nearest, _ = built.invert(wanted[rows], near, name, LOWEST)
    missed = np.count_nonzero(~(np.abs(nearest - roots) <= step)) + np.count_nonzero(
        found[rows] > roots + step
    )
    return Inversion(
        study,
        status.count("one"),
        status.count("several"),
        status.count("flat"),
        float(error.max()),
        len(rows),
        missed,
    )


def scanned(built, model, name, wanted, others):
    """Rows and places of the roots that a fine scan brackets, where the map does not jump, and the
    step of the scan.
    """
    low, high = knots(model, name)[[0, -1]]
    grid = np.linspace(low, high, SCAN + 1)
    rows, cells = [], []
    for start in range(0, len(wanted), BLOCK):
        part = slice(start, start + BLOCK)
        columns = {one: np.repeat(x[part], len(grid)) for one, x in others.items()}
        count = len(wanted[part])
        missing = (
            built.run({**columns, name: np.tile(grid, count)})[0].reshape(count, -1)
            - wanted[part, None]
        )
        row, cell = np.nonzero(np.sign(missing[:, :-1]) * np.sign(missing[:, 1:]) < 0)
        rows.append(row + start)
        cells.append(cell)
    row, cell = np.concatenate(rows), np.concatenate(cells)
    left, right = grid[cell], grid[cell + 1]
    own = {one: x[row] for one, x in others.items()}
    sign = np.sign(built.run({**own, name: left})[0] - wanted[row])
    for _ in range(50):
        middle = (left + right) / 2
        same = np.sign(built.run({**own, name: middle})[0] - wanted[row]) == sign
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    reached = np.abs(built.run({**own, name: left})[0] - wanted[row]) <= 1e-6 * np.maximum(
        np.abs(wanted[row]), 1.0
    )
    return row[reached], left[reached], float(grid[1] - grid[0])


def main(runs, studies):
    """The table of docs/export.md."""
    from mapmore_cli.storage.artefacts import read_model

    print(
        "| study | one | several | flat | largest error | roots by scan | missed |\n"
        "|---|---:|---:|---:|---:|---:|---:|"
    )
    for study in studies:
        print(inversion(study, read_model(runs / study / "model.h5")), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
