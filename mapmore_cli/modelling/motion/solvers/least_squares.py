"""`least_squares`: Gauss and Newton over the poles from a linear start; the weights follow by projection."""

from __future__ import annotations

import cmath

import numpy as np
from scipy.optimize import least_squares

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.motion.problem import Found, MotionRecipe, Piece, Problem
from mapmore_cli.modelling.motion.sections import angles, of_angles

STRIDES = (1, 3, 10, 30)
"""Samples between those that a linear start compares: noise hides in short strides what long ones show, and long ones miss fast poles."""

NEAREST = 0.999
"""Of the edge of stability: where a start may lie at most."""

TOLERANCE = 1e-12


def solve(problem: Problem, recipe: MotionRecipe) -> Found:  # noqa: ARG001 (a solver's form)
    """From the best of the linear starts."""
    starts = [start for stride in STRIDES if (start := linear_start(problem.pieces, stride)) is not None]
    within = [of_angles(np.array(angles(*start, problem.reach, NEAREST)), problem.reach) for start in starts]
    errors = [problem.projected_rmse(*start) for start in within]
    return _refined(problem, *within[int(np.argmin(errors))])


def polish(problem: Problem, found: Found) -> Found:
    """On from what another solver found, with its history before."""
    better = _refined(problem, found.p1, found.p2)
    return Found(better.p1, better.p2, better.weights, better.rmse, better.evaluations, np.concatenate([found.history, better.history]))


def _refined(problem: Problem, p1: float, p2: float) -> Found:
    history: list[float] = []

    def residuals(place: Array) -> Array:
        left = problem.projected(*of_angles(place, problem.reach))[1]
        rmse = float(np.sqrt(np.mean(left**2)))
        history.append(min(rmse, history[-1]) if history else rmse)
        return left

    start = angles(p1, p2, problem.reach, NEAREST)
    best = least_squares(residuals, start, jac="3-point", ftol=TOLERANCE, xtol=TOLERANCE, gtol=TOLERANCE, max_nfev=200)
    return problem.found(*of_angles(best.x, problem.reach), history)


def linear_start(pieces: tuple[Piece, ...], stride: int) -> tuple[float, float] | None:
    """P1 and P2 by linear regression of `y[k + 2s] = a y[k + s] + b y[k] + sum_m c_m d_m[k]`, its poles brought back to one sample.

    Only where the section holds at all three samples; None where these are too few. Noise in y makes the regression wrong (it is one step
    ahead): it is only where to begin.
    """
    rows, targets = [], []
    for piece in pieces:
        own = np.flatnonzero(piece.counts[: -2 * stride] & piece.counts[stride:-stride] & piece.counts[2 * stride :])
        rows.append(np.column_stack([piece.y[own + stride], piece.y[own], piece.drives[own]]))
        targets.append(piece.y[own + 2 * stride])
    matrix, y = np.concatenate(rows), np.concatenate(targets)
    if len(y) < matrix.shape[1] and stride > 1:
        return None
    p2, p1 = np.linalg.lstsq(matrix, y, rcond=None)[0][:2].tolist() if len(y) else (0.0, 0.0)
    return _at_one_sample(p1, p2, stride)


def _at_one_sample(p1: float, p2: float, stride: int) -> tuple[float, float]:
    """P1 and P2 whose poles, taken to the power of `stride`, are those of the given ones."""
    if stride == 1:
        return p1, p2
    root = cmath.sqrt(0.25 * p2 * p2 + p1)
    first, second = ((0.5 * p2 + part) ** (1.0 / stride) for part in (root, -root))
    return -(first * second).real, (first + second).real
