"""What a shape asks of neighbouring values along one quantity, and the grids on which they lie."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray
from mapmore_cli.domain.declared import Word
from mapmore_cli.modelling.selection import Fit

POINTS: Mapping[Word, int] = {
    "positive": 1,
    "increasing": 2,
    "decreasing": 2,
    "convex": 3,
    "concave": 3,
}
"""Of how many neighbouring values a word is."""


def weights_of(word: Word, places: Array) -> Array:
    """Return the weights of values at ascending `places`, (..., points), whose sum must not be
    negative: how far the output rises or falls, or by how much its chord lies above or below.
    """
    if word == "positive":
        return np.ones_like(places)
    sign = 1.0 if word in ("increasing", "convex") else -1.0
    if POINTS[word] == 2:
        return np.broadcast_to([-sign, sign], places.shape)
    left, middle, right = np.moveaxis(places, -1, 0)
    share = (middle - left) / (right - left)
    return sign * np.stack([1 - share, -np.ones_like(share), share], axis=-1)


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

    @property
    def told(self) -> str:
        """The first in words, as `pressure: increasing at pressure = 150, strain = 0.1`."""
        places = (f"{name} = {x[0].mean():.4g}" for name, x in self.points.items())
        return f"{self.asked.quantity}: {self.asked.word} at {', '.join(places)}"


@dataclass(frozen=True)
class Grid:
    """Every combination of ascending places along each input."""

    axes: Mapping[str, Array]

    @property
    def columns(self) -> dict[str, Array]:
        """The inputs at all nodes, (n,) each."""
        mesh = np.meshgrid(*self.axes.values(), indexing="ij")
        return {name: x.ravel() for name, x in zip(self.axes, mesh, strict=True)}

    def axis(self, asked: Asked) -> int:
        """Return the number of the axis along which a word is; of `positive`, the first."""
        return list(self.axes).index(asked.quantity) if POINTS[asked.word] > 1 else 0

    def rises(self, asked: Asked, values: Array) -> Array:
        """Return what a word says is not negative, at every stencil; NaN where one of the values at
        the nodes, (n,), is.
        """
        places = self.columns[list(self.axes)[self.axis(asked)]]
        weights = weights_of(asked.word, self._windows(asked, places))
        return np.asarray((weights * self._windows(asked, values)).sum(axis=-1))

    def stencils(self, asked: Asked, chosen: IntArray) -> Stencils:
        """Return the stencils of some places in the flattened `rises`."""
        points = {
            name: self._windows(asked, x).reshape(-1, POINTS[asked.word])[chosen]
            for name, x in self.columns.items()
        }
        along = points[list(self.axes)[self.axis(asked)]]
        return Stencils(asked, points, weights_of(asked.word, along))

    def _windows(self, asked: Asked, x: Array) -> Array:
        shaped = x.reshape(tuple(map(len, self.axes.values())))
        return sliding_window_view(shaped, POINTS[asked.word], axis=self.axis(asked))
