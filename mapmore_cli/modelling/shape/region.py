"""Where a shape is asked: within each curve's own range, outside of the slack foot; and what the
training data themselves say of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.models import CurveRange, Model
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.kinds import OUTSIDE_TOLERANCE, limits
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.modelling.shape.stencils import Asked, Grid

# cells of all inputs together in which training samples are averaged
CELLS = 4096
# places along an input at which training data are compared: its values, or so many where it has
# more of them
COMPARED = 24
# a sign is refused where so many differences of the training data contradict it, or where there are
# too few
CONTRADICTED, FEWEST = 0.05, 10


@dataclass(frozen=True)
class TrainingOutput:
    """The training samples of one output, averaged in small cells: inputs that vary, `places` (n,)
    each, and `values` (n,), whose range is `span`; the other inputs are `fixed`, (1,) each.
    """

    places: Columns
    values: Array
    span: float
    fixed: Columns

    @classmethod
    def of(cls, curves: Sequence[Curve], inputs: Sequence[str], target: str) -> TrainingOutput:
        """Average the samples of equal cells, so that loops and noise leave one value."""
        samples = pooled_training(curves)
        varied = [name for name in inputs if np.ptp(samples[name]) > 0]
        parts = max(4, int(CELLS ** (1 / max(len(varied), 1))))
        cell = np.zeros(len(samples[target]), dtype=np.int64)
        for name in varied:
            x = samples[name]
            cell = cell * (parts + 1) + ((x - x.min()) / np.ptp(x) * parts).astype(np.int64)
        _, number, count = np.unique(cell, return_inverse=True, return_counts=True)

        def mean(x: Array) -> Array:
            return np.asarray(np.bincount(number, x) / count)

        values = mean(samples[target])
        fixed = {name: samples[name][:1] for name in inputs if name not in varied}
        places = {name: mean(samples[name]) for name in varied}
        return cls(places, values, float(np.ptp(values)), fixed)

    def interpolated(self, columns: Columns) -> Array:
        """Return the output between the samples, (n,): linear, and that of the nearest beyond
        them.
        """
        from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
        from scipy.spatial import QhullError

        def scaled(x: Columns) -> Array:
            return np.column_stack([x[name] / np.ptp(self.places[name]) for name in self.places])

        known, asked = scaled(self.places), scaled(columns)
        if known.shape[1] == 1:
            order = np.argsort(known[:, 0])
            return np.interp(asked[:, 0], known[order, 0], self.values[order])
        value = np.asarray(NearestNDInterpolator(known, self.values)(asked))
        try:
            between = np.asarray(LinearNDInterpolator(known, self.values)(asked))
        except QhullError:  # all samples lie on a line
            return value
        return np.where(np.isfinite(between), between, value)


@dataclass(frozen=True)
class Region:
    """Where a shape is asked of a model: its training range, each curve's own, and a share `beyond`
    of it; but not where the training output stands less than the share `slack` of its range above
    its minimum.
    """

    ranges: Sequence[CurveRange]
    level: str | None
    output: TrainingOutput
    slack: float
    beyond: float = 0.0

    @property
    def ends(self) -> dict[str, tuple[float, float]]:
        """Least and greatest value of each input that varies."""
        ends = {}
        for name, _, _, low, high in limits(self.ranges, self.level):
            margin = self.beyond * float((high - low).max())
            ends[name] = float(low.min()) - margin, float(high.max()) + margin
        return {name: ends[name] for name in self.output.places}

    def asks(self, asked: Sequence[Asked]) -> list[Asked]:
        """Return the words about the output, and about inputs that vary."""
        return [one for one in asked if one.word == "positive" or one.quantity in self.ends]

    def holds(self, columns: Columns) -> BoolArray:
        """Return True at places in it, (n,)."""
        least = self.output.values.min() + self.slack * self.output.span
        inside = np.asarray(self.output.interpolated(columns) > least)
        for name, at, levels, *sides in limits(self.ranges, self.level):
            if name in self.output.places:
                low, high = (s if at is None else np.interp(columns[at], levels, s) for s in sides)
                margin = (self.beyond + OUTSIDE_TOLERANCE) * (high - low)
                inside &= (columns[name] >= low - margin) & (columns[name] <= high + margin)
        return inside


def region_of(model: Model, curves: Sequence[Curve], fit: Fit) -> Region | None:
    """Return the region of a model in which training `curves` vary; None where nothing does, or the
    model does not know its range.
    """
    ranges = getattr(model.body, "ranges", ())
    inputs = [one.name for one in model.inputs]
    return region_over(ranges, model.level, curves, inputs, model.output.name, fit)


def region_over(
    ranges: Sequence[CurveRange],
    level: str | None,
    curves: Sequence[Curve],
    inputs: Sequence[str],
    target: str,
    fit: Fit,
) -> Region | None:
    """Return the region over the ranges of some `inputs`; None where none of them varies."""
    known = [name for name in inputs if ranges and name in ranges[0].limits]
    output = TrainingOutput.of(curves, known, target) if known else None
    if output is None or not output.places or output.span == 0.0:
        return None
    return Region(ranges, level, output, fit.slack, fit.beyond)


def grid_of(region: Region, knots: Mapping[str, Sequence[float]], nodes: int) -> Grid:
    """Return a grid over the range, of even steps, so many `nodes` in all, and of the knots, close
    to which there are others: there the model may bend.
    """
    axes = dict(region.output.fixed)
    for name, (low, high) in region.ends.items():
        even = np.linspace(low, high, max(3, round(nodes ** (1 / len(region.ends)))))
        own = np.asarray(knots.get(name, ()), dtype=np.float64)
        near = np.concatenate([own, own - BESIDE * (high - low), own + BESIDE * (high - low)])
        axes[name] = np.unique(np.concatenate([even, near[(near >= low) & (near <= high)]]))
    return Grid(axes)


BESIDE = 1e-6
"""How far beside a knot a node lies, as a part of the range."""


def refuse_unsupported(asked: Sequence[Asked], region: Region, unit: str) -> None:
    """Raise FitError for a quantity that does not vary, and for a sign that training data
    contradict, or hardly tell.

    Differences are of the interpolated training output, between neighbouring values of the
    quantity, at the values of the other inputs.
    """
    axes = {name: _compared(x) for name, x in region.output.places.items()}
    if region.level in axes:
        axes[region.level] = np.array([one.level for one in region.ranges], dtype=np.float64)
    grid = Grid(axes)
    inside = region.holds(grid.columns)
    values = np.where(inside, region.output.interpolated(grid.columns), np.nan)
    for one in asked:
        if one.word != "positive" and one.quantity not in axes:
            raise FitError(
                f"fit.shape: `{one.quantity}` is no input of the model that varies in training",
                f"name one of {', '.join(axes)}",
            )
        if one.word not in ("increasing", "decreasing"):
            continue
        along = grid.along(one, values, inside)
        rise = along.rises
        against = rise < -OUTSIDE_TOLERANCE * region.output.span
        count, wrong = len(rise), int(against.sum())
        if count >= FEWEST and wrong <= CONTRADICTED * count:
            continue
        told = (
            f"fit.shape: `{one.quantity}: {one.word}` rests on {count} differences of the training "
            f"data, of which {wrong} contradict it"
        )
        if wrong:
            worst = along.stencils.at(np.array([np.argmin(rise)]))
            told += f" (by up to {-rise.min():.3g} {unit} for {worst.told})"
        raise FitError(
            told,
            f"a sign needs {FEWEST}, and at most {CONTRADICTED:.0%} of them against it: remove it"
            f"{'' if count < FEWEST else ', or raise `fit.slack`'}",
        )


def _compared(x: Array) -> Array:
    values = np.unique(x)
    return values if len(values) <= COMPARED else np.linspace(values[0], values[-1], COMPARED)
