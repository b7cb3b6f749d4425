"""Where a shape is asked: within each curve's own range, outside of the slack foot; and what the
training data themselves say of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.kinds import OUTSIDE_TOLERANCE, InputRange, limits, runs_over_time
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.modelling.shape.stencils import Asked, asked_of, nodes_of, stencils_on

# cells of all inputs together in which training samples are averaged
CELLS = 4096
# places along an input at which training data are compared, where it has more values
COMPARED = 24
# differences that a sign needs, and the share of them that may contradict it
FEWEST, CONTRADICTED = 10, 0.05
# even nodes of a grid along one input
MOST = 400
# how far beside a knot a node lies, as a part of the range
BESIDE = 1e-6


@dataclass(frozen=True)
class Region:
    """Where a shape is asked of a model: its training range, each curve's own, and a share `beyond`
    of it; but not where the training output stands less than the share `slack` of its range above
    its minimum.

    `places`, (c, inputs), and `values`, (c,), are training samples averaged in small cells, so that
    loops and noise leave one value. Inputs that do not vary are `fixed`, (1,) each.
    """

    names: tuple[str, ...]
    places: Array
    values: Array
    fixed: Columns
    ranges: tuple[InputRange, ...]
    fit: Fit

    @property
    def span(self) -> float:
        """Range of the training output."""
        return float(np.ptp(self.values))

    @property
    def ends(self) -> dict[str, tuple[float, float]]:
        """Least and greatest value of each input."""
        margin = {one.name: self.fit.beyond * (one.high - one.low).max() for one in self.ranges}
        return {
            one.name: (one.low.min() - margin[one.name], one.high.max() + margin[one.name])
            for one in self.ranges
        }

    @cached_property
    def _between(self) -> list[Callable[[Array], Array]]:
        """Ways to interpolate, the first that knows a place last."""
        from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
        from scipy.spatial import QhullError

        nearest = NearestNDInterpolator(self.places, self.values, rescale=True)
        found: list[Callable[[Array], Array]] = [nearest]
        with suppress(QhullError):  # all samples on a line
            found.append(LinearNDInterpolator(self.places, self.values, rescale=True))
        return found

    def output(self, columns: Columns) -> Array:
        """Return the training output between the samples, (n,): linear, and that of the nearest
        beyond them.
        """
        asked = np.column_stack([columns[name] for name in self.names])
        if len(self.names) == 1:
            order = np.argsort(self.places[:, 0])
            return np.interp(asked[:, 0], self.places[order, 0], self.values[order])
        value = np.full(len(asked), np.nan)
        for way in self._between:
            said = way(asked)
            value = np.where(np.isfinite(said), said, value)
        return value

    def holds(self, columns: Columns) -> BoolArray:
        """Return True at places in it, (n,)."""
        inside = np.asarray(self.output(columns) > self.values.min() + self.fit.slack * self.span)
        for name, at, levels, *ends in self.ranges:
            low, high = (x if at is None else np.interp(columns[at], levels, x) for x in ends)
            margin = (self.fit.beyond + OUTSIDE_TOLERANCE) * (high - low)
            inside &= (columns[name] >= low - margin) & (columns[name] <= high + margin)
        return inside

    def asks(self, asked: Sequence[Asked]) -> list[Asked]:
        """Return the words about the output, and about inputs that vary."""
        return [one for one in asked if one.word == "positive" or one.quantity in self.names]

    def nodes_along(self, nodes: int) -> int:
        """Return how many even nodes a grid of so many has along each input."""
        return int(np.clip(round(nodes ** (1 / len(self.names))), 3, MOST))

    def axes(self, knots: Mapping[str, Sequence[float]], nodes: int) -> dict[str, Array]:
        """Return the axes of a grid of even steps over the range, so many `nodes` in all, and of
        the knots with nodes close to each: the model may bend there.
        """
        axes = dict(self.fixed)
        for name, (low, high) in self.ends.items():
            even = np.linspace(low, high, self.nodes_along(nodes))
            near = np.add.outer(knots.get(name, ()), np.array([-1, 0, 1]) * BESIDE * (high - low))
            axes[name] = np.unique(np.append(even, near[(near >= low) & (near <= high)]))
        return axes


def region_of(model: Model, curves: Sequence[Curve], fit: Fit) -> Region | None:
    """Return the region of a model in which training `curves` vary; None where nothing does, or the
    model does not know its range.
    """
    samples = pooled_training(curves)
    ranges = tuple(limits(getattr(model.body, "ranges", ()), model.level))
    varied = tuple(one for one in ranges if (one.high > one.low).any() and one.name in samples)
    names, y = tuple(one.name for one in varied), samples[model.output.name]
    if not names or np.ptp(y) == 0:
        return None
    X = np.column_stack([samples[name] for name in names])
    width = np.maximum(np.ptp(X, axis=0), np.finfo(float).tiny)
    cells = ((X - X.min(axis=0)) / width * max(4, CELLS ** (1 / len(names)))).astype(int)
    _, number, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    *places, values = (np.bincount(number.ravel(), x) / count for x in (*X.T, y))
    fixed = {one.name: samples[one.name][:1] for one in model.inputs if one.name not in names}
    return Region(names, np.column_stack(places), values, fixed, varied, fit)


def refuse_unsupported(
    model: Model, curves: Sequence[Curve], fit: Fit, fewest: int = FEWEST
) -> None:
    """Raise FitError for a quantity that does not vary, and for a sign that training data
    contradict, or of which they have fewer than the `fewest` differences; with 0, as for a part of
    the data, only for the contradiction.

    Differences are of the interpolated training output, between neighbouring values of the
    quantity, at the values of the other inputs. With memory they say nothing of the output at rest.
    """
    region, asked = region_of(model, curves, fit), asked_of(fit)
    known = [] if region is None else region.asks(asked)
    if fewest and (unknown := [one.quantity for one in asked if one not in known]):
        raise FitError(
            f"fit.shape: `{unknown[0]}` is no input of the model that varies in training",
            f"name one of {', '.join(region.names if region else ())}",
        )
    if region is None or runs_over_time(model):
        return
    axes = dict(region.fixed)
    for name, x in zip(region.names, region.places.T, strict=True):
        own = region.ranges[0].levels if name == model.level else np.unique(x)
        axes[name] = own if len(own) <= COMPARED else np.linspace(own[0], own[-1], COMPARED)
    columns = nodes_of(axes)
    inside, output = region.holds(columns), region.output(columns)
    for one in (one for one in known if one.word in ("increasing", "decreasing")):
        stencils = stencils_on(axes, one, inside)
        rises = stencils.of(output)
        count, wrong = len(rises), int((rises < 0).sum())
        if count < fewest or wrong > CONTRADICTED * count:
            worst = f", most for {stencils.at(np.argsort(rises)[:1]).told}" if wrong else ""
            raise FitError(
                f"fit.shape: `{one.quantity}: {one.word}` rests on {count} differences of the "
                f"training data, of which {wrong} contradict it{worst}",
                f"a sign needs {FEWEST}, and at most {CONTRADICTED:.0%} against it: remove it, "
                "or raise `fit.slack`",
            )
