"""A least-squares problem: one formula, one set of rows, in coordinates that no change of units
moves; and what its solution holds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions import Expression, NotFinite, dictionary_matrix, evaluate

Intervals = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Nonlinear:
    """A parameter that enters its formula nonlinearly.

    It is sought as the dimensionless coordinate `c = value * max|per|`, `value / max|of|` or the
    value itself, in `intervals`: inclusive, ascending, and none of them across zero.
    """

    name: str
    per: str | None
    intervals: Intervals
    of: str | None = None

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest coordinate."""
        return self.intervals[0][0], self.intervals[-1][1]

    def span(self, columns: Columns) -> float:
        """Return the coordinate of the value one; one where the data have no span."""
        quantity = self.per or self.of
        if quantity is None:
            return 1.0
        largest = float(np.abs(columns[quantity]).max()) or 1.0
        return largest if self.per else 1.0 / largest

    def written(self, c: float) -> str:
        """Return a coordinate as a person would write the value."""
        per, of = self.per and f"/max|{self.per}|", self.of and f" max|{self.of}|"
        return f"{c:g}{per or of or ''}"


@dataclass(frozen=True)
class LeastSquares:
    """Find `beta`, `c` that minimise `|Phi(c) beta + f0(c) - y|^2` over n rows.

    (Or the formula's own residual, where it is not such a product.)

    - `expression`: the formula, of inputs and parameters.
    - `linear`: names of the m parameters `beta` in which the formula is linear.
    - `nonlinear`: the k parameters with coordinates `c`.
    - `gradient`: derivative of the formula for every parameter, linear and nonlinear; those for
      `linear` are the regressors.
    - `columns`, `y`: the inputs and the target, each `(n,)`.
    - `counts`: number of samples that each row stands for, `(n,)`; None if each is one.
    - `start`: a value to start from for every parameter: a published one, where one is asked for,
      or that of a fit to nearly the same rows.

    Every residual and regressor is times the roots of the counts.
    """

    expression: Expression
    linear: tuple[str, ...]
    nonlinear: tuple[Nonlinear, ...]
    gradient: Mapping[str, Expression]
    columns: Columns
    y: Array
    counts: Array | None = None
    start: Mapping[str, float] | None = None

    def residual(self, beta: Array, c: Array) -> Array:
        """Return formula minus target, `(n,)`; not finite where the formula overflows."""
        values = {**self.columns, **self.values(beta, c)}
        return self._weights * (evaluate(self.expression, values, len(self.y)) - self.y)

    def sse(self, beta: Array, c: Array) -> float:
        """Sum of squares of the residual."""
        residual = self.residual(beta, c)
        return float(residual @ residual)

    def slopes(self, names: Sequence[str], beta: Array, c: Array) -> Array:
        """Return derivatives of the formula for some parameters, `(n, p)`, those of nonlinear ones
        for their coordinates; raises `NotFinite` where it overflows.
        """
        values = {**self.columns, **self.values(beta, c)}
        matrix = dictionary_matrix([self.gradient[name] for name in names], values, len(self.y))
        return self._weights[:, None] * matrix / [self.spans.get(name, 1.0) for name in names]

    def linear_at(self, c: Array) -> tuple[Array, Array]:
        """Return the regressors `Phi(c)`, `(n, m)`, and the target `y - f0(c)`, `(n,)`; raises
        `NotFinite` where the formula overflows.
        """
        nothing = np.zeros(len(self.linear))
        target = -self.residual(nothing, c)
        if not np.isfinite(target).all():
            raise NotFinite("the formula", int(np.argmin(np.isfinite(target))), "at a trial")
        return self.slopes(self.linear, nothing, c), target

    def values(self, beta: Array, c: Array) -> dict[str, Array]:
        """Parameters by name, in the units of the data, `()` each."""
        spans = np.array([*self.spans.values()])
        return dict(zip(self.gradient, map(np.asarray, (*beta, *(c / spans))), strict=True))

    @cached_property
    def spans(self) -> dict[str, float]:
        """Coordinate of the value one of every nonlinear parameter."""
        return {parameter.name: parameter.span(self.columns) for parameter in self.nonlinear}

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates of the nonlinear parameters, `(k,)` each."""
        ends = np.array([parameter.bounds for parameter in self.nonlinear]).reshape(-1, 2)
        return ends[:, 0], ends[:, 1]

    @cached_property
    def at_levels(self) -> LeastSquares:
        """The problem at the levels that its inputs scatter about.

        The scatter of nominally equal values raises the numerical rank. A fit uses it, as it is
        scored on it; a note says what the rank is without (`polynomial_5` has 18 of 21 at four
        pressures).
        """
        return replace(self, columns={name: nominal(x) for name, x in self.columns.items()})

    def allows(self, c: Array) -> bool:
        """Whether all coordinates, `(k,)`, have a sign that they are sought with."""
        low, high = self.bounds
        return bool(((c > 0) | (low < 0)).all() and ((c < 0) | (high > 0)).all())

    def condensed(self) -> LeastSquares:
        """Return the problem over means of neighbouring samples, where there are many: quick, and
        nearly the same.

        It stays as it is with a parameter that is sought in shares `of` a quantity: a force that
        decays over the slowest rates shows in few samples, and which decay is best would be decided
        without them.
        """
        if any(parameter.of for parameter in self.nonlinear):
            return self
        columns, y, counts = condensed(self.columns, self.y)
        return replace(self, columns=columns, y=y, counts=counts)

    @cached_property
    def _weights(self) -> Array:
        return np.ones(len(self.y)) if self.counts is None else np.sqrt(self.counts)


LIMIT = 4096
"""Most cells; tables of no more rows are left as they are."""

FINEST = 512
"""Cells along the range of an input, halved until there are no more than `LIMIT` in all."""


def condensed(columns: Columns, y: Array) -> tuple[Columns, Array, Array]:
    """Return `columns` and `y`, each `(n,)`, averaged over the finest grid that leaves at most
    `LIMIT` cells, and the rows in each cell.

    A sum of squares weighted by the counts is that of the rows, less their scatter within the
    cells, up to the curvature of the model over a cell: a hinge of slope one and width w is missed
    by 1/(96 w 512^2) of the full scale, 4e-6 where w = 0.01.
    """
    if len(y) <= LIMIT:
        return columns, y, np.ones(len(y))
    # in their ranges, 0 to 1
    places = [
        (column - column.min()) / (float(np.ptp(column)) or 1.0) for column in columns.values()
    ]
    bins = FINEST
    while True:
        keys = np.zeros(len(y), dtype=np.int64)
        for place in places:
            keys = keys * (bins + 1) + np.floor(place * bins).astype(np.int64)
        cells, cell, counts = np.unique(keys, return_inverse=True, return_counts=True)
        if len(cells) <= LIMIT:
            break
        bins //= 2
    means = {name: np.bincount(cell, column) / counts for name, column in columns.items()}
    return means, np.bincount(cell, y) / counts, counts.astype(float)


SCATTER = 0.1
"""Of the smallest distance between two levels: how far values may lie apart that are nominally one.
"""

VALUES_A_LEVEL = 5
"""Distinct values for every level, from which on they are scatter about it; fewer may be levels of
their own.
"""


def nominal(column: Array) -> Array:
    """Return the column, `(n,)`, with every value replaced by the level that it scatters about;
    unchanged where there are no such levels.

    Levels are groups of values that lie nearer together than `SCATTER` times the smallest distance
    between two groups, `VALUES_A_LEVEL` or more in a group on the average; the finest such
    partition is taken.
    """
    values, place = np.unique(column, return_inverse=True)
    gaps = np.diff(values)
    sizes = np.sort(gaps)[::-1]
    for parting in sizes[:-1][sizes[1:] <= SCATTER * sizes[:-1]][::-1]:
        starts = np.concatenate([[0], np.flatnonzero(gaps >= parting) + 1])
        lowest, highest = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
        if len(values) >= VALUES_A_LEVEL * len(starts) and float(
            (highest - lowest).max()
        ) <= SCATTER * float(parting):
            group = np.searchsorted(starts, np.arange(len(values)), side="right") - 1
            return ((lowest + highest) / 2)[group[place]]
    return column


def dependence(rank: int, count: int, inputs: Columns, choice: str) -> str:
    """Return the note for data that leave parameters undetermined, and what was chosen then."""
    distinct = ", ".join(f"{len(np.unique(column))} of {name}" for name, column in inputs.items())
    return (
        f"rank {rank} of {count}: the data do not determine all parameters (distinct "
        f"values: {distinct}); {choice}; do not trust values between the training levels"
    )


def finite(name: str, columns: Columns) -> Array:
    """Return the column `name`; raises `DataError` if it is absent, and with the first row in
    which it is not finite.
    """
    if name not in columns:
        raise DataError(
            f"there is no column `{name}` among the inputs",
            "declare it under `columns` or `derive`",
        )
    values = np.asarray(columns[name], dtype=float)
    for row in np.flatnonzero(~np.isfinite(values))[:1]:
        raise DataError(
            f"{name} is not finite in row {row}: {values[row]}",
            "remove the sample (`missing: drop`) or correct the recording",
        )
    return values
