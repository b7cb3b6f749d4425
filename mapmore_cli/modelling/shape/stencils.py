"""Define the stencils of a shape, and place them on grids. A stencil is a group of neighbouring
places along one quantity; the output at these places must satisfy an inequality.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray, columns_at
from mapmore_cli.domain.declared import Word
from mapmore_cli.modelling.selection import Fit

POINTS: Mapping[Word, int] = {
    "positive": 1,
    "increasing": 2,
    "decreasing": 2,
    "convex": 3,
    "concave": 3,
}
"""Number of neighbouring values that a word compares."""


def stencil_weights(word: Word, places: Array) -> Array:
    """Return weights for the output at ascending `places`, shape (..., points). The shape is kept
    if the weighted sum of the output is not negative.

    For `increasing`, the sum is the mean output at the upper half of the places minus the mean
    output at the lower half; for `decreasing`, it has the opposite sign. For `convex` and
    `concave`, the sum is the distance between the output and its chord.
    """
    if word == "positive":
        return np.ones_like(places)
    sign = 1.0 if word in ("increasing", "convex") else -1.0
    if POINTS[word] == 2:
        half = places.shape[-1] // 2
        return np.broadcast_to(np.repeat([-sign / half, sign / half], half), places.shape)
    left, middle, right = np.moveaxis(places, -1, 0)
    share = (middle - left) / (right - left)
    return sign * np.stack([1 - share, -np.ones_like(share), share], axis=-1)


@dataclass(frozen=True)
class ShapeWord:
    """One condition of a shape, for example that the output is `increasing` (`word`) along the
    pressure (`quantity`). For `positive`, the quantity is the output itself.
    """

    quantity: str
    word: Word


def asked_of(fit: Fit) -> list[ShapeWord]:
    """Return the conditions in `fit.shape`: one for each quantity and each of its words, for
    example `increasing` or `convex`.
    """
    return [
        ShapeWord(name, word)
        for name, words in (fit.shape or {}).items()
        for word in ([words] if isinstance(words, str) else words)
    ]


@dataclass(frozen=True)
class Stencils:
    """The m stencils of one condition. `nodes`, (m, points), holds the row numbers of their places
    in the `columns`, (n,) each, and `weights` holds the weights of the output at these places.
    `lines`, (m,), is equal for stencils on the same grid line along the quantity.
    """

    asked: ShapeWord
    columns: Columns
    nodes: IntArray
    weights: Array
    lines: IntArray

    def of(self, values: Array) -> Array:
        """Return the weighted sum of the values at the nodes of each stencil, (m,) or (m, k).
        `values`, (n,) or (n, k), are given at all rows of the columns. The condition is satisfied
        at a stencil if its sum is not negative.
        """
        summed: Array = np.einsum("ms,ms...->m...", self.weights, values[self.nodes])
        return summed

    def at(self, rows: IntArray | BoolArray) -> Stencils:
        """Return the stencils that are selected by numbers or by a mask. Rows of the columns that
        these stencils do not need are removed.
        """
        used, nodes = np.unique(self.nodes[rows], return_inverse=True)
        columns = columns_at(self.columns, used)
        nodes = nodes.reshape(self.nodes[rows].shape)
        return Stencils(self.asked, columns, nodes, self.weights[rows], self.lines[rows])

    @property
    def told(self) -> str:
        """Description of the first stencil, for example `pressure: increasing at pressure = 150,
        strain = 0.1`.
        """
        places = (f"{name} = {x[self.nodes[0]].mean():.4g}" for name, x in self.columns.items())
        return f"{self.asked.quantity}: {self.asked.word} at {', '.join(places)}"


def nodes_of(axes: Mapping[str, Array]) -> dict[str, Array]:
    """Return the inputs at every node of a grid, shape (n,) each: all combinations of the places
    along each input.
    """
    mesh = np.meshgrid(*axes.values(), indexing="ij")
    return {name: x.ravel() for name, x in zip(axes, mesh, strict=True)}


def stencils_on(
    axes: Mapping[str, Array], asked: ShapeWord, inside: BoolArray, reach: int = 1
) -> Stencils:
    """Return the stencils of one condition on a grid. `axes` holds the places of the grid along
    each input, in ascending order. A stencil is returned only if all its nodes are `inside`, (n,).

    A stencil for `increasing` or `decreasing` compares the means of two neighbouring groups of
    `reach` nodes each. The next stencil on the same line begins `reach/2` nodes farther, and at
    least one node.
    """
    columns, points = nodes_of(axes), POINTS[asked.word] * reach
    along = list(axes).index(asked.quantity) if points > 1 else 0
    numbers = np.arange(len(inside)).reshape([len(x) for x in axes.values()])
    windows = np.moveaxis(sliding_window_view(numbers, points, axis=along), along, 0)
    nodes = windows[:: max(reach // 2, 1)].reshape(-1, points)
    nodes = nodes[inside[nodes].all(axis=1)]
    lines = np.broadcast_to(numbers.take([0], axis=along), numbers.shape).ravel()[nodes[:, 0]]
    places = columns[list(axes)[along]][nodes]
    return Stencils(asked, columns, nodes, stencil_weights(asked.word, places), lines)
