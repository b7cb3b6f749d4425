"""Sárosi's formula with a slack foot, on normalised data: its values, its derivatives, its units,
and how it is fitted.

With p = P/max|P|, x = strain/max|strain|, f = F/max|F| (any target F):

    f = lo + w ln(1 + exp((hi - lo)/w)),   hi = (a1 p + a2) exp(a3 x) + a4 x p + a5 p + a6,   lo =
    b0 + b1 p + b2 x

is Sárosi's `hi` above the foot and the plane `lo` on it, joined by a hinge of width w. Coordinates
q, `(10,)`, are the parameters in the order of `NAMES`, but for ln w in place of w.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling.literature import linear
from mapmore_cli.modelling.literature.problem import condensed, dependence
from mapmore_cli.modelling.literature.solvers import agreement, descend, onto_bounds

METHOD = "penalised least squares"
NAMES = ("a1", "a2", "a3", "a4", "a5", "a6", "b0", "b1", "b2", "w")
A, A3, B, B1, LN_W = [0, 1, 3, 4, 5], 2, [6, 7, 8], 7, 9
"""Places of the parameters in q: the linear ones of `hi`, its curvature, those of `lo`, the foot's
slope with pressure, the width.
"""


# Constants of the fit, each below its reason. `docs/formula_tables.py RUNS hinge` shows what half
# and twice of each make of the errors between strain levels.

# a3 at the starts: from a steep decay to a bend upwards
STARTS = (-8.0, -4.0, -2.0, -0.7, 1.5)
# evaluations of each start, of which the lowest end is followed on
FIRST = 100
# w at the starts: a sharp hinge, which widens where it must
START_W = 0.02
# the start of `hi` is fitted to the normalised targets above it
UPPER = 0.12
# the start of `lo` is fitted to the normalised targets below it
FOOT = 0.06
# bound of |a3|: no data tell steeper decays apart
LARGEST_A3 = 15.0
# least w: a sharper hinge is a kink, which has no slope
LEAST_W = 0.004
# largest w: a wider hinge is none, since it bends the whole curve
LARGEST_W = 0.3
# weights of the priors by parameter: so small that they decide what no data show, and no more
PRIOR_WEIGHTS = (0.01, *5 * (0.003,), 0.001, 0.03, 0.03, 0.001)
# prior of a3/max|strain|, per unit of strain
DECAY = -33.0
# the prior of a3 is no steeper, however large the strain
STEEPEST = -12.0
# weight of the prior of a3 times the largest strain: over a short range a3 is vague
DECAY_WEIGHT = 0.002
# prior of w, of the largest target
PRIOR_W = 0.03
# most samples that the data count as against the priors: neighbours in a slow recording repeat each
# other, and counted one by one they leave the priors no weight
INDEPENDENT = 300
# any curvature passes through so few strain levels: decides on the words of a note alone
FEW_LEVELS = 3
# of max|strain|: nearer strain levels are one; decides on the words of a note alone
APART = 0.05


def linearised(q: Array, p: Array, x: Array) -> tuple[Array, Array]:
    """Return the normalised force, `(n,)`, and its derivative for q, `(n, 10)`."""
    a1, a2, a3, a4, a5, a6, b0, b1, b2, log_w = q
    w, decay = np.exp(log_w), np.exp(a3 * x)
    high, low = (a1 * p + a2) * decay + (a4 * x + a5) * p + a6, b0 + b1 * p + b2 * x
    above = (high - low) / w
    softened = np.logaddexp(0.0, above)
    share = 0.5 * (1.0 + np.tanh(0.5 * above))  # d force / d hi
    below = 1.0 - share
    falling = decay * share
    slopes = (
        *(p * falling, falling, (a1 * p + a2) * x * falling, x * p * share, p * share, share),
        *(below, p * below, x * below),
        w * (softened - share * above),
    )
    return low + w * softened, np.stack(slopes, axis=-1)


class _Problem(NamedTuple):
    """Normalised rows with the roots of their weights, each `(n,)`, and the centres and weights of
    the priors, `(10,)`.
    """

    p: Array
    x: Array
    f: Array
    root: Array
    centre: Array
    weight: Array

    def of_data(self, q: Array) -> tuple[Array, Array]:
        """Residuals of the rows and their derivatives, `(n,)` and `(n, 10)`."""
        force, slopes = linearised(q, self.p, self.x)
        return self.root * (force - self.f), self.root[:, None] * slopes

    def system(self, q: Array) -> tuple[Array, Array]:
        """Return the same with the priors below: `(n + 10,)` and `(n + 10, 10)`."""
        residual, slopes = self.of_data(q)
        priors = self.weight * (q - self.centre), np.diag(self.weight)
        return np.concatenate([residual, priors[0]]), np.concatenate([slopes, priors[1]])


def fit_hinge(columns: Columns, y: Array, curvature: float | None = None) -> FormulaFit:
    """Fit the hinged formula to `pressure`, `strain` (a fraction) and the target `y`, `(n,)` each
    and finite.

    Of five starts that differ in the curvature a3, or the one that has a known `curvature`, the
    lowest penalised sum of squares wins, the `sse` of the result; errors are with the priors taken
    as observations, rank and condition those of the data alone. Deterministic; the units of
    pressure and target are no matter. Above some thousand samples the search goes over means of
    neighbouring ones
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
            "the formula has no finite value at any start of its fit",
            "check the units of its quantities",
        )
    best = min(ends, key=lambda end: end.cost)
    if not best.converged:
        (best,) = descend(problem.system, [best.x], bounds)
    q, touched = onto_bounds(best.x, bounds)
    residual, slopes = problem.of_data(q)
    _, rank, condition = linear.parameter_errors(slopes, 0.0)
    freedom = float(problem.root @ problem.root) - len(NAMES)
    variance = float(residual @ residual) / freedom if freedom > 0.5 else np.nan
    errors, _, _ = linear.parameter_errors(problem.system(q)[1], variance)
    errors[LN_W] *= np.exp(q[LN_W])
    notes = [
        f"a3 is {q[A3]:.3g}/max|strain|, w is {np.exp(q[LN_W]):.3g} of the largest target; "
        f"{agreement(ends, best, len(starts))}"
    ]
    levels = _strain_levels(columns["strain"])
    if levels <= FEW_LEVELS:
        notes.append(
            f"with {levels} strain level{'s' * (levels > 1)} every curvature fits, so that "
            f"a3 keeps its prior value, {problem.centre[A3]:.3g}/max|strain|; values "
            "between the levels depend on it"
        )
    notes += [f"{NAMES[i]} ends at its bound" for i in touched]
    status = "at_bound" if touched and best.converged else best.status
    if rank < len(NAMES):
        status = "rank_deficient"
        notes.append(dependence(rank, len(NAMES), columns, "the priors decided"))
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


def _strain_levels(strain: Array) -> int:
    """Return number of strains that lie apart; many where the strain is swept."""
    values = np.unique(strain)
    gap = APART * float(np.abs(values).max())
    count, i = 0, 0
    while i < len(values):
        count, i = count + 1, int(np.searchsorted(values, values[i] + gap, side="right"))
    return count


def _normalised(
    columns: Columns, y: Array, pressure: float, strain: float, target: float
) -> _Problem:
    means, f, counts = condensed({name: columns[name] for name in ("pressure", "strain")}, y)
    centre, weight = np.zeros(len(NAMES)), np.array(PRIOR_WEIGHTS)
    centre[A3], weight[A3] = max(DECAY * strain, STEEPEST), DECAY_WEIGHT / strain
    centre[LN_W] = np.log(PRIOR_W)
    root = np.sqrt(counts * min(len(y), INDEPENDENT) / len(y))
    return _Problem(
        means["pressure"] / pressure, means["strain"] / strain, f / target, root, centre, weight
    )


def _search_bounds() -> tuple[Array, Array]:
    """Return least and largest q, (10,): of the curvature, of the foot's slope with pressure, and
    of the width.
    """
    low, high = np.full((2, len(NAMES)), np.inf) * [[-1.0], [1.0]]
    low[[A3, B1, LN_W]] = -LARGEST_A3, 0.0, np.log(LEAST_W)
    high[[A3, LN_W]] = LARGEST_A3, np.log(LARGEST_W)
    return low, high


def _start_at(problem: _Problem, a3: float) -> Array:
    """Return `hi` through the upper targets and `lo` through the lowest ones, by least squares, for
    a starting curvature.
    """
    p, x, one = problem.p, problem.x, np.ones_like(problem.p)
    q, decay = np.zeros(len(NAMES)), np.exp(a3 * x)
    q[A3], q[LN_W] = a3, np.log(START_W)
    q[A] = _least_squares(problem, [p * decay, decay, x * p, p, one], problem.f > UPPER)
    q[B] = _least_squares(problem, [one, p, x], problem.f < FOOT)
    q[B1] = max(q[B1], 0.0)
    return q


def _least_squares(problem: _Problem, regressors: list[Array], rows: BoolArray) -> Array:
    if not rows.any():
        return np.zeros(len(regressors))
    phi, root = np.stack(regressors, axis=1)[rows], problem.root[rows]
    return linear.solve_linear(root[:, None] * phi, root * problem.f[rows]).beta
