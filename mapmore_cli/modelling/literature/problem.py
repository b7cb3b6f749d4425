"""A least-squares problem: one formula, one set of rows, in coordinates that no change of units
moves; and what its solution holds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions import (
    Expression,
    Number,
    dictionary_matrix,
    evaluate,
    stacked_matrices,
    substitute,
)
from mapmore_cli.modelling.literature import linear

SMOOTH = 0.01  # of a range: what bends over less is lost in means of neighbouring samples


@dataclass(frozen=True)
class Nonlinear:
    """A parameter that enters its formula nonlinearly.

    It is sought as the dimensionless coordinate `c = value * max|per|`, `value / max|of|` or the
    value itself, in `intervals`: inclusive, ascending, and none of them across zero.
    """

    name: str
    per: str | None
    intervals: tuple[tuple[float, float], ...]
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

    @property
    def shortest(self) -> float:
        """The shortest part of the range of `per` or `of` over which the formula can bend; infinite
        for an absolute value.
        """
        if self.per is not None:
            return 1.0 / max(map(abs, self.bounds))
        return (
            min(abs(end) for interval in self.intervals for end in interval)
            if self.of is not None
            else math.inf
        )

    def written(self, c: float) -> str:
        """Return a coordinate as a person would write the value."""
        return f"{c:g}" + (
            f"/max|{self.per}|" if self.per else f" max|{self.of}|" if self.of else ""
        )


@dataclass(frozen=True)
class Problem:
    """Find `beta`, `c` that minimise `|Phi(c) beta + f0(c) - y|^2` over n rows.

    (Or the formula's own residual, where it is not such a product.)

    - `expression`: the formula, of inputs and parameters.
    - `linear`: names of the m parameters `beta` in which the formula is linear.
    - `nonlinear`: the k parameters with coordinates `c`.
    - `gradient`: derivative of the formula for every parameter, linear and nonlinear; those for
      `linear` are the regressors.
    - `columns`, `y`: the inputs and the target, each `(n,)`.
    - `counts`: number of samples that each row stands for, `(n,)`; None where each is one.
    - `start`: a published value to start from for every parameter, where one is asked for.
    """

    expression: Expression
    linear: tuple[str, ...]
    nonlinear: tuple[Nonlinear, ...]
    gradient: Mapping[str, Expression]
    columns: Columns
    y: Array
    counts: Array | None = None
    start: Mapping[str, float] | None = None

    def target(self, c: Array) -> Array:
        """`y - f0(c)`, `(n,)`, times the roots of the counts, as every residual and regressor
        is.
        """
        return np.asarray(self.each_target(c[None])[0])

    @cached_property
    def offset(self) -> Expression:
        """`f0`, the part of the formula that no linear parameter multiplies."""
        return substitute(self.expression, dict.fromkeys(self.linear, Number(0.0)))

    def residual(self, beta: Array, c: Array) -> Array:
        """Return formula minus target, `(n,)`; not finite where the formula overflows."""
        return self._weights * (
            evaluate(self.expression, self._with(self.values(beta, c)), len(self.y)) - self.y
        )

    def sse(self, beta: Array, c: Array) -> float:
        """Sum of squares of the residual."""
        residual = self.residual(beta, c)
        return float(residual @ residual)

    def regressors(self, c: Array) -> Array:
        """`Phi(c)`, `(n, m)`; raises `NotFinite` where it overflows."""
        return self._matrix(self.linear, self.values(np.zeros(len(self.linear)), c))

    def each_regressors(self, c: Array) -> Array:
        """Phi at several places c, `(s, k)`: `(s, n, m)`, not finite where it overflows."""
        return self._matrices(self.linear, self._each(np.zeros((len(c), len(self.linear))), c))

    def each_target(self, c: Array) -> Array:
        """`target` at several places, `(s, n)`."""
        if self.offset == Number(0.0):
            return np.broadcast_to(self._weights * self.y, (len(c), len(self.y)))
        values = self._each(np.zeros((len(c), len(self.linear))), c)
        return self._weights * (
            self.y - stacked_matrices([self.offset], self.columns, values, len(self.y))[:, :, 0]
        )

    def each_slopes(self, beta: Array, c: Array) -> Array:
        """Return derivative of the formula for c at several places `(beta, c)`: `(s, n, k)`, not
        finite where it overflows.
        """
        return (
            self._matrices(
                tuple(parameter.name for parameter in self.nonlinear), self._each(beta, c)
            )
            / self.spans
        )

    def jacobian(self, beta: Array, c: Array) -> Array:
        """Return derivative of the formula for `(beta, c)`, `(n, m + k)`; raises `NotFinite` where
        it overflows.
        """
        matrix = self._matrix(self.names, self.values(beta, c))
        matrix[:, len(self.linear) :] /= self.spans
        return matrix

    def values(self, beta: Array, c: Array) -> dict[str, float]:
        """Parameters by name, in the units of the data."""
        return dict(zip(self.names, map(float, (*beta, *(c / self.spans))), strict=True))

    @property
    def names(self) -> tuple[str, ...]:
        """The linear parameters, then the nonlinear ones."""
        return (*self.linear, *(parameter.name for parameter in self.nonlinear))

    @cached_property
    def spans(self) -> Array:
        """Coordinates of the value one of the nonlinear parameters, `(k,)`."""
        return np.array([parameter.span(self.columns) for parameter in self.nonlinear])

    def split(self, place: Array) -> tuple[Array, Array]:
        """Return `beta` and `c` of a place, `(m + k,)`."""
        return place[: len(self.linear)], place[len(self.linear) :]

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates of the nonlinear parameters, `(k,)` each."""
        ends = np.array([parameter.bounds for parameter in self.nonlinear]).reshape(-1, 2)
        return ends[:, 0], ends[:, 1]

    @cached_property
    def at_levels(self) -> Problem:
        """A linear problem at the levels that were held, where these leave parameters undetermined;
        else the problem as it is.

        Values that are nominally equal scatter a little. That raises the numerical rank, and what
        is fitted to the scatter explodes between the levels (1e-8 of scatter hid that
        `polynomial_5` has a rank of 18 with four pressures).
        """
        held = replace(
            self, columns={name: nominal(column) for name, column in self.columns.items()}
        )
        if self.nonlinear or all(
            held.columns[name] is column for name, column in self.columns.items()
        ):
            return self
        return (
            held
            if linear.standard_errors(held.regressors(np.empty(0)), 0.0)[1] < len(self.linear)
            else self
        )

    def condensed(self) -> Problem:
        """Return the problem over means of neighbouring samples, where there are many: quick, and
        nearly the same.

        It stays as it is where the formula can bend within a hundredth of a range: a force that
        decays over the slowest rates shows in few samples, and which decay is best would be decided
        without them.
        """
        if min((parameter.shortest for parameter in self.nonlinear), default=math.inf) < SMOOTH:
            return self
        columns, y, counts = condensed(self.columns, self.y)
        return self if len(y) == len(self.y) else replace(self, columns=columns, y=y, counts=counts)

    def _matrix(self, names: tuple[str, ...], values: Mapping[str, float]) -> Array:
        return self._weights[:, None] * dictionary_matrix(
            [self.gradient[name] for name in names], self._with(values), len(self.y)
        )

    def _matrices(self, names: tuple[str, ...], values: Mapping[str, Array]) -> Array:
        return self._weights[:, None] * stacked_matrices(
            [self.gradient[name] for name in names], self.columns, values, len(self.y)
        )

    def _each(self, beta: Array, c: Array) -> dict[str, Array]:
        """Parameters of several places by name, `(s,)` each."""
        return dict(zip(self.names, [*beta.T, *(c / self.spans).T], strict=True))

    @cached_property
    def _weights(self) -> Array:
        return np.ones(len(self.y)) if self.counts is None else np.sqrt(self.counts)

    def _with(self, values: Mapping[str, float]) -> Columns:
        return {**self.columns, **{name: np.asarray(value) for name, value in values.items()}}


@dataclass(frozen=True)
class Solution:
    """Linear parameters `beta`, `(m,)`, and coordinates `c`, `(k,)`, of a `Problem`; `status` and
    `method` as in `FormulaFit`.
    """

    beta: Array
    c: Array
    status: str
    method: str
    notes: tuple[str, ...] = ()
    rivals: tuple[
        tuple[Array, Array], ...
    ] = ()  # beta and c of other minima that are nearly as deep


def failure(problem: Problem, method: str) -> Solution:
    """Return the solution where the formula overflows from every start: NaN throughout."""
    nothing = np.full(len(problem.linear), np.nan), np.full(len(problem.nonlinear), np.nan)
    return Solution(*nothing, "failed", method, ("every start overflowed",))


def at_limit(parameter: Nonlinear, limit: float) -> str:
    """Return the note for a parameter that ends at the `limit` of its coordinate."""
    return f"{parameter.name} runs to the limit of what is sought, {parameter.written(limit)}"


FASTEST, SLOWEST = 1e-3, 10.0
"""Bounds of a decay over the largest rate: below, it acts on the samples at rest alone; above, it
is straight to within a twentieth.
"""


def decay(name: str) -> Nonlinear:
    """Return the rate over which the force decays by 1/e, positive."""
    return Nonlinear(name, per=None, intervals=((FASTEST, SLOWEST),), of="strain_rate")


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
    places = [
        (column - column.min()) / (float(np.ptp(column)) or 1.0) for column in columns.values()
    ]  # in their ranges, 0 to 1
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
            return np.asarray(((lowest + highest) / 2)[group[place]])
    return column


def dependence(rank: int, count: int, inputs: Columns, choice: str) -> str:
    """Return the note for data that leave parameters undetermined, and what was chosen then."""
    distinct = ", ".join(f"{len(np.unique(column))} of {name}" for name, column in inputs.items())
    return (
        f"rank {rank} of {count}: the data do not tell all parameters apart (distinct values: "
        f"{distinct}); "
        f"{choice}, and values between the training levels are not to be trusted"
    )


def needed(name: str, columns: Columns) -> Array:
    """Return the column `name`; raises `DataError` where it is absent."""
    if name not in columns:
        raise DataError(
            f"there is no column `{name}` among the inputs",
            "declare it under `columns` or `derive`",
        )
    return np.asarray(columns[name], dtype=float)


def finite(name: str, column: Array) -> Array:
    """Return the column; raises `DataError` with the first row in which it is not finite."""
    values = np.asarray(column, dtype=float)
    if not np.isfinite(values).all():
        row = int(np.argmin(np.isfinite(values)))
        raise DataError(
            f"{name} is not finite in row {row}: {values[row]}",
            "drop the sample (`missing: drop`) or mend the recording",
        )
    return values
