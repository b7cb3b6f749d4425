"""Find the coefficients with the smallest simulation error, by the Levenberg-Marquardt method. The
simulated runs restart from measured outputs after a number of samples, the horizon. The horizon
grows during the search, until the runs never restart (free run).

One step ahead, the noise of the measured outputs biases the coefficients. A free run does not use
measured outputs. But its squared error is no quadratic function of the coefficients, and with
coefficients far from the minimum, a run may diverge. Runs that restart from measured outputs every
few samples are nearly as well behaved as one-step-ahead predictions. The search with each horizon
starts from the coefficients that were found with the previous, shorter horizon.

The sensitivities of a run follow from the derivatives of the statements of one sample: a change of
a coefficient changes a value directly, and also through the past values from which it is computed.
For all samples together, this gives one triangular linear system with a narrow band, which LAPACK
solves for all coefficients at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dtbtrs

from mapmore_cli.domain.arrays import Array, BoolArray, Ends
from mapmore_cli.modelling.frols.correlated import correlated_errors
from mapmore_cli.modelling.memory.simulation import ReadyPiece, Trajectory

FIRST = 16  # number of samples of the shortest horizon
GROWTH = 8  # factor from one horizon to the next
# the search ends if the next horizon is at most this multiple of the last one without divergence
LEAST_GROWTH = 1.2
DAMPING = 1e-3  # Levenberg-Marquardt factor at the start
# largest Levenberg-Marquardt factor; if no step reduces the error even then, the search ends
MOST_DAMPING = 1e8
# Each pair limits a search by the number of iterations and by the relative decrease of the error.
THOROUGH = (40, 1e-7)  # iterations and smallest relative decrease for free runs
QUICK = (6, 1e-2)  # iterations and smallest relative decrease for runs over a horizon
# iterations and smallest relative decrease if the search begins at an earlier fit to more samples
COARSE = (40, 1e-4)
# step of the difference quotient for the derivative with respect to a parameter of an operator
NUDGE = 1e-5


def sensitivities(piece: ReadyPiece, run: Trajectory, theta: Array) -> Array:
    """Return the derivatives of the n simulated outputs with respect to theta and the constant,
    shape (n, k + 1). The derivatives are infinite or NaN if the run is unstable.
    """
    feedback = piece.feedback
    n = len(run.begins)
    q = len(piece.history)
    inputs = piece.inputs[:n]
    groups = feedback.parts.groups
    phi = np.ones((n, len(theta) + 1))
    phi[:, :-1] = inputs
    if not feedback.weights:
        return phi
    known = piece.recalled(run)
    for group, name in enumerate(feedback.weights):
        known[name] = inputs[:, groups == group] @ theta[groups == group]
    with np.errstate(all="ignore"):
        slopes = np.reshape(
            [np.broadcast_to(slope, n) for slope in feedback.slopes(known, n)], (q, -1, n)
        )
    for group in range(len(feedback.weights)):
        phi[:, :-1][:, groups == group] *= slopes[0, len(feedback.recalls) + group][:, None]
    right = np.zeros((n * q, phi.shape[1]), order="F")
    right[::q] = phi
    solution, _ = dtbtrs(_banded(piece, run, slopes), right, uplo="L", diag="U", overwrite_b=1)
    return np.asarray(solution[::q])


def _banded(piece: ReadyPiece, run: Trajectory, slopes: Array) -> Array:
    """Return the diagonals below the main diagonal of the matrix `I - d(values)/d(past values)`.
    The solver assumes that the main diagonal is one. Values before a restart of the run are
    measured, so their derivatives are zero.
    """
    q, _, n = slopes.shape
    recalls = list(piece.feedback.recalls.values())
    rows = np.arange(n)
    matrix = np.zeros((max(steps for _, steps in recalls) * q + q, n * q))
    for place, (column, steps) in enumerate(recalls):
        moves = rows[rows - steps >= run.begins]
        for row in range(q):
            matrix[steps * q + row - column, (moves - steps) * q + column] -= slopes[
                row, place, moves
            ]
    return matrix


class Point(NamedTuple):
    """A point of the search for coefficients and parameters, with the runs of the model at this
    point.

    - `vector`: theta, the constant, and the operators' parameters in the coordinates of
      `Unknown.searched`, shape (k + 1 + m,).
    - `error`: value of the function to be minimised; it is infinite if a run diverges. `runs`: the
      runs of all pieces.
    - `residuals`: measured minus simulated output of the n samples in the masks `counted`, shape
      (n,).
    """

    vector: Array
    error: float = np.inf
    runs: Sequence[Trajectory] = ()
    residuals: Array = np.empty(0)


@dataclass(frozen=True)
class FreeRunProblem:
    """Problem of finding the smallest simulation error of one set of terms on training samples.

    - `pieces`: function that returns the prepared pieces for given operators' parameters, (m,).
    - `counted`: for each piece, a mask of the samples whose errors are added up, (n,).
    - `bounds`: smallest and largest output; a run that leaves this interval has diverged.
    - `ridge`: factor of each squared coefficient in the penalty, (k,).
    - `free_constant`: True if the model has a constant of its own.
    - `between`: lower and upper bounds of the vector (coefficients, constant and operators'
      parameters), (2, k + 1 + m).
    """

    pieces: Callable[[Array], Sequence[ReadyPiece]]
    counted: Sequence[BoolArray]
    bounds: Ends
    ridge: Array
    free_constant: bool
    between: Array

    def split(self, vector: Array) -> tuple[Array, float, Array]:
        """Split a vector into theta, (k,), the constant, and the operators' parameters, (m,)."""
        terms = len(self.ridge)
        return vector[:terms], float(vector[terms]), vector[terms + 1 :]

    def at(self, vector: Array, horizon: int | None = None) -> Point:
        """Run all pieces with the coefficients and parameters in `vector`, and return the point
        with its runs and its error. Entries outside their bounds are first moved to the bounds.
        """
        vector = np.clip(vector, *self.between)
        theta, constant, numbers = self.split(vector)
        runs = list[Trajectory]()
        residuals = list[Array]()
        for piece, rows in zip(self.pieces(numbers), self.counted, strict=True):
            run = piece.run(theta, constant, self.bounds, horizon)
            if len(run.begins) < piece.size:
                return Point(vector)
            runs.append(run)
            residuals.append((piece.measured[piece.start :] - run.output)[rows])
        pooled = np.concatenate(residuals)
        error = np.sum(pooled**2) + self.ridge @ theta**2
        return Point(vector, float(error), runs, pooled)

    def normal(self, point: Point, horizon: int | None = None) -> tuple[Array, Array]:
        """Return the matrix and the right-hand side of the normal equations at a point, `J'J +
        ridge` and `J'r - ridge theta`. J holds the derivatives of the outputs with respect to the
        entries of the vector, and r the residuals. The results are infinite or NaN if the
        derivatives are too large.
        """
        slopes = self.slopes(point, horizon)
        terms = np.arange(len(self.ridge))
        with np.errstate(over="ignore", invalid="ignore"):
            curvature = slopes.T @ slopes
        curvature[terms, terms] += self.ridge
        return curvature, self.downhill(point, slopes)

    def downhill(self, point: Point, slopes: Array) -> Array:
        """Return the negative gradient of the error at a point, divided by two, shape (k + 1 + m,).
        `slopes` are the derivatives of the outputs at this point.
        """
        theta, _, _ = self.split(point.vector)
        with np.errstate(over="ignore", invalid="ignore"):
            downhill: Array = slopes.T @ point.residuals
        downhill[: len(theta)] -= self.ridge * theta
        return downhill

    def slopes(self, point: Point, horizon: int | None = None) -> Array:
        """Return the derivatives of the outputs with respect to all entries of a point's vector,
        shape (n, k + 1 + m).

        For the parameter of an operator, the derivative is a central difference quotient. At a
        bound, or if the run on one side diverges, it is a one-sided difference quotient.
        """
        theta, _, numbers = self.split(point.vector)
        runs = zip(self.pieces(numbers), point.runs, self.counted, strict=True)
        columns = [np.vstack([sensitivities(piece, run, theta)[rows] for piece, run, rows in runs])]
        for place in range(len(theta) + 1, len(point.vector)):
            nudge = NUDGE * (np.arange(len(point.vector)) == place)
            ends = [self.at(point.vector + move, horizon) for move in (nudge, -nudge)]
            above, below = (end if np.isfinite(end.error) else point for end in ends)
            apart = above.vector[place] - below.vector[place] or np.inf
            columns.append((below.residuals - above.residuals) / apart)
        return np.column_stack(columns)

    def free(self, vector: Array, downhill: Array) -> BoolArray:
        """Return a mask, shape (k + 1 + m,), that is True for the entries of the vector that may
        change. An entry may not change if it is at a bound and the next step would lead beyond the
        bound. The constant may not change if the model has no constant of its own.
        """
        low, high = self.between
        at_low, at_high = vector <= low, vector >= high
        free: BoolArray = ~((at_low & (downhill < 0)) | (at_high & (downhill > 0)))
        free[len(self.ridge)] = self.free_constant
        return free


def refine(problem: FreeRunProblem, start: Array) -> Point:
    """Search from the vector `start` for the smallest error in free run, and return the point. The
    error of the point is infinite if the search finds no free run that stays within the bounds.
    """
    *_, numbers = problem.split(start)
    fed_back = problem.pieces(numbers)[0].feedback.weights
    longest = max(map(len, problem.counted))
    vector = start
    last = 0
    horizon = FIRST if fed_back else longest
    while True:
        whole = horizon >= longest
        effort = THOROUGH if whole else QUICK
        reached = minimise(problem, vector, None if whole else horizon, effort)
        if np.isfinite(reached.error):
            if whole:
                return reached
            vector = reached.vector
            last = horizon
            horizon = horizon * GROWTH
            continue
        nearer = int(np.sqrt(min(horizon, longest) * last))
        if nearer <= LEAST_GROWTH * last:
            return reached
        horizon = nearer


def minimise(
    problem: FreeRunProblem, start: Array, horizon: int | None, effort: tuple[int, float]
) -> Point:
    """Search the smallest error by the Levenberg-Marquardt method, and return the best point. The
    runs restart after every `horizon` samples (None for free runs). A step is rejected if it raises
    the error or if its run diverges. The pair `effort` contains the largest number of iterations,
    and the relative decrease of the error below which the search stops.

    SciPy's trust-region method is not used, because it ends in other minima, which are on average
    not lower.
    """
    point = problem.at(start, horizon)
    damping = DAMPING
    iterations, least_gain = effort
    for _ in range(iterations):
        if not np.isfinite(point.error):
            return point
        curvature, downhill = problem.normal(point, horizon)
        if not (np.isfinite(curvature).all() and np.isfinite(downhill).all()):
            return point
        free = problem.free(point.vector, downhill)
        alike, size = _of_unit_diagonal(curvature[np.ix_(free, free)])
        better = point
        while better is point and damping <= MOST_DAMPING:
            damped = alike + damping * np.eye(len(size))
            move = np.zeros(len(free))
            move[free] = np.linalg.lstsq(damped, downhill[free] / size, rcond=None)[0] / size
            tried = problem.at(point.vector + move, horizon)
            if tried.error < point.error:
                better = tried
                damping = damping / 10
            else:
                damping *= 10
        gained = point.error - better.error
        point = better
        if gained <= least_gain * (point.error + gained):
            return point
    return point


def _of_unit_diagonal(curvature: Array) -> tuple[Array, Array]:
    """Scale the matrix `curvature` so that its diagonal is one. Return the scaled matrix and the
    scale of each coefficient. Scaling is needed because coefficients differ by orders of magnitude.
    """
    size = np.sqrt(np.maximum(np.diag(curvature), np.finfo(np.float64).tiny))
    return curvature / size / size[:, None], size


def free_run_errors(problem: FreeRunProblem, vector: Array) -> tuple[Array, float]:
    """Return the standard errors of the entries of `vector`, shape (k + 1 + m,), and the number of
    independent samples to which the samples are equivalent. Both are computed from the derivatives
    of the outputs and the autocovariance of the residuals.

    All errors are NaN if no degree of freedom is left or a slope is not finite. The standard error
    of a parameter at its bound is NaN too.
    """
    point = problem.at(vector)
    slopes = problem.slopes(point)
    errors = np.full(len(vector), np.nan)
    free = problem.free(vector, problem.downhill(point, slopes))
    if len(point.residuals) <= int(free.sum()) or not np.isfinite(slopes).all():
        return errors, np.nan
    size = np.maximum(np.linalg.norm(slopes[:, free], axis=0), np.finfo(np.float64).tiny)
    ridge = np.concatenate([problem.ridge, np.zeros(len(vector) - len(problem.ridge))])[free]
    lengths = [count for rows in problem.counted if (count := int(rows.sum()))]
    errors_of_free, worth = correlated_errors(
        slopes[:, free] / size, point.residuals, lengths, ridge / size**2
    )
    errors[free] = errors_of_free / size
    return errors, worth
