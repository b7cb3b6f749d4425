"""Fit Sárosi's formula with a foot to normalised data. The foot is a plane that describes the small
forces of the slack muscle.

With p = P/max|P|, x = strain/max|strain| and f = F/max|F| (any target F), the formula is

    f = lo + w ln(1 + exp((hi - lo)/w))
    hi = (a1 p + a2) exp(a3 x) + a4 x p + a5 p + a6
    lo = b0 + b1 p + b2 x

Above the foot, f follows Sárosi's `hi`; on the foot, it follows the plane `lo`. A hinge of width w
joins them. The coordinates q, shape (10,), are the parameters in the order of `NAMES`, with ln w
instead of w.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling.literature import linear
from mapmore_cli.modelling.literature.descent import agreement, descend, onto_bounds
from mapmore_cli.modelling.literature.problem import condensed, dependence

METHOD = "penalised least squares"
NAMES = ("a1", "a2", "a3", "a4", "a5", "a6", "b0", "b1", "b2", "w")
A, A3, B, B1, LN_W = [0, 1, 3, 4, 5], 2, [6, 7, 8], 7, 9
"""Indices of parameters in q: the linear parameters of `hi`, the curvature of `hi`, the parameters
of `lo`, the slope of the foot with the pressure, and the logarithm of the width.
"""


# Constants of the fit, each with its reason.
# `docs/formula_tables.py RUNS hinge` shows the errors with half and with twice each constant.

# starting values of a3, from a steep decay to a curve that bends upwards
STARTS = (-8.0, -4.0, -2.0, -0.7, 1.5)
# largest number of evaluations from each start; only the best result is improved further
FIRST = 100
# starting value of w: a sharp hinge, which the search can widen
START_W = 0.02
# The starting values of `hi` are fitted to the samples with a normalised target above this value.
UPPER = 0.12
# The starting values of `lo` are fitted to the samples with a normalised target below this value.
FOOT = 0.06
# largest |a3|; data cannot distinguish steeper decays
LARGEST_A3 = 15.0
# smallest w; a sharper hinge would be a kink, which has no derivative
LEAST_W = 0.004
# largest w; a wider hinge would bend the whole curve
LARGEST_W = 0.3
# Weight of the prior of each parameter.
# The weights are so small that a prior matters only if data do not determine its parameter.
PRIOR_WEIGHTS = (0.01, *5 * (0.003,), 0.001, 0.03, 0.03, 0.001)
# centre of the prior of a3/max|strain|, the exponent per unit of strain
DECAY = -33.0
# The centre of the prior of a3, DECAY times the largest strain, is not lower than this number.
STEEPEST = -12.0
# The weight of the prior of a3 is this number divided by the largest strain.
# A small range of strain hardly determines a3, so that its prior needs a larger weight.
DECAY_WEIGHT = 0.002
# centre of the prior of w, as a fraction of the largest target
PRIOR_W = 0.03
# Largest total weight of the data relative to the priors, as a number of samples.
# Without this limit, priors would have no effect if there are many nearly equal samples.
INDEPENDENT = 300
# with at most this many strain levels, any curvature fits; this affects only the text of a note
FEW_LEVELS = 3
# strains that differ by less than this fraction of max|strain| are regarded as one strain level
APART = 0.05


def linearised(q: Array, p: Array, x: Array) -> tuple[Array, Array]:
    """Return the normalised force, shape (n,), and its derivatives with respect to the coordinates
    q, shape (n, 10).
    """
    a1, a2, a3, a4, a5, a6, b0, b1, b2, log_w = q
    w, decay = np.exp(log_w), np.exp(a3 * x)
    high, low = (a1 * p + a2) * decay + (a4 * x + a5) * p + a6, b0 + b1 * p + b2 * x
    above = (high - low) / w
    softened = np.logaddexp(0.0, above)
    share = 0.5 * (1.0 + np.tanh(0.5 * above))  # derivative of the force with respect to `hi`
    below = 1.0 - share
    falling = decay * share
    slopes = (
        *(p * falling, falling, (a1 * p + a2) * x * falling, x * p * share, p * share, share),
        *(below, p * below, x * below),
        w * (softened - share * above),
    )
    return low + w * softened, np.stack(slopes, axis=-1)


class _Problem(NamedTuple):
    """Least-squares problem with normalised rows: `p`, `x` and `f`, the square roots of the weights
    of the rows, shape (n,) each, and the centres and weights of the priors, shape (10,) each.
    """

    p: Array
    x: Array
    f: Array
    root: Array
    centre: Array
    weight: Array

    def of_data(self, q: Array) -> tuple[Array, Array]:
        """Return the weighted residuals of the rows, shape (n,), and their derivatives, shape (n,
        10).
        """
        force, slopes = linearised(q, self.p, self.x)
        return self.root * (force - self.f), self.root[:, None] * slopes

    def system(self, q: Array) -> tuple[Array, Array]:
        """Return the weighted residuals of the n rows and of the 10 priors, shape (n + 10,), and
        their derivatives, shape (n + 10, 10).
        """
        residual, slopes = self.of_data(q)
        priors = self.weight * (q - self.centre), np.diag(self.weight)
        return np.concatenate([residual, priors[0]]), np.concatenate([slopes, priors[1]])


def fit_hinge(columns: Columns, y: Array, curvature: float | None = None) -> FormulaFit:
    """Fit the hinged formula to `pressure`, `strain` (a fraction) and the target `y`, shape (n,)
    each, all finite.

    The search begins at five values of the curvature a3, or at one value if the `curvature` is
    known. The result with the lowest penalised sum of squares (its `sse`) is returned. Standard
    errors treat the priors as observations; rank and condition number are computed from the data
    alone. The same data always give the same fit, which does not depend on the units of pressure
    and target. With more than some thousand samples, the search uses means of neighbouring samples
    (`problem.condensed`).

    Raises FitError if the formula has no finite value at any start.
    """
    inputs = columns["pressure"], columns["strain"], y
    scales = [float(np.abs(column).max()) or 1.0 for column in inputs]
    problem = _normalised(columns, y, *scales)
    curvatures = STARTS if curvature is None else (curvature * scales[1],)
    starts, bounds = [_start_at(problem, a3) for a3 in curvatures], _search_bounds()
    ends = descend(problem.system, starts, bounds, evaluations=FIRST)
    if not ends:
        raise FitError(
            "the formula has no finite value at any of its starting values",
            "check the units of its quantities",
        )
    best = min(ends, key=lambda end: end.cost)
    if not best.converged:
        (best,) = descend(problem.system, [best.x], bounds)
    q, touched = onto_bounds(best.x, bounds)
    residual, slopes = problem.of_data(q)
    _, rank, condition = linear.parameter_errors(slopes, 0.0)
    # `freedom` is positive, because `sarosi_hinged` has 17 parameters and refuses fewer samples
    freedom = float(problem.root @ problem.root) - len(NAMES)
    variance = float(residual @ residual) / freedom
    errors, _, _ = linear.parameter_errors(problem.system(q)[1], variance)
    errors[LN_W] *= np.exp(q[LN_W])
    notes = [
        f"a3 is {q[A3]:.3g}/max|strain|, w is {np.exp(q[LN_W]):.3g} of the largest target; "
        f"{agreement(ends, best, len(starts))}",
        *_remarks(columns, problem.centre[A3], touched, rank),
    ]
    status = "at_bound" if touched and best.converged else best.status
    if rank < len(NAMES):
        status = "rank_deficient"
    per_p, per_x, f = 1 / scales[0], 1 / scales[1], scales[2]
    units = np.array(
        [f * per_p, f, per_x, f * per_p * per_x, f * per_p, f, f, f * per_p, f * per_x, f]
    )

    values = np.append(q[:LN_W], np.exp(q[LN_W])) * units
    return FormulaFit(
        name="hinge",
        parameters=dict(zip(NAMES, values.tolist(), strict=True)),
        errors=dict(zip(NAMES, (errors * units).tolist(), strict=True)),
        status=status,
        method=METHOD,
        rank=rank,
        condition=condition,
        sse=2 * best.cost * f**2,
        samples=len(y),
        notes=tuple(notes),
    )


def _remarks(columns: Columns, prior: float, touched: list[int], rank: int) -> Iterator[str]:
    """Yield notes on parameters that the data do not determine, and on those at a bound."""
    levels = _strain_levels(columns["strain"])
    if levels <= FEW_LEVELS:
        yield (
            f"with {levels} strain level{'s' * (levels > 1)} every curvature fits, so that "
            f"a3 keeps its prior value, {prior:.3g}/max|strain|; values "
            "between the levels depend on it"
        )
    yield from (f"{NAMES[i]} ends at its bound" for i in touched)
    if rank < len(NAMES):
        yield dependence(rank, len(NAMES), columns, "the priors decided")


def _strain_levels(strain: Array) -> int:
    """Return the number of distinct strain levels; a large number if the strain varies
    continuously.
    """
    values = np.unique(strain)
    gap = APART * float(np.abs(values).max())
    count, i = 0, 0
    while i < len(values):
        count, i = count + 1, int(np.searchsorted(values, values[i] + gap, side="right"))
    return count


def _normalised(
    columns: Columns, y: Array, pressure: float, strain: float, target: float
) -> _Problem:
    means, f, counts = condensed(columns, y)
    centre, weight = np.zeros(len(NAMES)), np.array(PRIOR_WEIGHTS)
    centre[A3], weight[A3] = max(DECAY * strain, STEEPEST), DECAY_WEIGHT / strain
    centre[LN_W] = np.log(PRIOR_W)
    root = np.sqrt(counts * min(len(y), INDEPENDENT) / len(y))
    return _Problem(
        means["pressure"] / pressure, means["strain"] / strain, f / target, root, centre, weight
    )


def _search_bounds() -> tuple[Array, Array]:
    """Return the lower and upper bounds of the coordinates q, shape (10,) each. Only the curvature,
    the slope of the foot along the pressure, and the width are bounded.
    """
    low, high = np.full(len(NAMES), -np.inf), np.full(len(NAMES), np.inf)
    low[[A3, B1, LN_W]] = -LARGEST_A3, 0.0, np.log(LEAST_W)
    high[[A3, LN_W]] = LARGEST_A3, np.log(LARGEST_W)
    return low, high


def _start_at(problem: _Problem, a3: float) -> Array:
    """Return starting values of the coordinates q for a given curvature a3. By least squares, `hi`
    is fitted to the samples with large targets, and `lo` to the samples with the smallest targets.
    """
    p, x, ones = problem.p, problem.x, np.ones_like(problem.p)
    q, decay = np.zeros(len(NAMES)), np.exp(a3 * x)
    q[A3], q[LN_W] = a3, np.log(START_W)
    q[A] = _least_squares(problem, [p * decay, decay, x * p, p, ones], problem.f > UPPER)
    q[B] = _least_squares(problem, [ones, p, x], problem.f < FOOT)
    q[B1] = max(q[B1], 0.0)
    return q


def _least_squares(problem: _Problem, regressors: list[Array], rows: BoolArray) -> Array:
    if not rows.any():
        return np.zeros(len(regressors))
    phi, root = np.stack(regressors, axis=1)[rows], problem.root[rows]
    return linear.solve_linear(root[:, None] * phi, root * problem.f[rows]).beta
