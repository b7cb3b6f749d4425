"""Sárosi's formula with a slack foot, on normalised data: its values, its derivatives, its units,
and how it is fitted.

With p = P/max|P|, x = strain/max|strain|, f = F/max|F| (any target F):

    f = lo + w ln(1 + exp((hi - lo)/w)),   hi = (a1 p + a2) exp(a3 x) + a4 x p + a5 p + a6,   lo =
    b0 + b1 p + b2 x

is Sárosi's `hi` above the foot and the plane `lo` on it, joined by a hinge of width w. Coordinates
q, `(10,)`, are the parameters in the order of `NAMES`, but for ln w in place of w.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.fits import FormulaFit, Optimum
from mapmore_cli.modelling.literature import linear
from mapmore_cli.modelling.literature.descent import End, descend, lowest, onto_bounds, rivals
from mapmore_cli.modelling.literature.problem import condensed, dependence

METHOD = "penalised least squares"
FEW_LEVELS = 3  # strain levels that any curvature passes through
APART = 0.05  # of max|strain|: levels nearer than that are one

NAMES = ("a1", "a2", "a3", "a4", "a5", "a6", "b0", "b1", "b2", "w")
A, A3, B, B1, LN_W = [0, 1, 3, 4, 5], 2, [6, 7, 8], 7, 9
"""Places of the parameters in q: the linear ones of `hi`, its curvature, those of `lo`, the foot's
slope with pressure, the width.
"""


def linearised(q: Array, p: Array, x: Array) -> tuple[Array, Array]:
    """Return the normalised force, `(n,)`, and its derivative for q, `(n, 10)`; of several places
    q, `(s, n)` and `(s, n, 10)`.
    """
    a1, a2, a3, a4, a5, a6, b0, b1, b2, log_w = np.moveaxis(q, -1, 0)[..., np.newaxis]
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


def _units(pressure: float, strain: float, target: float) -> Array:
    """Return what one of every parameter is in the units of the data, `(10,)`, with the scales that
    the data were divided by.
    """
    upper = [
        target / pressure,
        target,
        1 / strain,
        target / (pressure * strain),
        target / pressure,
        target,
    ]
    return np.array([*upper, target, target / pressure, target / strain, target])


START_A3 = (-8.0, -4.0, -2.0, -0.7, 1.5)
START_W = 0.02
UPPER, FOOT = (
    0.12,
    0.06,
)  # normalised targets above and below which the starts of `hi` and `lo` are fitted
LIMITS = {A3: (-15.0, 15.0), B1: (0.0, np.inf), LN_W: (np.log(0.004), np.log(0.3))}
PRIOR_WEIGHTS = (
    0.01,
    0.003,
    np.nan,
    0.003,
    0.003,
    0.003,
    0.001,
    0.03,
    0.03,
    0.001,
)  # that of a3 depends on the largest strain:
DECAY, DECAY_SPREAD, DECAY_WEIGHT, STEEPEST = (
    -33.0,
    15.0,
    0.03,
    -12.0,
)  # a3/max|strain| is near DECAY, a3 above STEEPEST
PRIOR_W = 0.03
INDEPENDENT = 300
"""Most samples that the data count as against the priors. Neighbouring samples of a slow recording
repeat each other: counted one by one, 100 000 of them leave the priors no weight, and a3, which
three strain levels do not show, runs to its bounds again. On the Festo muscles any number from 30
to 1000 predicts left-out strains about as well."""
TOLERANCE = 1e-13
LOWEST, HIGHEST = (
    np.array([LIMITS.get(i, (-np.inf, np.inf))[side] for i in range(len(NAMES))]) for side in (0, 1)
)


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
        """Residuals of the rows and their derivatives, `(n,)` and `(n, 10)`; of several places `(s,
        n)` and `(s, n, 10)`.
        """
        force, slopes = linearised(q, self.p, self.x)
        return self.root * (force - self.f), self.root[..., None] * slopes

    def system(self, q: Array) -> tuple[Array, Array]:
        """Return the same with the priors below, for a `descent`: `(s, n + 10)` and `(s, n + 10,
        10)`.
        """
        residual, slopes = self.of_data(q)
        priors = np.broadcast_to(np.diag(self.weight), (*q.shape, len(NAMES)))
        return np.concatenate([residual, self.weight * (q - self.centre)], axis=-1), np.concatenate(
            [slopes, priors], axis=-2
        )


def fit(columns: Columns, y: Array) -> FormulaFit:
    """Fit the hinged formula to `pressure`, `strain` (a fraction) and the target `y`, `(n,)` each
    and finite.

    Of five starts that differ in the curvature, the lowest penalised sum of squares wins, the `sse`
    of the result and of its rivals; errors are with the priors taken as observations, rank and
    condition those of the data alone. Deterministic; the units of pressure and target are no
    matter. Above some thousand samples the search goes over means of neighbouring ones
    (`problem.condensed`).
    """
    problem = _normalised(columns, y)
    target, units = _scale(y), _units(*map(_scale, (columns["pressure"], columns["strain"], y)))
    ends = descend(problem.system, list(_starts(problem)), (LOWEST, HIGHEST), TOLERANCE)
    best, agreement = lowest(ends, len(START_A3))
    q, touched = onto_bounds(best.x, (LOWEST, HIGHEST))
    _, rank, condition = linear.standard_errors(problem.of_data(q)[1], 0.0)
    errors = _errors(problem, q)
    errors[LN_W] *= np.exp(q[LN_W])
    status = (
        "rank_deficient"
        if rank < len(NAMES)
        else "stopped_by_limit"
        if not best.converged
        else "at_bound"
        if touched
        else "converged"
    )
    notes = [
        f"a3 is {q[A3]:.3g}/max|strain|, w is {np.exp(q[LN_W]):.3g} of the largest target; "
        f"{agreement}"
    ]
    levels = _levels(columns["strain"])
    if levels <= FEW_LEVELS:
        prior = (
            f"a3 is left to its prior, {problem.centre[A3]:.3g}/max|strain|, and values "
            "between the levels depend on it"
        )
        notes.append(f"with {levels} strain level{'s' * (levels > 1)} any curvature fits: {prior}")
    notes += [f"{NAMES[i]} ends at its bound" for i in touched]
    if rank < len(NAMES):
        notes.append(dependence(rank, len(NAMES), columns, "the priors decided"))

    def named(q: Array) -> dict[str, float]:
        return dict(
            zip(NAMES, map(float, np.append(q[:LN_W], np.exp(q[LN_W])) * units), strict=True)
        )

    def squares(end: End) -> float:
        return 2 * end.cost * target**2

    deviations = dict(zip(NAMES, map(float, errors * units), strict=True))
    others = tuple(Optimum(named(end.x), squares(end)) for end in rivals(ends, best))
    return FormulaFit(
        "hinge",
        named(q),
        deviations,
        status,
        METHOD,
        rank,
        condition,
        squares(best),
        len(y),
        tuple(notes),
        others,
    )


def _levels(strain: Array) -> int:
    """Return number of strains that lie apart; many where the strain is swept."""
    values = np.unique(strain)
    gap = APART * float(np.abs(values).max())
    count, i = 0, 0
    while i < len(values):
        count, i = count + 1, int(np.searchsorted(values, values[i] + gap, side="right"))
    return count


def _scale(column: Array) -> float:
    return float(np.abs(column).max()) or 1.0


def _normalised(columns: Columns, y: Array) -> _Problem:
    pressure, strain, target = _scale(columns["pressure"]), _scale(columns["strain"]), _scale(y)
    means, f, counts = condensed({name: columns[name] for name in ("pressure", "strain")}, y)
    centre, weight = np.zeros(len(NAMES)), np.array(PRIOR_WEIGHTS)
    centre[A3], weight[A3] = max(DECAY * strain, STEEPEST), DECAY_WEIGHT / (DECAY_SPREAD * strain)
    centre[LN_W] = np.log(PRIOR_W)
    root = np.sqrt(counts * min(len(y), INDEPENDENT) / len(y))
    return _Problem(
        means["pressure"] / pressure, means["strain"] / strain, f / target, root, centre, weight
    )


def _starts(problem: _Problem) -> Iterator[Array]:
    """For every starting curvature, `hi` through the upper targets and `lo` through the lowest
    ones, by least squares.
    """
    p, x, one = problem.p, problem.x, np.ones_like(problem.p)
    for a3 in START_A3:
        q, decay = np.zeros(len(NAMES)), np.exp(a3 * x)
        q[A3], q[LN_W] = a3, np.log(START_W)
        q[A] = _least_squares(
            problem, np.stack([p * decay, decay, x * p, p, one], axis=1), problem.f > UPPER
        )
        q[B] = _least_squares(problem, np.stack([one, p, x], axis=1), problem.f < FOOT)
        q[B1] = max(q[B1], 0.0)
        yield q


def _least_squares(problem: _Problem, phi: Array, chosen: BoolArray) -> Array:
    if not chosen.any():
        return np.zeros(phi.shape[1])
    root = problem.root[chosen]
    return linear.solve(root[:, None] * phi[chosen], root * problem.f[chosen]).beta


def _errors(problem: _Problem, q: Array) -> Array:
    """Return standard errors of q, `(10,)`; NaN without more independent samples than parameters,
    or where the data do not show one.
    """
    (data, _), (_, slopes) = problem.of_data(q), problem.system(q)
    freedom = float(problem.root @ problem.root) - len(NAMES)
    variance = float(data @ data) / freedom if freedom > 0.5 else np.nan
    try:
        return np.asarray(np.sqrt(variance * np.diag(np.linalg.inv(slopes.T @ slopes))))
    except np.linalg.LinAlgError:
        return np.full(len(q), np.nan)
