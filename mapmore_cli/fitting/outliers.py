"""Training samples that lie far from a robust fit: where they stand in their files."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.results import FitResult, Outlier
from mapmore_cli.modelling.frols.robust import FAR, Robust, outlying
from mapmore_cli.modelling.selection import Fit

MOST = 500  # outliers that are listed; the note counts all
TOLD = 3  # of them in the note

Residuals = Iterable[tuple[IntArray, Array, Array, Array]]
"""Of each part of a fit: rows of its samples over all curves in a row, what the fit leaves of them,
their uncertainties and the target, (n,) each.
"""


def with_outliers(result: FitResult, fit: Fit, dataset: Dataset, residuals: Residuals) -> FitResult:
    """Return a robust fit with its outliers, the farthest first, and a note; another as it is."""
    robust = Robust.of(fit)
    if robust is None:
        return result
    far: dict[int, tuple[float, float]] = {}
    for rows, left, sigma, y in residuals:
        out, scale = outlying(robust, left / sigma, y / sigma)
        for row, off, unit in zip(rows[out], left[out], sigma[out], strict=True):
            scales = abs(off) / (unit * scale)
            far[int(row)] = max(far.get(int(row), (0.0, 0.0)), (float(scales), float(off)))
    ranked = sorted(far.items(), key=lambda one: (-one[1][0], one[0]))[:MOST]
    listed = tuple(_outlier(dataset, row, off, scales) for row, (scales, off) in ranked)
    unit = dataset.unit(dataset.target)
    worst = ", ".join(f"{one.place} ({one.off:+.3g} {unit})" for one in listed[:TOLD])
    more = ", ..." if len(listed) > TOLD else ""
    note = (
        f"{len(far)} training sample(s) lie more than {FAR:g} scales from the fit and count less "
        f"in it; none is left out of the scores: {worst}{more}"
    )
    return replace(result, outliers=listed, notes=(*result.notes, *([note] if far else [])))


def _outlier(dataset: Dataset, row: int, off: float, scales: float) -> Outlier:
    ends = np.cumsum([curve.size for curve in dataset.curves])
    number = int(np.searchsorted(ends, row, side="right"))
    curve = dataset.curves[number]
    row -= int(ends[number]) - curve.size
    name = curve.recordings[0 if curve.origin is None else int(curve.origin[row])]
    recording = next(one for one in dataset.recordings if one.id == name)
    at = _row_of_file(dataset, curve, row, name)
    return Outlier(name, recording.source, at or row + 1, at > 0, curve.id, off, scales)


def _row_of_file(dataset: Dataset, curve: Curve, row: int, name: str) -> int:
    """Return the row of the file that a sample of a curve is from: the one with the same values;
    0 where it is not known.
    """
    recording = next(one for one in dataset.recordings if one.id == name)
    shared = [one for one in recording.columns if one in curve.columns]
    same = np.logical_and.reduce(
        [
            recording.columns[one] == curve.columns[one][row]
            for one in shared
            if one not in (dataset.target, dataset.level)
        ]
    )
    places = np.flatnonzero(same)
    return int(recording.row_numbers[places[0]]) if places.size == 1 else 0
