"""Simulate how often new curves lie in their intervals: tables `coverage`, `spread` and `bent` of
docs/intervals.md.

A campaign measures K levels at n recordings each. A recording is the sum of a surface that is
linear in the level and linear in the strain, an offset that is the same for all its samples, and
noise of standard deviation one. It has samples at `SAMPLES` strains. The model has a polynomial for
each level and interpolates between them; with a `bend` of the surface, it errs between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.models import LeftOutKind
from mapmore_cli.modelling.validation.intervals import (
    half_widths,
    left_out_summary,
    with_levels,
)
from mapmore_cli.reporting.table import Cell, Table

SAMPLES, ORDER = 40, 5
LEVEL = 0.95
CAMPAIGNS, NEW = 200, 5
"""Campaigns of each row, and new curves of each at either place: 1 000 curves."""

LEVELS, RECORDINGS, APART = range(2, 13), range(1, 6), (0.0, 1.0, 2.0, 3.0)
"""Of campaigns; and standard deviations of the offsets over that of the noise."""

STRAIN = np.linspace(-1.0, 1.0, SAMPLES)
BASIS = np.linalg.qr(np.vander(STRAIN, ORDER + 1))[0]


@dataclass(frozen=True)
class Process:
    """What recordings are of: the standard deviation of their offsets, and the bend of the surface
    over the levels.
    """

    apart: float
    bend: float = 0.0

    def recordings(self, levels: Array, count: int, rng: np.random.Generator) -> Array:
        """Return so many recordings of each level, (levels, recordings, samples)."""
        surface = 10 * levels[:, None] * (1 - STRAIN / 2) + self.bend * levels[:, None] ** 2
        offsets = self.apart * rng.standard_normal((len(levels), count, 1))
        noise = rng.standard_normal((len(levels), count, SAMPLES))
        return np.asarray(surface[:, None] + offsets + noise)


def interpolated(levels: Array, curves: Array, at: Array) -> Array:
    """Return the curves (levels, samples) between their levels, (at, samples)."""
    gap = np.clip(np.searchsorted(levels, at, side="right") - 1, 0, len(levels) - 2)
    t = ((at - levels[gap]) / (levels[gap + 1] - levels[gap]))[:, None]
    return np.asarray((1 - t) * curves[gap] + t * curves[gap + 1])


def campaign(
    process: Process, count: int, repeats: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return which share of each new curve lies in its interval, and half of the width, at random
    places between levels and at levels, (2, new); NaN where there is no interval.
    """
    levels = np.linspace(0.0, 1.0, count)
    measured = process.recordings(levels, repeats, rng)
    curves = measured.mean(axis=1) @ BASIS @ BASIS.T
    missed = {
        f"{k}": [
            one
            - interpolated(np.delete(levels, k), np.delete(curves, k, axis=0), levels[k : k + 1])[0]
            for one in measured[k]
        ]
        for k in range(1, count - 1)
    }
    kind: LeftOutKind = "levels" if missed else "blocks"
    training = {at: list(measured[k] - curves[k]) for k, at in enumerate(levels.tolist())}
    found = with_levels(
        left_out_summary(kind, count, missed or {"0": [np.ones(1)]}), training, (ORDER + 1) * count
    )
    at = np.array([rng.uniform(0, 1, NEW), rng.choice(levels, NEW)])
    half = np.array([half_widths(found, places, LEVEL) for places in at])
    shares = np.full(at.shape, np.nan)
    for place, places in enumerate(at):
        new = process.recordings(places, 1, rng)[:, 0]
        inside = np.abs(new - interpolated(levels, curves, places)) <= half[place][:, None]
        shares[place] = np.where(np.isnan(half[place]), np.nan, inside.mean(axis=1))
    return shares, half


def covered(process: Process, count: int, repeats: int, campaigns: int = CAMPAIGNS) -> Array:
    """Return the share of the samples of new curves that lies in their intervals, between levels
    and at levels, (2,); NaN where there are no intervals.
    """
    rng = np.random.default_rng([count, repeats, round(10 * process.apart), round(process.bend)])
    every = [campaign(process, count, repeats, rng)[0] for _ in range(campaigns)]
    joined = np.concatenate(every, axis=1)
    # of two levels, some random places are so near to a level that they count as at it
    given = np.mean(np.isfinite(joined), axis=1) > 0.5
    return np.array(
        [np.nanmean(row) if known else np.nan for row, known in zip(joined, given, strict=True)]
    )


def rows(
    levels: Sequence[int] = LEVELS,
    recordings: Sequence[int] = RECORDINGS,
    bend: float = 0.0,
    campaigns: int = CAMPAIGNS,
) -> list[tuple[Cell, ...]]:
    """Return a row for each number of levels and recordings: coverage in per cent between levels
    and at levels, by what recordings differ; empty where there are no intervals.
    """
    found: list[tuple[Cell, ...]] = []
    for count in levels:
        for repeats in recordings:
            each = [covered(Process(apart, bend), count, repeats, campaigns) for apart in APART]
            shares = 100 * np.array(each).T
            cells = [None if np.isnan(one) else float(one) for one in shares.ravel()]
            found.append((count, repeats, *cells))
    return found


HEADS = (
    "levels",
    "recordings",
    *(f"between, {apart:g} [%] .1f" for apart in APART),
    *(f"at a level, {apart:g} [%] .1f" for apart in APART),
)


@cache
def every_row() -> list[tuple[Cell, ...]]:
    """Return the rows of the table `coverage`."""
    return rows()


def coverage_table() -> Table:
    """Coverage where the model errs nothing between levels."""
    title = (
        f"Share of the samples of {CAMPAIGNS * NEW} new curves inside their 95 % interval. The "
        "columns 0 to 3 are the standard deviation of the offsets, divided by that of the noise"
    )
    return Table.of("coverage", title, HEADS, every_row())


def spread_table() -> Table:
    """Return the least and the greatest coverage of each row of the table `coverage`."""
    found = {(row[0], row[1]): [one for one in row[2:] if one is not None] for row in every_row()}
    cells: list[tuple[Cell, ...]] = [
        (
            count,
            *(
                f"{min(own):.1f} to {max(own):.1f}" if own else "none"
                for own in (found[count, repeats] for repeats in RECORDINGS)
            ),
        )
        for count in LEVELS
    ]
    title = "Smallest and largest share of each row, in per cent, by levels and recordings of each"
    heads = ("levels", *(f"{repeats} recording{'s'[: repeats - 1]}" for repeats in RECORDINGS))
    return Table.of("spread", title, heads, cells)


BEND = 30.0
"""Of the surface over the levels, in standard deviations of the noise: at five levels the model
errs by half of one in the middle of a gap.
"""


def bent_table() -> Table:
    """Coverage where the model errs between levels as well."""
    title = "Share of the samples inside their interval if the surface bends between the levels"
    return Table.of("bent", title, HEADS, rows((3, 4, 5, 6, 7, 12), (1, 2, 5), BEND))
