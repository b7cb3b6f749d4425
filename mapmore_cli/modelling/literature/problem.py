"""Define the least-squares problem of fitting one formula to one set of rows. Nonlinear parameters
are replaced by coordinates that do not depend on units.
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
    """A parameter in which its formula is not linear.

    A fit searches a dimensionless coordinate c instead of the value of the parameter. If the
    quantity `per` is given, c is `value * max|per|`; if the quantity `of` is given, c is `value /
    max|of|`; otherwise, c is the value. The `intervals` of c are in ascending order and include
    their ends. None of them contains zero, except as an end.
    """

    name: str
    per: str | None
    intervals: Intervals
    of: str | None = None

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest allowed value of the coordinate."""
        return self.intervals[0][0], self.intervals[-1][1]

    def span(self, columns: Columns) -> float:
        """Return the factor by which a value of the parameter is multiplied to obtain its
        coordinate. The factor is one if the quantity `per` or `of` is zero in all samples.
        """
        quantity = self.per or self.of
        if quantity is None:
            return 1.0
        largest = float(np.abs(columns[quantity]).max()) or 1.0
        return largest if self.per else 1.0 / largest

    def written(self, c: float) -> str:
        """Return a text with the parameter value that belongs to the coordinate c, for example
        `-8/max|strain|`.
        """
        per, of = self.per and f"/max|{self.per}|", self.of and f" max|{self.of}|"
        return f"{c:g}{per or of or ''}"


@dataclass(frozen=True)
class LeastSquares:
    """Problem of finding `beta` and `c` that minimise `|Phi(c) beta + f0(c) - y|^2` over n rows. If
    the formula cannot be written as `Phi(c) beta + f0(c)`, the sum of squares of `residual` is
    minimised instead.

    - `expression`: the formula of inputs and parameters.
    - `linear`: names of the m parameters `beta` in which the formula is linear.
    - `nonlinear`: the k parameters with coordinates `c`.
    - `gradient`: derivative of the formula with respect to every parameter. The derivatives with
      respect to the linear parameters are the regressors.
    - `columns`, `y`: the inputs and the target, shape (n,) each.
    - `counts`: number of samples for which each row stands, shape (n,); None if each row is one
      sample.
    - `start`: starting value of every parameter: published values, or those of a fit to nearly the
      same rows. None if there are no such values.

    Every residual and regressor is multiplied by the square root of its count.
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
        """Return the output of the formula minus the target, shape (n,). Values are infinite or NaN
        if the formula overflows.
        """
        values = {**self.columns, **self.values(beta, c)}
        return self._weights * (evaluate(self.expression, values, len(self.y)) - self.y)

    def sse(self, beta: Array, c: Array) -> float:
        """Return the sum of squares of the residual."""
        residual = self.residual(beta, c)
        return float(residual @ residual)

    def slopes(self, names: Sequence[str], beta: Array, c: Array) -> Array:
        """Return the derivatives of the formula with respect to some parameters, shape (n, p). For
        nonlinear parameters, they are derivatives with respect to the coordinates. Raises NotFinite
        if the formula overflows.
        """
        values = {**self.columns, **self.values(beta, c)}
        matrix = dictionary_matrix([self.gradient[name] for name in names], values, len(self.y))
        return self._weights[:, None] * matrix / [self.spans.get(name, 1.0) for name in names]

    def linear_at(self, c: Array) -> tuple[Array, Array]:
        """Return the regressors `Phi(c)`, shape (n, m), and the target `y - f0(c)`, shape (n,).
        Raises NotFinite if the formula overflows.
        """
        nothing = np.zeros(len(self.linear))
        target = -self.residual(nothing, c)
        if not np.isfinite(target).all():
            raise NotFinite("the formula", int(np.argmin(np.isfinite(target))), "at a trial")
        return self.slopes(self.linear, nothing, c), target

    def values(self, beta: Array, c: Array) -> dict[str, Array]:
        """Return the parameters by name, as numbers in the units of the data."""
        spans = np.array([*self.spans.values()])
        return dict(zip(self.gradient, map(np.asarray, (*beta, *(c / spans))), strict=True))

    @cached_property
    def spans(self) -> dict[str, float]:
        """Factor by which the value of each nonlinear parameter is multiplied to obtain its
        coordinate.
        """
        return {parameter.name: parameter.span(self.columns) for parameter in self.nonlinear}

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Smallest and largest coordinates of the nonlinear parameters, shape (k,) each."""
        ends = np.array([parameter.bounds for parameter in self.nonlinear]).reshape(-1, 2)
        return ends[:, 0], ends[:, 1]

    @cached_property
    def at_levels(self) -> LeastSquares:
        """The same problem with each input replaced by its nominal level.

        It is used to compute the rank for a note, because the scatter of nominally equal values
        raises the numerical rank. For example, `polynomial_5` has rank 18 of 21 at four pressures.
        A fit uses the measured values, because its error is computed with them.
        """
        return replace(self, columns={name: nominal(x) for name, x in self.columns.items()})

    def allows(self, c: Array) -> bool:
        """Return True if all coordinates, shape (k,), have a sign that the intervals allow."""
        low, high = self.bounds
        return bool(((c > 0) | (low < 0)).all() and ((c < 0) | (high > 0)).all())

    def condensed(self) -> LeastSquares:
        """If there are many samples, return a problem with means of neighbouring samples as rows.
        It is faster to solve, and its solution is nearly the same.

        The problem is returned unchanged if a parameter is searched as a fraction `of` a quantity,
        for example of a rate. Only a few samples, for example those with the slowest rates, may
        depend on such a parameter, and means would hide this dependence.
        """
        if any(parameter.of for parameter in self.nonlinear):
            return self
        columns, y, counts = condensed(self.columns, self.y)
        return replace(self, columns=columns, y=y, counts=counts)

    @cached_property
    def _weights(self) -> Array:
        return np.ones(len(self.y)) if self.counts is None else np.sqrt(self.counts)


LIMIT = 4096
"""Largest number of cells. Tables with no more rows than this are unchanged."""

FINEST = 512
"""Number of cells along the range of an input; it is halved until there are at most `LIMIT` cells
in all.
"""


def condensed(columns: Columns, y: Array) -> tuple[Columns, Array, Array]:
    """Return `columns` and `y`, shape (n,) each, averaged over the finest grid with at most `LIMIT`
    cells, and the number of rows in each cell.

    The sum of squares over the cells is weighted by the counts. For a model that is linear within
    each cell, it differs from the sum over the rows only by the scatter of rows within their cells.
    This scatter does not depend on the model. For a hinge of slope one and width w, the difference
    is 1/(96 w 512^2) of the full scale, which is 4e-6 for w = 0.01.
    """
    if len(y) <= LIMIT:
        return columns, y, np.ones(len(y))
    # inputs of the rows, scaled so that the range of each input is 0 to 1
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
"""Fraction of the smallest distance between two levels within which values are nominally equal."""

VALUES_A_LEVEL = 5
"""Smallest mean number of distinct values at a level for which their differences are regarded as
scatter. Fewer values may be separate levels.
"""


def nominal(column: Array) -> Array:
    """Return the column, shape (n,), with every value replaced by its nominal level. The column is
    unchanged if its values do not form levels.

    Levels are groups of values that lie closer together than `SCATTER` times the smallest distance
    between two groups, with at least `VALUES_A_LEVEL` values per group on average. The finest such
    partition is used.
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
    """Return a note which says that the data do not determine all parameters. `choice` is the end
    of the note: it says which of the equally good solutions is used.
    """
    distinct = ", ".join(f"{len(np.unique(column))} of {name}" for name, column in inputs.items())
    return (
        f"rank {rank} of {count}: the data do not determine all parameters (distinct "
        f"values: {distinct}); {choice}; do not trust values between the training levels"
    )


def finite(name: str, columns: Columns) -> Array:
    """Return the column `name`. Raises DataError if the column is missing, or if a value is not
    finite; the message then names the first row with such a value.
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
