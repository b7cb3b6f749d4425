"""What a shape asks of neighbouring values along one quantity, and the grids on which they lie."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import binary_dilation

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray
from mapmore_cli.modelling.selection import Fit, Word

# one value is not below zero; of two, the second is not below the first; of three, the middle one
# is not above the line through the others
POINTS: Mapping[Word, int] = {
    "positive": 1,
    "increasing": 2,
    "decreasing": 2,
    "convex": 3,
    "concave": 3,
}


def weights_of(word: Word, places: Array) -> Array:
    """Return the weights of values at ascending `places`, (m, points), whose sum the shape does not
    let fall below zero, (m, points).

    They are in units of the value itself: how far it falls, or by how much the chord is missed.
    """
    if word == "positive":
        return np.ones_like(places)
    if POINTS[word] == 2:
        rising = np.broadcast_to([-1.0, 1.0], places.shape)
        return rising if word == "increasing" else -rising
    left, middle, right = places.T
    share = (middle - left) / (right - left)
    convex = np.stack([1 - share, -np.ones_like(share), share], axis=1)
    return convex if word == "convex" else -convex


@dataclass(frozen=True)
class Asked:
    """One word about the output along one quantity; of `positive`, that is the output itself."""

    quantity: str
    word: Word


def asked_of(fit: Fit) -> list[Asked]:
    """Return every word about every quantity, one by one."""
    return [
        Asked(name, word)
        for name, words in (fit.shape or {}).items()
        for word in ([words] if isinstance(words, str) else words)
    ]


@dataclass(frozen=True)
class Stencils:
    """Neighbouring places along a quantity: `points` by input, (m, points) each, and the weights of
    the output there, (m, points).
    """

    asked: Asked
    points: Columns
    weights: Array

    @property
    def columns(self) -> dict[str, Array]:
        """The places one after the other, (m points,) each."""
        return {name: x.ravel() for name, x in self.points.items()}

    @property
    def told(self) -> str:
        """The first in words, as `pressure: increasing at pressure = 150, strain = 0.1`."""
        places = (f"{name} = {x[0].mean():.4g}" for name, x in self.points.items())
        return f"{self.asked.quantity}: {self.asked.word} at {', '.join(places)}"

    def of(self, values: Array) -> Array:
        """Return the weighted sums of values at the places, (m,), or of rows of a matrix there,
        (m, k).
        """
        stacked = values.reshape(*self.weights.shape, *values.shape[1:])
        summed: Array = np.einsum("ms,ms...->m...", self.weights, stacked)
        return summed

    def at(self, rows: IntArray | BoolArray) -> Stencils:
        """Return some of them."""
        points = {name: x[rows] for name, x in self.points.items()}
        return Stencils(self.asked, points, self.weights[rows])


@dataclass(frozen=True)
class Grid:
    """Every combination of ascending places along each input; `fixed` inputs have one place."""

    axes: Mapping[str, Array]

    @property
    def columns(self) -> dict[str, Array]:
        """The inputs at all nodes, (n,) each."""
        mesh = np.meshgrid(*self.axes.values(), indexing="ij")
        return {name: x.ravel() for name, x in zip(self.axes, mesh, strict=True)}

    def widened(self, region: BoolArray) -> BoolArray:
        """Return a region, (n,), with the nodes beside it, so that a finer grid has no more."""
        whole = region.reshape(tuple(map(len, self.axes.values())))
        return np.asarray(
            binary_dilation(whole, np.ones((3,) * whole.ndim, dtype=np.bool_)).ravel()
        )

    def along(self, asked: Asked, values: Array, region: BoolArray) -> Along:
        """Return the stencils of a word whose nodes lie in the region; `values` of the output and
        `region` are of all nodes, (n,).
        """
        shape = tuple(map(len, self.axes.values()))
        names, count = list(self.axes), POINTS[asked.word]
        place = names.index(asked.quantity) if asked.quantity in names else 0

        def windows(x: Array | BoolArray) -> Array:
            return sliding_window_view(x.reshape(shape), count, axis=place)

        counted = np.asarray(windows(region).all(axis=-1))
        counted &= np.isfinite(windows(values)).all(axis=-1)
        points = {name: windows(x)[counted] for name, x in self.columns.items()}
        stencils = Stencils(asked, points, weights_of(asked.word, points[names[place]]))
        return Along(stencils, stencils.of(windows(values)[counted].ravel()), counted, place)


@dataclass(frozen=True)
class Along:
    """The stencils of a grid along one quantity, and how much the output `rises` over each, (m,):
    below zero the shape is violated. `counted` says where they lie on the grid, `axis` along what.
    """

    stencils: Stencils
    rises: Array
    counted: BoolArray
    axis: int

    @property
    def falls(self) -> Array:
        """How far the output has fallen without a break up to each stencil, (m,)."""
        steps = np.zeros(self.counted.shape)
        steps[self.counted] = np.minimum(self.rises, 0.0)
        depth = np.cumsum(steps, axis=self.axis)
        last = np.minimum.accumulate(np.where(steps == 0.0, depth, 0.0), axis=self.axis)
        return np.asarray((last - depth)[self.counted])
