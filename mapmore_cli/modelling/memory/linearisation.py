"""A run linearised along its trajectory: its derivatives by the coefficients, and the run itself by Newton's method.

With `y[k] = sum_j theta_j phi_j[k]`, the sensitivity to theta_i is `ds_i[k] = phi_i[k] + sum_m (dy[k]/df_m) df_m[k]`, where the fed-back
states f_m are earlier outputs, or follow from them by the slopes of their operators. All samples together are one triangular system of
narrow band, which LAPACK solves for all coefficients at once: no loop over samples.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.linalg.lapack import dtbtrs

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.modelling.expressions import evaluate
from mapmore_cli.modelling.memory.feedback import OUTPUT
from mapmore_cli.modelling.memory.simulation import Course, Trajectory
from mapmore_cli.modelling.program.slopes import recursion_slopes

STEPS = 12  # newton steps after which a run is computed sample by sample instead
EXACT = 1e-11  # of the largest output: a smaller Newton step is the last

Coupling = tuple[int, int, int, Array]
"""Row and column (places among the unknowns of one sample), samples between them, and (n,) the factor."""


class Linearised:
    """A trajectory of `course` with the coefficients `theta`, (k,), and how small changes of it go on.

    - `phi`: (n, k + 1) the terms along the trajectory, and ones for the constant.
    """

    def __init__(self, course: Course, trajectory: Trajectory, theta: Array) -> None:
        self.feedback, self.trajectory, self.theta = course.feedback, trajectory, theta
        self.course = course
        self.inputs, self.n = course.inputs[: len(trajectory.output)], len(trajectory.output)
        self.unknowns = [place for place, node in enumerate(self.feedback.nodes) if node.rule is not None]
        feedback, margin = self.feedback, self.feedback.states.margin
        self.fed = dict(zip(feedback.names, trajectory.nodes[feedback.places], strict=True))
        for name, (low, width) in zip(feedback.names, feedback.limits, strict=bool(feedback.limits)):
            self.fed[name] = np.clip((self.fed[name] - low) / width, -margin, 1 + margin)
        own = [evaluate(part, self.fed, self.n) for part in self.feedback.owns]
        self.phi = np.ones((self.n, len(theta) + 1))
        for j, group in enumerate(self.feedback.groups):
            self.phi[:, j] = self.inputs[:, j] * own[group] if group >= 0 else self.inputs[:, j]

    def sensitivities(self) -> Array:
        """Return derivatives of the outputs by theta and by the constant, (n, k + 1); not finite where the run is unstable."""
        return self.solve(self.phi)

    def solve(self, right: Array) -> Array:
        """Return what becomes of disturbances `right`, (n, p), that enter the output at each sample: (n, p)."""
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
                yield (row, row, number + 1, factor) if past else (row, column, lag + number - rule.own, factor)

    def _past(self, place: int, lag: int) -> Array:
        """Return a node so many samples ago, (n,); measured where that is before the beginning of a stretch."""
        back = np.arange(self.n) - lag
        measured = self.course.history[place, np.maximum(self.course.start + back, 0)]
        return np.asarray(np.where(back >= self.trajectory.begins, self.trajectory.nodes[place, np.maximum(back, 0)], measured))

    def _of_output(self) -> Iterator[Coupling]:
        feedback, margin = self.feedback, self.feedback.states.margin
        factors = {name: np.zeros(self.n) for name in feedback.names}
        for name, group, slope in feedback.slopes:
            terms = feedback.groups == group
            factors[name] += (self.inputs[:, terms] @ self.theta[terms]) * evaluate(slope, self.fed, self.n)
        for place, (name, factor) in enumerate(factors.items()):
            if feedback.limits:
                inside = (self.fed[name] > -margin) & (self.fed[name] < 1 + margin)
                factor = factor * inside / feedback.limits[place][1]
            column, lag = self._reference(feedback.places[place])
            yield len(self.unknowns), column, lag, factor

    def _reference(self, place: int) -> tuple[int, int]:
        """Which unknown a node is, and how many samples ago: delays are not unknowns of their own. The output is the last unknown."""
        nodes, lag = self.feedback.nodes, 0
        while place != OUTPUT and nodes[place].rule is None:
            lag += nodes[place].steps
            place = nodes[place].source
        return (len(self.unknowns) if place == OUTPUT else self.unknowns.index(place)), lag

    def _band(self, couplings: list[Coupling], width: int) -> Array:
        """`I - couplings` by its diagonals; what lies before the beginning of a stretch is measured, and does not move."""
        rows = np.arange(self.n)
        matrix = np.zeros((1 + max(lag * width + row - column for row, column, lag, _ in couplings), self.n * width))
        matrix[0] = 1.0
        for row, column, lag, factor in couplings:
            moves = rows - lag >= self.trajectory.begins
            matrix[lag * width + row - column, (rows[moves] - lag) * width + column] -= factor[moves]
        return matrix


def run_at_once(
    course: Course, theta: Array, constant: float, bounds: tuple[float, float], horizon: int | None, guess: Array | None
) -> Trajectory | None:
    """Return the run of `course.run`, all samples at once by Newton's method from a `guess` (n,), the measured outputs where there is none.

    None where it does not settle within a few steps, leaves the `bounds`, or feeds back operators: then only the way sample by sample is
    left.
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
    """Return the trajectory of outputs `y`: what a delay reaches before the beginning of a stretch is measured."""
    nodes = np.empty((len(course.feedback.nodes), len(y)))
    rows = np.arange(len(y))
    for values, node in zip(nodes, course.feedback.nodes, strict=True):
        back = rows - node.steps
        values[:] = np.where(back >= begins, y[np.maximum(back, 0)], course.measured[course.start + back])
    return Trajectory(y, nodes, begins)
