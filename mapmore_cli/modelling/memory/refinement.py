"""Coefficients of least simulation error: Levenberg-Marquardt on free runs of growing horizons.

One step ahead, coefficients are biased by the noise of the outputs that they are given. In free run
there is none, but the error is no longer quadratic, and far from its least a run may explode. Runs
that begin anew from measured outputs every few samples are nearly as tame as one step ahead; each
horizon starts from the coefficients of the one before.

The sensitivities of a run follow from the derivatives of one sample's statements: a value moves by
what enters it, and by the past values that it is made of. All samples together are one triangular
system of narrow band, which LAPACK solves for all coefficients at once: no loop over samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.lapack import dtbtrs

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.modelling.memory.simulation import ReadyPiece, Trajectory

FIRST, GROWTH = 16, 8  # samples of the shortest horizon, and how many times longer the next one is
# where a run over the next horizon explodes a nearer one is tried, down to this many times the last
LEAST_GROWTH = 1.2
# Levenberg-Marquardt's factor at the start, and where a step is given up
DAMPING, MOST_DAMPING = 1e-3, 1e8
# way, in the search, over which a number of an operator is moved for its difference quotient
NUDGE = 1e-5


def sensitivities(piece: ReadyPiece, run: Trajectory, theta: Array) -> Array:
    """Return the derivatives of the outputs of a run by theta and by the constant, (n, k + 1); not
    finite where the run is unstable.
    """
    feedback, n, q = piece.feedback, len(run.begins), len(piece.history)
    inputs, groups = piece.inputs[:n], feedback.parts.groups
    phi = np.ones((n, len(theta) + 1))
    phi[:, :-1] = inputs
    if not feedback.weights:
        return phi
    known = piece.recalled(run)
    for group, name in enumerate(feedback.weights):
        known[name] = inputs[:, groups == group] @ theta[groups == group]
    with np.errstate(all="ignore"):
        slopes = np.reshape(
            [np.broadcast_to(one, n) for one in feedback.slopes(known, n)], (q, -1, n)
        )
    for group in range(len(feedback.weights)):
        phi[:, :-1][:, groups == group] *= slopes[0, len(feedback.recalls) + group][:, None]
    right = np.zeros((n * q, phi.shape[1]), order="F")
    right[::q] = phi
    solution, _ = dtbtrs(_band(piece, run, slopes), right, uplo="L", diag="U", overwrite_b=1)
    return np.asarray(solution[::q])


def _band(piece: ReadyPiece, run: Trajectory, slopes: Array) -> Array:
    """`I - d(values)/d(past values)` by its diagonals; what lies before the beginning of a stretch
    is measured, and does not move.
    """
    q, _, n = slopes.shape
    recalls, rows = list(piece.feedback.recalls.values()), np.arange(n)
    matrix = np.zeros((max(steps for _, steps in recalls) * q + q, n * q))
    matrix[0] = 1.0
    for place, (column, steps) in enumerate(recalls):
        moves = rows[rows - steps >= run.begins]
        for row in range(q):
            matrix[steps * q + row - column, (moves - steps) * q + column] -= slopes[
                row, place, moves
            ]
    return matrix


@dataclass(frozen=True)
class Effort:
    """How long to search: iterations at each horizon, and the relative gain of the error at which
    to stop.
    """

    iterations: int
    gain: float


THOROUGH = Effort(40, 1e-7)
QUICK = Effort(6, 1e-2)


@dataclass(frozen=True)
class Coefficients:
    """A point of the search.

    - `vector`: (k + 1 + m,) theta, the constant, and the operators' numbers that are searched.
    - `terms`: how many theta there are, k.
    - `error`, `runs`: what is minimised, infinite where a run diverges; the runs of all pieces.
    """

    vector: Array
    terms: int
    error: float = np.inf
    runs: tuple[Trajectory, ...] = ()

    @property
    def theta(self) -> Array:
        """(k,) coefficients of the terms."""
        return self.vector[: self.terms]

    @property
    def constant(self) -> float:
        """The constant."""
        return float(self.vector[self.terms])

    @property
    def numbers(self) -> Array:
        """(m,) numbers of operators, as `Unknown.searched` says."""
        return self.vector[self.terms + 1 :]


@dataclass(frozen=True)
class FreeRunProblem:
    """Simulation error of one set of terms on training samples.

    - `pieces`: the pieces, of the operators' numbers (m,).
    - `counted`: (n,) the samples of each piece that count.
    - `bounds`: least and greatest output of a run.
    - `ridge`: (k,) penalty of each squared coefficient.
    - `free_constant`: whether the model has a constant of its own.
    - `between`: (2, k + 1 + m) least and greatest place of a point.
    """

    pieces: Callable[[Array], tuple[ReadyPiece, ...]]
    counted: tuple[BoolArray, ...]
    bounds: tuple[float, float]
    ridge: Array
    free_constant: bool
    between: Array

    @property
    def longest(self) -> int:
        """Samples of the longest run."""
        return max(map(len, self.counted))

    def at(self, point: Coefficients, horizon: int | None = None) -> Coefficients:
        """Return the point with its runs and its error."""
        runs: list[Trajectory] = []
        for piece in self.pieces(point.numbers):
            runs.append(piece.run(point.theta, point.constant, self.bounds, horizon))
            if len(runs[-1].begins) < piece.size:
                return replace(point, error=np.inf, runs=())
        point = replace(point, runs=tuple(runs))
        error = np.sum(self.errors(point) ** 2) + self.ridge @ point.theta**2
        return replace(point, error=float(error))

    def errors(self, point: Coefficients) -> Array:
        """Return measured less simulated output of all samples that count, (n,)."""
        return np.concatenate(
            [
                (piece.measured[piece.start :] - run.output)[rows]
                for piece, run, rows in zip(
                    self.pieces(point.numbers), point.runs, self.counted, strict=True
                )
            ]
        )

    def normal(self, point: Coefficients, horizon: int | None = None) -> tuple[Array, Array]:
        """Half the curvature `J'J + ridge` and half the downhill gradient of the error along a
        point's runs, by all of its vector.
        """
        by_theta = [
            sensitivities(piece, run, point.theta)[rows]
            for piece, run, rows in zip(
                self.pieces(point.numbers), point.runs, self.counted, strict=True
            )
        ]
        by_numbers = [
            self._by_number(point, place, horizon)
            for place in range(point.terms + 1, len(point.vector))
        ]
        slopes = np.column_stack([np.vstack(by_theta), *by_numbers])
        curvature, downhill = slopes.T @ slopes, slopes.T @ self.errors(point)
        terms = np.arange(point.terms)
        curvature[terms, terms] += self.ridge
        downhill[terms] -= self.ridge * point.theta
        return curvature, downhill

    def _by_number(self, point: Coefficients, place: int, horizon: int | None) -> Array:
        """Return the derivative of the runs by one number of an operator: a central difference,
        one-sided at a bound, and where a run to the other side diverges.
        """
        ends = []
        for way in (NUDGE, -NUDGE):
            moved = self.at(
                self.moved(point, way * (np.arange(len(point.vector)) == place)), horizon
            )
            ends.append(moved if np.isfinite(moved.error) else point)
        apart = ends[0].vector[place] - ends[1].vector[place] or np.inf
        return (self.errors(ends[1]) - self.errors(ends[0])) / apart

    def moved(self, point: Coefficients, move: Array) -> Coefficients:
        """Return the point moved, within its bounds."""
        return Coefficients(np.clip(point.vector + move, *self.between), point.terms)

    def free(self, point: Coefficients, downhill: Array) -> BoolArray:
        """(k + 1 + m,) what may move: not a number at a bound that the search wants to leave."""
        low, high = self.between
        at_low, at_high = point.vector <= low, point.vector >= high
        free: BoolArray = ~((at_low & (downhill < 0)) | (at_high & (downhill > 0)))
        free[point.terms] = self.free_constant
        return free


def refine(problem: FreeRunProblem, start: Coefficients) -> Coefficients:
    """Return coefficients of least error in free run, searched from `start`; of infinite error
    where no run on the way stays finite.
    """
    fed_back = any(piece.feedback.weights for piece in problem.pieces(start.numbers))
    point, last, horizon = start, 0, FIRST if fed_back else problem.longest
    while True:
        whole = horizon >= problem.longest
        reached = (
            minimise(problem, point, None, THOROUGH)
            if whole
            else minimise(problem, point, horizon, QUICK)
        )
        if np.isfinite(reached.error):
            if whole:
                return reached
            point, last, horizon = reached, horizon, horizon * GROWTH
            continue
        nearer = int(np.sqrt(min(horizon, problem.longest) * last))
        if nearer < LEAST_GROWTH * last or not last:
            return reached
        horizon = nearer


def minimise(
    problem: FreeRunProblem, start: Coefficients, horizon: int | None, effort: Effort
) -> Coefficients:
    """Search by Levenberg-Marquardt at one horizon (None: free run); steps whose run diverges are
    refused as those are that raise the error.

    SciPy's trust region ends in other valleys of the error, and no lower ones on the whole.
    """
    point, damping = problem.at(start, horizon), DAMPING
    for _ in range(effort.iterations):
        if not np.isfinite(point.error):
            return point
        curvature, downhill = problem.normal(point, horizon)
        if not (np.isfinite(curvature).all() and np.isfinite(downhill).all()):
            return point
        free = problem.free(point, downhill)
        alike, size = _of_unit_diagonal(curvature[np.ix_(free, free)])
        better = point
        while better is point and damping <= MOST_DAMPING:
            damped = alike + damping * np.eye(len(size))
            move = np.zeros(len(free))
            move[free] = np.linalg.lstsq(damped, downhill[free] / size, rcond=None)[0] / size
            tried = problem.at(problem.moved(point, move), horizon)
            if tried.error < point.error:
                better, damping = tried, damping / 10
            else:
                damping *= 10
        gained, point = point.error - better.error, better
        if gained <= effort.gain * (point.error + gained):
            return point
    return point


def _of_unit_diagonal(curvature: Array) -> tuple[Array, Array]:
    """Return the curvature by coefficients that are divided by their sizes, and these: coefficients
    differ by orders of magnitude.
    """
    size = np.sqrt(np.maximum(np.diag(curvature), np.finfo(np.float64).tiny))
    return curvature / size / size[:, None], size


def errors_of_coefficients(problem: FreeRunProblem, point: Coefficients) -> tuple[Array, Array]:
    """Return standard errors of theta (k,) and of the operators' numbers (m,), from the curvature
    of the simulation error.

    NaN without a degree of freedom or a finite curvature, and for a number at its bound.
    """
    point = problem.at(point)
    curvature, downhill = problem.normal(point)
    free, residuals = problem.free(point, downhill), problem.errors(point)
    errors = np.full(len(free), np.nan)
    freedom = len(residuals) - int(free.sum())
    if freedom > 0 and np.isfinite(curvature).all():
        alike, size = _of_unit_diagonal(curvature[np.ix_(free, free)])
        spread = np.diag(np.linalg.pinv(alike, hermitian=True)) / size**2
        errors[free] = np.sqrt(np.maximum(spread, 0.0) * (residuals @ residuals) / freedom)
    return errors[: point.terms], errors[point.terms + 1 :]
