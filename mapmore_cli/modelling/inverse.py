"""Find every value of an input within its training range at which the model gives a wanted output,
for example the pressure for a force at a given strain.

There may be no solution, one solution, or several, because the output is not always a monotone
function of the input. For models of measured muscles, this was found at up to a tenth of the
examined places. The solutions can also fill a whole range: a slack muscle gives the same force at
every pressure. The output is monotone between knots (levels, boundaries, limits) and the places at
which the slope changes its sign. Each monotone part contains at most one solution, which bisection
finds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.kinds import alone
from mapmore_cli.modelling.program.slopes import with_slopes
from mapmore_cli.modelling.program.values import evaluator
from mapmore_cli.modelling.programs import program_of

LOWEST, NEAREST = "lowest", "nearest"
"""Rules for the choice among several solutions: the lowest, or the one nearest to the solution of
the row before.
"""

NONE, ONE, SEVERAL, FLAT = "none", "one", "several", "flat"
"""How many solutions there are. `flat` means that they fill a range, of which the lower end is
returned.
"""

UNIQUE = "unique"
"""Status of a model whose shape (`fit.shape`) excludes a second solution."""

SCAN, PARTS = 2, 96
"""Smallest number of parts in which the slope is evaluated: in every interval between knots, and in
all intervals together.
"""

SPLITS, STEEP = 6, 3.0
"""Largest number of times that a part is divided. A part is divided if its slope at an end is more
than `STEEP` times the slope of its secant, because the output may then turn twice in the part.
"""

CHUNK = 500  # number of rows that are computed at once
BISECTIONS = 50  # number of bisections; more would not reduce the error because of rounding
# A difference of outputs is treated as zero if it is at most this fraction of their range, or of
# the wanted output if that is larger. Widths of an input are compared with its range.
SAME = 1e-9
# At a solution, the output differs from the wanted output by at most this fraction of it.
# If the output differs more from the wanted output, bisection has found a jump, not a solution.
REACHED = 1e-6


@dataclass(frozen=True)
class Inverse:
    """Solutions for n rows.

    - `values`, (m,): all solutions, in ascending order for each row.
    - `rows`, (m,): the row of each solution.
    - `status`: for each row, `none`, `one`, `several`, `unique` (one solution, and `fit.shape`
      excludes a second), or `flat` (the solutions fill a range).
    - `picked`, (n,): the solution that the rule selects for each row; NaN for a row without a
      solution.
    """

    values: Array
    rows: IntArray
    status: tuple[str, ...]
    picked: Array


@dataclass(frozen=True)
class SolvedInput:
    """Values of an input, computed from the output of a model. `values`, (n,), holds one value for
    each row. `solved`, (n,), is False for rows without a solution.
    """

    values: Array
    solved: BoolArray


def invert(model: Model, wanted: Array, others: Columns, name: str, rule: str = LOWEST) -> Inverse:
    """Return every value of the input `name` at which the model gives the `wanted` output, (n,),
    for each row. The other inputs have the values in `others`, (n,) each. `rule` selects one of
    several solutions.

    Raises UsageError for an unknown input or rule; DataError for a model with memory.
    """
    if rule not in (LOWEST, NEAREST):
        raise UsageError(f"there is no rule '{rule}'", f"use {LOWEST} or {NEAREST}")
    values, rows, flat, _ = _solutions(model, wanted, others, name)
    counts = np.bincount(rows, minlength=len(wanted))
    single = UNIQUE if model.shape is not None and name in model.shape.monotone else ONE
    status = tuple(
        FLAT if is_flat else (NONE, single, SEVERAL)[min(count, 2)]
        for is_flat, count in zip(flat, counts.tolist(), strict=True)
    )
    return Inverse(values, rows, status, _picked(values, rows, len(wanted), rule))


def solve_for_input(model: Model, columns: Columns, name: str) -> SolvedInput:
    """Compute the input `name` of a model from its output and its other inputs. For example,
    compute the force from a measured strain, if the model predicts the strain from the force.

    `columns` holds the output and all inputs but `name`, shape (n,) each. The result for each row
    is the lowest solution within the training range. If there is no solution, the result is the
    value of the input at which the model's output is nearest to the given output. For example, if
    no force within the range causes the measured strain, the result is often the force at one end
    of the range. A row with a NaN gives NaN. Raises UsageError and DataError like `invert`.
    """
    needed = [model.output.name, *(other for other in _input_names(model, name) if other != name)]
    known = np.flatnonzero(np.logical_and.reduce([np.isfinite(columns[other]) for other in needed]))
    known_columns = {other: np.asarray(columns[other], dtype=np.float64)[known] for other in needed}
    lowest, rows, _, nearest = _solutions(
        model, known_columns.pop(model.output.name), known_columns, name
    )
    lowest_of_row = _picked(lowest, rows, len(known), LOWEST)
    is_solved = np.isfinite(lowest_of_row)
    values = np.full(len(columns[needed[0]]), np.nan)
    values[known] = np.where(is_solved, lowest_of_row, nearest)
    solved = np.zeros(len(values), dtype=np.bool_)
    solved[known] = is_solved
    return SolvedInput(values, solved)


def _solutions(
    model: Model, wanted: Array, others: Columns, name: str
) -> tuple[Array, IntArray, BoolArray, Array]:
    """Compute the results of `_Line.solutions` for all rows. Only `CHUNK` rows are computed at
    once, to limit the memory.
    """
    names, program = _input_names(model, name), program_of(model)
    slopes, value, ends = evaluator(with_slopes(program)), evaluator(program), knots(model, name)
    parts = []
    for start in range(0, max(len(wanted), 1), CHUNK):
        part = slice(start, start + CHUNK)
        line = _Line(
            value,
            slopes,
            name,
            names,
            wanted[part],
            {other: np.asarray(x, dtype=np.float64)[part] for other, x in others.items()},
        )
        values, rows, *of_rows = line.solutions(*line.edges(ends), float(np.ptp(ends)))
        parts.append((values, rows + start, *of_rows))
    values, rows, flat, nearest = map(np.concatenate, zip(*parts, strict=True))
    return values, rows, flat, nearest


def _input_names(model: Model, name: str) -> tuple[str, ...]:
    names = alone(model).input_names
    if name not in names:
        raise UsageError(f"the model has no input '{name}'", f"name one of {', '.join(names)}")
    return names


def knots(model: Model, name: str) -> Array:
    """Return the places along an input at which the model may have a kink or a jump, and the ends
    of its training range, in ascending order.

    Raises UsageError if the range is unknown, for example for an input that a sum renames.
    """
    places = np.unique(
        [place for place in program_of(model).knots.get(name, ()) if np.isfinite(place)]
    )
    if len(places) < 2:
        raise UsageError(
            f"the training range of '{name}' is not known",
            "invert for an input that was varied in training",
        )
    return places


def parts_between(knots: Array) -> int:
    """Return the number of parts into which every interval between knots is divided. The slope of
    the output is computed at both ends of each part.
    """
    return max(SCAN, -(-PARTS // (len(knots) - 1)))


@dataclass(frozen=True)
class _Line:
    """The output of a model as a function of one input x. There are n such functions, one for each
    row, because the other inputs have the values in `others`, (n,) each.

    The methods take values of x, shape (m,), and `rows`, shape (m,), the number of the row to which
    each value belongs.
    """

    value: Callable[[Columns], list[Array]]
    slopes: Callable[[Columns], list[Array]]
    name: str
    names: Sequence[str]
    wanted: Array
    others: Mapping[str, Array]

    def missing(self, x: Array, rows: IntArray) -> Array:
        """Return the model's output minus the wanted output at x, (m,)."""
        return self.value(self._columns(x, rows))[0] - self.wanted[rows]

    def both(self, x: Array, rows: IntArray) -> tuple[Array, Array]:
        """Return the model's output minus the wanted output, and the derivative of the output along
        the input, (m,) each.
        """
        value, *slopes = self.slopes(self._columns(x, rows))
        return value - self.wanted[rows], slopes[self.names.index(self.name)]

    def _columns(self, x: Array, rows: IntArray) -> dict[str, Array]:
        return {name: x if name == self.name else self.others[name][rows] for name in self.names}

    def edges(self, knots: Array) -> tuple[Array, IntArray]:
        """Return the ends of the parts in which the output is monotone, and the row of each end,
        (e,) each. The ends of each row are in ascending order.
        """
        n = len(self.wanted)
        inner = [
            np.linspace(low, high, parts_between(knots) + 1)[:-1]
            for low, high in pairwise(knots.tolist())
        ]
        places = np.concatenate([*inner, knots[-1:]])
        rows = np.repeat(np.arange(n), len(places) - 1)
        starts, ends = np.tile(places[:-1], n), np.tile(places[1:], n)
        turns, of = self._turning_points(starts, ends, rows, SPLITS)
        # monotone parts end just before a knot, because the output may jump there
        beside = np.nextafter(knots[:-1], np.inf), np.nextafter(knots[1:], -np.inf)
        fixed = np.concatenate([places, *beside])
        x = np.concatenate([np.tile(fixed, n), turns])
        rows = np.concatenate([np.repeat(np.arange(n), len(fixed)), of])
        order = np.lexsort([x, rows])
        return x[order], rows[order]

    def _turning_points(
        self, low: Array, high: Array, rows: IntArray, splits: int
    ) -> tuple[Array, IntArray]:
        """Return the places between `low` and `high` at which the slope of the output changes its
        sign, and the row of each place. A part in which the slope may change its sign again is
        divided, at most `splits` times; the places of the divisions are returned too.
        """
        start, end = np.nextafter(low, np.inf), np.nextafter(high, -np.inf)
        (left, slope_left), (right, slope_right) = self.both(start, rows), self.both(end, rows)
        turned = np.sign(slope_left) * np.sign(slope_right) < 0
        closer = may_turn_twice(left, right, slope_left, slope_right, high - low) & ~turned
        middle = (low + high) / 2
        if turned.any():
            at_rows = rows[turned]
            at = _bisected(
                lambda x, which: self.both(x, at_rows[which])[1], start[turned], end[turned]
            )
            value, flat = self.missing(at, at_rows), np.zeros(len(at))
            before = may_turn_twice(left[turned], value, slope_left[turned], flat, at - low[turned])
            after = may_turn_twice(
                value, right[turned], flat, slope_right[turned], high[turned] - at
            )
            middle[turned], closer[turned] = at, before | after
        turns, where = middle[turned | closer], rows[turned | closer]
        if splits == 0 or not closer.any():
            return middle[turned], rows[turned]
        halves = (
            np.concatenate([low[closer], middle[closer]]),
            np.concatenate([middle[closer], high[closer]]),
            np.tile(rows[closer], 2),
        )
        more, at_rows = self._turning_points(*halves, splits - 1)
        return np.concatenate([turns, more]), np.concatenate([where, at_rows])

    def solutions(
        self, x: Array, rows: IntArray, span: float
    ) -> tuple[Array, IntArray, BoolArray, Array]:
        """Return all solutions and their rows, shape (m,) each, ascending. The solutions are
        searched in the monotone parts of each row. The edges of these parts are `x`, shape (e,);
        `rows`, shape (e,), holds the row of each edge.

        Also return two results for each row, shape (n,): True if the solutions fill a range, and
        the edge at which the output is nearest to the wanted output.
        """
        n, missing = len(self.wanted), self.missing(x, rows)
        starts = np.searchsorted(rows, np.arange(n))
        nearest = x[np.lexsort([np.abs(missing), rows])[starts]]
        outputs = np.maximum.reduceat(missing, starts) - np.minimum.reduceat(missing, starts)
        near = SAME * np.maximum(outputs, np.abs(self.wanted))
        hit = np.abs(missing) <= near[rows]
        left, right = hit[:-1], hit[1:]
        beside = rows[1:] == rows[:-1]
        width = np.where(beside, np.diff(x), 0.0)
        filled = left & right & (width > SAME * span)
        flat = np.bincount(rows[1:][filled], minlength=n) > 0
        first = hit & ~np.append(False, left & beside)
        crosses = (np.sign(missing[:-1]) * np.sign(missing[1:]) < 0) & ~left & ~right & (width > 0)
        where = rows[1:][crosses]
        crossed = _bisected(
            lambda at, which: self.missing(at, where[which]), x[:-1][crosses], x[1:][crosses]
        )
        # a jump of the output across the wanted value is no solution
        reached = np.maximum(REACHED * np.abs(self.wanted[where]), near[where])
        real = np.abs(self.missing(crossed, where)) <= reached
        values = np.concatenate([x[first], crossed[real]])
        of = np.concatenate([rows[first], where[real]])
        order = np.lexsort([values, of])
        return values[order], of[order], flat, nearest


def may_turn_twice(
    left: Array, right: Array, slope_left: Array, slope_right: Array, width: Array
) -> BoolArray:
    """Return True for each part, (m,), in which the slope may change its sign twice, so that the
    output may reach zero in between. This is decided from the values and slopes at both ends of the
    part.

    A cubic is monotone if its slopes at both ends are at most three times the slope of the secant
    (Fritsch and Carlson 1980). Within the part, the cubic differs from its value at an end by less
    than the part's width times the steeper of the two slopes.
    """
    reach = np.maximum(np.abs(slope_left), np.abs(slope_right)) * width
    rise = right - left
    bends = (reach > STEEP * np.abs(rise)) | (rise * (slope_left + slope_right) < 0)
    left, right = np.abs(left), np.abs(right)
    nearer, farther = np.minimum(left, right), np.maximum(left, right)
    return bends & (reach > SAME * farther) & (nearer <= reach)


def _bisected(f: Callable[[Array, IntArray], Array], low: Array, high: Array) -> Array:
    """Return the place between each `low` and `high`, (m,), at which f changes its sign, by
    bisection. The arguments of f are places and their indices.
    """
    which = np.arange(len(low))
    if not len(low):
        return low
    start = np.sign(f(low, which))
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        same = np.sign(f(middle, which)) == start
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return (low + high) / 2


def _picked(values: Array, rows: IntArray, n: int, rule: str) -> Array:
    """Return, for each row, the solution that the `rule` selects; NaN for a row without a
    solution.
    """
    values_of_rows, before = np.full(n, np.nan), np.nan
    starts = np.searchsorted(rows, np.arange(n + 1))
    for row in range(n):
        of_row = values[starts[row] : starts[row + 1]]
        if len(of_row):
            nearest = rule == NEAREST and not np.isnan(before)
            before = values_of_rows[row] = (
                of_row[np.argmin(np.abs(of_row - before))] if nearest else of_row[0]
            )
    return values_of_rows
