"""Coefficients of least simulation error: Levenberg-Marquardt on free runs, over horizons that grow.

One step ahead, coefficients are biased by the noise of the outputs that they are given. In free run there is none, but the error is no
longer quadratic, and far from its least a run may explode. Runs that begin anew from measured outputs every few samples are nearly as
tame as one step ahead; each horizon starts from the coefficients of the one before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.modelling.memory.linearisation import Linearised, run_at_once
from mapmore_cli.modelling.memory.simulation import Course, Trajectory

FIRST, GROWTH = 16, 8  # samples of the shortest horizon, and how many times longer the next one is
LEAST_GROWTH = 1.2  # where a run over the next horizon explodes a nearer one is tried, down to this many times the last
DAMPING, MOST_DAMPING = 1e-3, 1e8  # Levenberg-Marquardt's factor at the start, and where a step is given up
EMPTY = np.empty(0)
NUDGE = 1e-5  # way, in the search, over which a number of an operator is moved for its difference quotient


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

    - `numbers`: (m,) the operators' numbers that are searched as well, as `Unknown.searched` says.
    - `sse`, `penalty`: sum of squared simulation errors over the counted samples, and what the ridge adds; `runs`: of all pieces.
    """

    theta: Array
    constant: float
    sse: float = np.inf
    penalty: float = 0.0
    runs: tuple[Trajectory, ...] = ()
    numbers: Array = field(default_factory=lambda: EMPTY)

    @property
    def error(self) -> float:
        """What is minimised."""
        return self.sse + self.penalty

    def ordered(self, chosen: Iterable[int], wanted: Iterable[int]) -> Coefficients:
        """Return the coefficients of the terms `chosen`, which these are, in the order `wanted`."""
        places = list(chosen)
        return replace(self, theta=self.theta[[places.index(term) for term in wanted]], runs=())


@dataclass(frozen=True)
class Problem:
    """Simulation error of one set of terms on training samples.

    - `courses`, `counted`: pieces, and (n - start,) the samples of each that count.
    - `bounds`: least and greatest output of a run.
    - `ridge`: (k,) penalty of each squared coefficient.
    - `free_constant`: whether the model has a constant of its own.
    - `moved`: the pieces with other numbers of operators, (m,); `between`: (m, 2) least and greatest of these.
    """

    courses: tuple[Course, ...]
    counted: tuple[BoolArray, ...]
    bounds: tuple[float, float]
    ridge: Array
    free_constant: bool
    moved: Callable[[Array], tuple[Course, ...]] | None = None
    between: Array = field(default_factory=lambda: np.empty((0, 2)))

    @property
    def longest(self) -> int:
        """Samples of the longest run."""
        return max(course.size for course in self.courses)

    @property
    def samples(self) -> int:
        """Number of samples that count."""
        return int(sum(rows.sum() for rows in self.counted))

    def at(self, point: Coefficients, horizon: int | None = None, near: Coefficients | None = None) -> Coefficients:
        """Return the point with its runs and its error; `near` is one whose runs are known to be alike."""
        runs: list[Trajectory] = []
        sse = 0.0
        for place, (course, rows) in enumerate(zip(self.courses_at(point), self.counted, strict=True)):
            guess = None if near is None or not near.runs else near.runs[place].output
            run = run_at_once(course, point.theta, point.constant, self.bounds, horizon, guess)
            runs.append(run or course.run(point.theta, point.constant, self.bounds, horizon))
            if len(runs[-1].output) < course.size:
                return Coefficients(point.theta, point.constant, numbers=point.numbers)
            sse += float(np.sum((course.measured[course.start :] - runs[-1].output)[rows] ** 2))
        return replace(point, sse=sse, penalty=float(self.ridge @ point.theta**2), runs=tuple(runs))

    def courses_at(self, point: Coefficients) -> tuple[Course, ...]:
        """Return the pieces with the operators' numbers of a point."""
        return self.courses if self.moved is None else self.moved(point.numbers)

    def normal(self, point: Coefficients, horizon: int | None = None) -> tuple[Array, Array]:
        """Half the curvature `J'J + ridge` and half the downhill gradient of the error along a point's runs.

        By theta, the constant, and the numbers of operators; the latter by central differences of the run.
        """
        size = len(point.theta) + 1 + len(point.numbers)
        curvature, downhill = np.zeros((size, size)), np.zeros(size)
        by_numbers = [self._by_number(point, place, horizon) for place in range(len(point.numbers))]
        for place, (course, rows, run) in enumerate(zip(self.courses_at(point), self.counted, point.runs, strict=True)):
            own = Linearised(course, run, point.theta).sensitivities()[rows]
            jacobian = np.column_stack([own, *(slopes[place][rows] for slopes in by_numbers)])
            curvature += jacobian.T @ jacobian
            downhill += jacobian.T @ (course.measured[course.start :] - run.output)[rows]
        terms = np.arange(len(point.theta))
        curvature[terms, terms] += self.ridge
        downhill[terms] -= self.ridge * point.theta
        return curvature, downhill

    def _by_number(self, point: Coefficients, place: int, horizon: int | None) -> list[Array]:
        """Return derivatives of all runs by one number of an operator; one-sided at a bound, and where a run to the other side diverges."""
        ends = []
        for way in (NUDGE, -NUDGE):
            numbers = point.numbers.copy()
            numbers[place] = np.clip(numbers[place] + way, *self.between[place])
            found = self.at(replace(point, numbers=numbers), horizon, point)
            ends.append((numbers[place] - point.numbers[place], found.runs) if np.isfinite(found.error) else (0.0, point.runs))
        (up, above), (down, below) = ends
        apart = up - down or np.inf
        return [(one.output - other.output) / apart for one, other in zip(above, below, strict=True)]

    def free(self, point: Coefficients, downhill: Array) -> BoolArray:
        """(k + 1 + m,) what may move: not a number at a bound that the search wants to leave."""
        numbers = downhill[len(point.theta) + 1 :]
        low, high = self.between.T
        held = ((point.numbers <= low) & (numbers < 0)) | ((point.numbers >= high) & (numbers > 0))
        return np.concatenate([np.ones(len(point.theta), dtype=np.bool_), [self.free_constant], ~held])

    def step(self, point: Coefficients, move: Array) -> Coefficients:
        """Return the point moved, numbers within their bounds."""
        k = len(point.theta)
        numbers = np.clip(point.numbers + move[k + 1 :], *self.between.T)
        return Coefficients(point.theta + move[:k], point.constant + float(move[k]), numbers=numbers)


def refine(problem: Problem, start: Coefficients, effort: Effort) -> Coefficients:
    """Return coefficients of least error in free run, searched from `start`; of infinite error where no run on the way stays finite."""
    fed_back = any(course.feedback.owns for course in problem.courses)
    point, last, horizon = start, 0, FIRST if fed_back else problem.longest
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
        curvature, downhill = problem.normal(point, horizon)
        if not (np.isfinite(curvature).all() and np.isfinite(downhill).all()):
            return point
        free = problem.free(point, downhill)
        alike, size = _of_unit_diagonal(curvature[np.ix_(free, free)])
        better = point
        while better is point and damping <= MOST_DAMPING:
            move = np.zeros(len(downhill))
            move[free] = np.linalg.lstsq(alike + damping * np.eye(len(size)), downhill[free] / size, rcond=None)[0] / size
            found = problem.at(problem.step(point, move), horizon, point)
            better, damping = (found, damping / 10) if found.error < point.error else (point, damping * 10)
        gained = point.error - better.error
        point = better
        if gained <= effort.gain * point.error:
            return point
    return point


def _of_unit_diagonal(curvature: Array) -> tuple[Array, Array]:
    """Return the curvature by coefficients that are divided by their sizes, and these: coefficients differ by orders of magnitude."""
    size = np.sqrt(np.maximum(np.diag(curvature), np.finfo(np.float64).tiny))
    return curvature / size / size[:, None], size


def standard_errors(problem: Problem, point: Coefficients) -> tuple[Array, Array]:
    """Return standard errors of theta (k,) and of the operators' numbers (m,), from the curvature of the simulation error.

    NaN without a degree of freedom or a finite curvature, and for a number at its bound.
    """
    point = problem.at(point)
    curvature, downhill = problem.normal(point)
    free = problem.free(point, downhill)
    errors = np.full(len(free), np.nan)
    freedom = problem.samples - int(free.sum())
    if freedom > 0 and np.isfinite(curvature).all():
        alike, size = _of_unit_diagonal(curvature[np.ix_(free, free)])
        spread = np.diag(np.linalg.pinv(alike, hermitian=True)) / size**2
        errors[free] = np.sqrt(np.maximum(spread, 0.0) * point.sse / freedom)
    return errors[: len(point.theta)], errors[len(point.theta) + 1 :]
