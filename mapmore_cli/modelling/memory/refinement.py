"""Coefficients of least simulation error: Levenberg-Marquardt on free runs, over horizons that
grow.

One step ahead, coefficients are biased by the noise of the outputs that they are given. In free run
there is none, but the error is no longer quadratic, and far from its least a run may explode. Runs
that begin anew from measured outputs every few samples are nearly as tame as one step ahead; each
horizon starts from the coefficients of the one before.

With `y[k] = sum_j theta_j phi_j[k]`, the sensitivity to theta_i is `ds_i[k] = phi_i[k] + sum_m
(dy[k]/df_m) df_m[k]`, where the fed-back states f_m are earlier outputs, or follow from them by the
slopes of their operators. All samples together are one triangular system of narrow band, which
LAPACK solves for all coefficients at once: no loop over samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg.lapack import dtbtrs

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.modelling.expressions import evaluate
from mapmore_cli.modelling.memory.feedback import OUTPUT
from mapmore_cli.modelling.memory.simulation import Course, Trajectory
from mapmore_cli.modelling.program.model import recursion_slopes

STEPS = 12  # newton steps after which a run is computed sample by sample instead
EXACT = 1e-11  # of the largest output: a smaller Newton step is the last

Coupling = tuple[int, int, int, Array]
"""Row and column (places among the unknowns of one sample), samples between them, and (n,) the
factor.
"""


class Linearised:
    """A trajectory of `course` with the coefficients `theta`, (k,), and how small changes of it go
    on.

    - `phi`: (n, k + 1) the terms along the trajectory, and ones for the constant.
    """

    def __init__(self, course: Course, trajectory: Trajectory, theta: Array) -> None:
        self.feedback, self.trajectory, self.theta = course.feedback, trajectory, theta
        self.course = course
        self.inputs, self.n = course.inputs[: len(trajectory.output)], len(trajectory.output)
        self.unknowns = [
            place for place, node in enumerate(self.feedback.nodes) if node.rule is not None
        ]
        feedback, margin = self.feedback, self.feedback.states.margin
        self.fed = dict(zip(feedback.names, trajectory.nodes[feedback.places], strict=True))
        for name, (low, width) in zip(
            feedback.names, feedback.limits, strict=bool(feedback.limits)
        ):
            self.fed[name] = np.clip((self.fed[name] - low) / width, -margin, 1 + margin)
        own = [evaluate(part, self.fed, self.n) for part in self.feedback.owns]
        self.phi = np.ones((self.n, len(theta) + 1))
        for j, group in enumerate(self.feedback.groups):
            self.phi[:, j] = self.inputs[:, j] * own[group] if group >= 0 else self.inputs[:, j]

    def solve(self, right: Array) -> Array:
        """Return what becomes of disturbances `right`, (n, p), that enter the output at each
        sample: (n, p).

        Of `phi`, that is the derivatives of the outputs by theta and by the constant; not finite
        where the run is unstable.
        """
        if not self.feedback.owns:
            return right
        width = len(self.unknowns) + 1
        couplings = [*self._of_rules(), *self._of_output()]
        matrix = self._band(couplings, width)
        whole = np.zeros((self.n * width, right.shape[1]), order="F")
        whole[width - 1 :: width] = right
        solution, _ = dtbtrs(matrix, whole, uplo="L", diag="U", overwrite_b=1)
        return np.asarray(solution[width - 1 :: width])

    def _of_rules(self) -> Iterator[Coupling]:
        nodes = self.feedback.nodes
        for row, place in enumerate(self.unknowns):
            rule, source = nodes[place].rule, nodes[place].source
            assert rule is not None
            column, lag = self._reference(source)
            own = [self._past(place, 1 + back) for back in range(rule.own)]
            arguments = [*own, *(self._past(source, back) for back in range(rule.source + 1))]
            for number, slope in enumerate(recursion_slopes(rule, arguments)):
                factor = np.broadcast_to(np.asarray(slope, dtype=np.float64), (self.n,))
                past = number < rule.own
                yield (
                    (row, row, number + 1, factor)
                    if past
                    else (row, column, lag + number - rule.own, factor)
                )

    def _past(self, place: int, lag: int) -> Array:
        return _ago(
            self.trajectory.nodes[place],
            self.course.history[place],
            lag,
            self.course.start,
            self.trajectory.begins,
        )

    def _of_output(self) -> Iterator[Coupling]:
        feedback, margin = self.feedback, self.feedback.states.margin
        factors = {name: np.zeros(self.n) for name in feedback.names}
        for name, group, slope in feedback.slopes:
            terms = feedback.groups == group
            factors[name] += (self.inputs[:, terms] @ self.theta[terms]) * evaluate(
                slope, self.fed, self.n
            )
        for place, (name, factor) in enumerate(factors.items()):
            if feedback.limits:
                inside = (self.fed[name] > -margin) & (self.fed[name] < 1 + margin)
                factor = factor * inside / feedback.limits[place][1]
            column, lag = self._reference(feedback.places[place])
            yield len(self.unknowns), column, lag, factor

    def _reference(self, place: int) -> tuple[int, int]:
        """Which unknown a node is, and how many samples ago: delays are not unknowns of their own.
        The output is the last unknown.
        """
        nodes, lag = self.feedback.nodes, 0
        while place != OUTPUT and nodes[place].rule is None:
            lag += nodes[place].steps
            place = nodes[place].source
        return (len(self.unknowns) if place == OUTPUT else self.unknowns.index(place)), lag

    def _band(self, couplings: list[Coupling], width: int) -> Array:
        """`I - couplings` by its diagonals; what lies before the beginning of a stretch is
        measured, and does not move.
        """
        rows = np.arange(self.n)
        matrix = np.zeros(
            (
                1 + max(lag * width + row - column for row, column, lag, _ in couplings),
                self.n * width,
            )
        )
        matrix[0] = 1.0
        for row, column, lag, factor in couplings:
            moves = rows - lag >= self.trajectory.begins
            matrix[lag * width + row - column, (rows[moves] - lag) * width + column] -= factor[
                moves
            ]
        return matrix


def run_at_once(
    course: Course,
    theta: Array,
    constant: float,
    bounds: tuple[float, float],
    horizon: int | None,
    guess: Array | None,
) -> Trajectory | None:
    """Return the run of `course.run`, all samples at once by Newton's method from a `guess` (n,),
    the measured outputs where there is none.

    None where it does not settle within a few steps, leaves the `bounds`, or feeds back operators:
    then only the way sample by sample is left.
    """
    measured = course.measured[course.start :]
    y = measured if guess is None else guess
    if not (course.feedback.only_delays and np.isfinite(y).all()):
        return None
    begins = course.begins(horizon)
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            line = Linearised(course, _delayed(course, y, begins), theta)
            move = line.solve((line.phi[:, :-1] @ theta + constant - y)[:, None])[:, 0]
            y = y + move
            if not ((y >= bounds[0]) & (y <= bounds[1])).all():
                return None
            if np.abs(move).max(initial=0.0) <= EXACT * np.abs(y).max(initial=0.0):
                return _delayed(course, y, begins)
    return None


def _delayed(course: Course, y: Array, begins: IntArray) -> Trajectory:
    """Return the trajectory of outputs `y`."""
    nodes = [
        _ago(y, course.measured, node.steps, course.start, begins) for node in course.feedback.nodes
    ]
    return Trajectory(y, np.array(nodes).reshape(len(nodes), len(y)), begins)


def _ago(now: Array, measured: Array, lag: int, start: int, begins: IntArray) -> Array:
    """Return values so many samples ago, (n,); measured, from the row `start` on, where that is
    before the beginning of a stretch.
    """
    back = np.arange(len(now)) - lag
    return np.asarray(
        np.where(back >= begins, now[np.maximum(back, 0)], measured[np.maximum(start + back, 0)])
    )


FIRST, GROWTH = 16, 8  # samples of the shortest horizon, and how many times longer the next one is
# where a run over the next horizon explodes a nearer one is tried, down to this many times the last
LEAST_GROWTH = 1.2
DAMPING, MOST_DAMPING = (
    1e-3,
    1e8,
)  # Levenberg-Marquardt's factor at the start, and where a step is given up
EMPTY = np.empty(0)
# way, in the search, over which a number of an operator is moved for its difference quotient
NUDGE = 1e-5


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
    """A point of the search: theta (k,), the constant, and the error there; infinite where a run
    diverges.

    - `numbers`: (m,) the operators' numbers that are searched as well, as `Unknown.searched` says.
    - `sse`, `penalty`: sum of squared simulation errors over the counted samples, and what the
      ridge adds; `runs`: of all pieces.
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
    - `moved`: the pieces with other numbers of operators, (m,); `between`: (m, 2) least and
      greatest of these.
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

    def at(
        self, point: Coefficients, horizon: int | None = None, near: Coefficients | None = None
    ) -> Coefficients:
        """Return the point with its runs and its error; `near` is one whose runs are known to be
        alike.
        """
        runs: list[Trajectory] = []
        sse = 0.0
        for place, (course, rows) in enumerate(
            zip(self.courses_at(point), self.counted, strict=True)
        ):
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
        """Half the curvature `J'J + ridge` and half the downhill gradient of the error along a
        point's runs.

        By theta, the constant, and the numbers of operators; the latter by central differences of
        the run.
        """
        size = len(point.theta) + 1 + len(point.numbers)
        curvature, downhill = np.zeros((size, size)), np.zeros(size)
        by_numbers = [self._by_number(point, place, horizon) for place in range(len(point.numbers))]
        for place, (course, rows, run) in enumerate(
            zip(self.courses_at(point), self.counted, point.runs, strict=True)
        ):
            line = Linearised(course, run, point.theta)
            jacobian = np.column_stack(
                [line.solve(line.phi)[rows], *(slopes[place][rows] for slopes in by_numbers)]
            )
            curvature += jacobian.T @ jacobian
            downhill += jacobian.T @ (course.measured[course.start :] - run.output)[rows]
        terms = np.arange(len(point.theta))
        curvature[terms, terms] += self.ridge
        downhill[terms] -= self.ridge * point.theta
        return curvature, downhill

    def _by_number(self, point: Coefficients, place: int, horizon: int | None) -> list[Array]:
        """Return derivatives of all runs by one number of an operator; one-sided at a bound, and
        where a run to the other side diverges.
        """
        ends = []
        for way in (NUDGE, -NUDGE):
            numbers = point.numbers.copy()
            numbers[place] = np.clip(numbers[place] + way, *self.between[place])
            found = self.at(replace(point, numbers=numbers), horizon, point)
            ends.append(
                (numbers[place] - point.numbers[place], found.runs)
                if np.isfinite(found.error)
                else (0.0, point.runs)
            )
        (up, above), (down, below) = ends
        apart = up - down or np.inf
        return [
            (one.output - other.output) / apart for one, other in zip(above, below, strict=True)
        ]

    def free(self, point: Coefficients, downhill: Array) -> BoolArray:
        """(k + 1 + m,) what may move: not a number at a bound that the search wants to leave."""
        numbers = downhill[len(point.theta) + 1 :]
        low, high = self.between.T
        held = ((point.numbers <= low) & (numbers < 0)) | ((point.numbers >= high) & (numbers > 0))
        return np.concatenate(
            [np.ones(len(point.theta), dtype=np.bool_), [self.free_constant], ~held]
        )

    def step(self, point: Coefficients, move: Array) -> Coefficients:
        """Return the point moved, numbers within their bounds."""
        k = len(point.theta)
        numbers = np.clip(point.numbers + move[k + 1 :], *self.between.T)
        return Coefficients(
            point.theta + move[:k], point.constant + float(move[k]), numbers=numbers
        )


def refine(problem: Problem, start: Coefficients, effort: Effort) -> Coefficients:
    """Return coefficients of least error in free run, searched from `start`; of infinite error
    where no run on the way stays finite.
    """
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


def minimise(
    problem: Problem, start: Coefficients, horizon: int | None, effort: Effort
) -> Coefficients:
    """Levenberg-Marquardt at one horizon (None: free run); steps whose run diverges are refused as
    those are that raise the error.
    """
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
            move[free] = (
                np.linalg.lstsq(
                    alike + damping * np.eye(len(size)), downhill[free] / size, rcond=None
                )[0]
                / size
            )
            found = problem.at(problem.step(point, move), horizon, point)
            better, damping = (
                (found, damping / 10) if found.error < point.error else (point, damping * 10)
            )
        gained = point.error - better.error
        point = better
        if gained <= effort.gain * point.error:
            return point
    return point


def _of_unit_diagonal(curvature: Array) -> tuple[Array, Array]:
    """Return the curvature by coefficients that are divided by their sizes, and these: coefficients
    differ by orders of magnitude.
    """
    size = np.sqrt(np.maximum(np.diag(curvature), np.finfo(np.float64).tiny))
    return curvature / size / size[:, None], size


def standard_errors(problem: Problem, point: Coefficients) -> tuple[Array, Array]:
    """Return standard errors of theta (k,) and of the operators' numbers (m,), from the curvature
    of the simulation error.

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
