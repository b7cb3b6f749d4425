"""Coefficients of least simulation error: Levenberg-Marquardt on free runs, over horizons that grow.

One step ahead, coefficients are biased by the noise of the outputs that they are given. In free run there is none, but the error is no
longer quadratic, and far from its least a run may explode. Runs that begin anew from measured outputs every few samples are nearly as
tame as one step ahead; each horizon starts from the coefficients of the one before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.modelling.memory.linearisation import Linearised, run_at_once
from mapmore_cli.modelling.memory.simulation import Course, Trajectory

FIRST, GROWTH = 16, 8
"""Samples of the shortest horizon, and how many times longer the next one is."""

LEAST_GROWTH = 1.2
"""Where a run over the next horizon explodes a nearer one is tried, down to this many times the last."""

DAMPING, MOST_DAMPING = 1e-3, 1e8
"""Levenberg-Marquardt's factor at the start, and where a step is given up."""


@dataclass(frozen=True)
class Effort:
    """How long to search: iterations at each horizon, and the relative gain of the error at which to stop."""

    iterations: int
    gain: float


THOROUGH = Effort(40, 1e-7)
QUICK = Effort(6, 1e-2)


@dataclass(frozen=True)
class Coefficients:
    """A point of the search: theta (k,), the constant, and the error there; infinite where a run diverges.

    Attributes
    ----------
    sse
        Sum of squared simulation errors over the counted samples.
    penalty
        What the ridge adds.
    runs
        The runs of all pieces.
    """

    theta: Array
    constant: float
    sse: float = np.inf
    penalty: float = 0.0
    runs: tuple[Trajectory, ...] = ()

    @property
    def error(self) -> float:
        """What is minimised."""
        return self.sse + self.penalty


@dataclass(frozen=True)
class Problem:
    """Simulation error of one set of terms on training samples.

    Attributes
    ----------
    courses, counted
        Pieces, and (n - start,) the samples of each that count.
    bounds
        Least and greatest output of a run.
    ridge
        (k,) penalty of each squared coefficient.
    free_constant
        Whether the model has a constant of its own.
    """

    courses: tuple[Course, ...]
    counted: tuple[BoolArray, ...]
    bounds: tuple[float, float]
    ridge: Array
    free_constant: bool

    @property
    def longest(self) -> int:
        """Samples of the longest run."""
        return max(course.size for course in self.courses)

    @property
    def samples(self) -> int:
        """Number of samples that count."""
        return int(sum(rows.sum() for rows in self.counted))

    def at(self, point: Coefficients, horizon: int | None = None, near: Coefficients | None = None) -> Coefficients:
        """The point with its runs and its error; `near` is one whose runs are known to be alike."""
        runs: list[Trajectory] = []
        sse = 0.0
        for place, (course, rows) in enumerate(zip(self.courses, self.counted, strict=True)):
            guess = None if near is None or not near.runs else near.runs[place].output
            run = run_at_once(course, point.theta, point.constant, self.bounds, horizon, guess)
            runs.append(run or course.run(point.theta, point.constant, self.bounds, horizon))
            if len(runs[-1].output) < course.size:
                return Coefficients(point.theta, point.constant)
            sse += float(np.sum((course.measured[course.start :] - runs[-1].output)[rows] ** 2))
        return Coefficients(point.theta, point.constant, sse, float(self.ridge @ point.theta**2), tuple(runs))

    def normal(self, point: Coefficients) -> tuple[Array, Array]:
        """Half the curvature `J'J + ridge` and half the downhill gradient of the error along a point's runs, by theta and the constant."""
        size = len(point.theta) + 1
        curvature, downhill = np.zeros((size, size)), np.zeros(size)
        for course, rows, run in zip(self.courses, self.counted, point.runs, strict=True):
            jacobian = Linearised(course, run, point.theta).sensitivities()[rows]
            curvature += jacobian.T @ jacobian
            downhill += jacobian.T @ (course.measured[course.start :] - run.output)[rows]
        ridge = np.append(self.ridge, 0.0)
        return curvature + np.diag(ridge), downhill - ridge * np.append(point.theta, 0.0)


def refine(problem: Problem, start: Coefficients, effort: Effort) -> Coefficients:
    """The coefficients of least error in free run, searched from `start`; of infinite error where no run along the way stays finite."""
    point, last, horizon = start, 0, FIRST
    while True:
        whole = horizon >= problem.longest
        reached = minimise(problem, point, None if whole else horizon, effort if whole else QUICK)
        if np.isfinite(reached.error):
            if whole:
                return reached
            point, last, horizon = reached, horizon, horizon * GROWTH
            continue
        nearer = int(np.sqrt(min(horizon, problem.longest) * last))
        if nearer < LEAST_GROWTH * last or not last:
            return reached
        horizon = nearer


def minimise(problem: Problem, start: Coefficients, horizon: int | None, effort: Effort) -> Coefficients:
    """Levenberg-Marquardt at one horizon (None: free run); steps whose run diverges are refused as those are that raise the error."""
    point = problem.at(start, horizon)
    damping = DAMPING
    for _ in range(effort.iterations):
        if not np.isfinite(point.error):
            return point
        curvature, downhill = problem.normal(point)
        if not (np.isfinite(curvature).all() and np.isfinite(downhill).all()):
            return point
        better, damping = _step(problem, point, horizon, (curvature, downhill), damping)
        if better is None:
            return point
        gained = point.error - better.error
        point = better
        if gained <= effort.gain * point.error:
            return point
    return point


def _step(
    problem: Problem, point: Coefficients, horizon: int | None, normal: tuple[Array, Array], damping: float
) -> tuple[Coefficients | None, float]:
    """The next point, None where there is no better one; and the damping to go on with."""
    curvature, downhill = normal
    free = slice(None) if problem.free_constant else slice(-1)
    diagonal = np.diag(np.maximum(np.diag(curvature), np.finfo(np.float64).tiny))
    while damping <= MOST_DAMPING:
        move = np.zeros(len(downhill))
        move[free] = np.linalg.lstsq((curvature + damping * diagonal)[free, free], downhill[free], rcond=None)[0]
        found = problem.at(Coefficients(point.theta + move[:-1], point.constant + float(move[-1])), horizon, point)
        if found.error < point.error:
            return found, damping / 10
        damping *= 10
    return None, damping


def standard_errors(problem: Problem, point: Coefficients) -> Array:
    """(k,) standard errors of theta from the curvature of the simulation error; NaN without a degree of freedom or a finite curvature."""
    free = slice(None) if problem.free_constant else slice(-1)
    curvature = problem.normal(problem.at(point))[0][free, free]
    freedom = problem.samples - len(curvature)
    if freedom <= 0 or not np.isfinite(curvature).all():
        return np.full(len(point.theta), np.nan)
    spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(curvature, hermitian=True)), 0.0))
    return np.asarray(spread[: len(point.theta)] * np.sqrt(point.sse / freedom))
