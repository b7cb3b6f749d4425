"""One uninterrupted piece of a recording, made ready to be simulated many times with other
coefficients.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, IntArray
from mapmore_cli.domain.fits import StateSet
from mapmore_cli.modelling.expressions import evaluate
from mapmore_cli.modelling.expressions.operator import FLOATS, Recursion
from mapmore_cli.modelling.memory.feedback import OUTPUT, Feedback, fed_back_states
from mapmore_cli.modelling.memory.records import AtSample, complete
from mapmore_cli.modelling.memory.states import evaluate_states, value_of

# training ranges by which a free run may leave the training range before it counts as diverged
DIVERGED = 100.0


@dataclass(frozen=True)
class Trajectory:
    """A run from row `start` of a piece on, and where in it the run began anew.

    - `output`: (n,) simulated outputs; fewer than the rest of the piece where the run left all
      bounds.
    - `nodes`: (nodes, n) unscaled values of the fed-back states and of what they are made of.
    - `begins`: (n,) the row, counted from `start`, at which the stretch of each sample began.
    """

    output: Array
    nodes: Array
    begins: IntArray


@dataclass(frozen=True)
class Piece:
    """One piece of n rows with what does not depend on the choice of terms.

    - `measured`: (n,) output; NaN where it is not known.
    - `driven`: (n,) each, the states of inputs alone, scaled as the model's are.
    - `known`: fed-back states along the measured output that were computed already.
    """

    measured: Array
    driven: Columns
    known: dict[str, Array]


def piece_of(states: StateSet, output: str, columns: Columns) -> Piece:
    """Prepare one piece; `columns` hold the inputs, and the output where it is known.

    Raises DataError where an input is missing.
    """
    n = len(next(iter(columns.values())))
    measured = np.asarray(columns.get(output, np.full(n, np.nan)), dtype=np.float64)
    fed_back = fed_back_states(states, output)
    values = evaluate_states(states, {**columns, output: np.full(n, np.nan)})
    return Piece(
        measured, {name: column for name, column in values.items() if name not in fed_back}, {}
    )


class Course:
    """A piece made ready for one set of terms: its n rows up to `end`, of which the rows from
    `start` on can be simulated.

    It starts where every state of inputs has a value, after the longest delay.

    - `inputs`: (n - start, k) input parts of the terms.
    - `measured`: (n,) output; NaN where it is not known.
    - `history`: (nodes, n) the fed-back states and what they are made of along the measured output,
      at rest before.
    """

    def __init__(self, feedback: Feedback, piece: Piece, end: int | None = None) -> None:
        self.feedback, self.measured = feedback, piece.measured[:end]
        n = len(self.measured)
        driven = {
            name: piece.driven[name][:end]
            for name in feedback.states.names
            if name not in feedback.names
        }
        ready = complete(driven.values(), n)
        self.start = min(n, max(feedback.longest, int(np.argmax(ready)) if ready.any() else n))
        self.size = n - self.start
        rows = {name: values[self.start :] for name, values in driven.items()}
        self.inputs = np.empty((self.size, len(feedback.inputs)), order="F")
        for column, part in zip(self.inputs.T, feedback.inputs, strict=True):
            column[:] = evaluate(part, rows, self.size)
        self.history = np.empty((len(feedback.nodes), n))
        for row, node in zip(self.history, feedback.nodes, strict=True):
            values = value_of(
                node.state, {feedback.output: piece.measured}, feedback.states, piece.known
            )
            first = int(np.argmax(np.isfinite(values))) if len(values) else 0
            row[:] = values[:n]
            row[:first] = values[first : first + 1]  # each begins at rest

    @cached_property
    def restarts(self) -> BoolArray:
        """(n - start,) whether a run may begin anew at a sample: everything before it is known."""
        depth = self.feedback.depth
        known = np.isfinite(self.measured) & np.isfinite(self.history).all(axis=0)
        back = np.concatenate([[0], np.cumsum(~known)])
        rows = np.arange(self.start, self.start + self.size)
        return np.asarray(back[rows] == back[np.maximum(rows - depth, 0)])

    def begins(self, horizon: int | None) -> IntArray:
        """(n - start,) the row, counted from `start`, at which the stretch of each sample begins; a
        single one without a `horizon`.
        """
        rows = np.arange(self.size)
        if horizon is None:
            return np.zeros_like(rows)
        return np.asarray(
            np.maximum.accumulate(np.where((rows % horizon == 0) & self.restarts, rows, 0))
        )

    def run(
        self, theta: Array, constant: float, bounds: tuple[float, float], horizon: int | None = None
    ) -> Trajectory:
        """Simulate with the coefficients `theta` (k,), beginning anew from measured outputs after
        every `horizon` samples.

        It ends at the first sample that leaves the `bounds`, which is left out.
        """
        groups = self.feedback.groups
        weighted = self.inputs * theta
        base = (constant + weighted[:, groups < 0].sum(axis=1)).tolist()
        weights = [
            weighted[:, groups == group].sum(axis=1).tolist()
            for group in range(len(self.feedback.owns))
        ]
        begins = self.begins(horizon)
        output, nodes = np.empty(self.size), np.empty((len(self.feedback.nodes), self.size))
        done = 0
        for begin, end in pairwise([*np.unique(begins).tolist(), self.size]):
            y, states = self._stretch(begin, end, base, weights, bounds)
            done = begin + len(y)
            output[begin:done], nodes[:, begin:done] = y, states
            if done < end:
                break
        return Trajectory(output[:done], nodes[:, :done], begins[:done])

    def _stretch(
        self,
        begin: int,
        end: int,
        base: list[float],
        weights: list[list[float]],
        bounds: tuple[float, float],
    ) -> tuple[Array, Array]:
        """Return outputs and nodes of the samples from `begin` up to `end`, or up to the first that
        leaves the bounds.
        """
        feedback, depth = self.feedback, self.feedback.depth
        past = np.maximum(np.arange(-depth, 0) + self.start + begin, 0)  # at rest before row 0
        outputs = self.measured[past]
        first = int(np.argmax(np.isfinite(outputs)))
        outputs[:first] = outputs[first]
        y = outputs.tolist()
        places, advance = _wired(feedback, self.history[:, past], y)
        fed, owns = [places[place] for place in feedback.places], feedback.functions
        limits, least, greatest = (
            feedback.limits,
            -feedback.states.margin,
            1 + feedback.states.margin,
        )
        low, high = bounds
        with np.errstate(all="ignore"):
            for k in range(begin, end):
                for step in advance:
                    step()
                now = [values[-back] for values, back in fed]
                if limits:
                    now = [
                        min(max((x - foot) / width, least), greatest)
                        for x, (foot, width) in zip(now, limits, strict=True)
                    ]
                value = base[k]
                for own, weight in zip(owns, weights, strict=True):
                    value += weight[k] * own(now)
                if not low <= value <= high:
                    break
                y.append(value)
        count = len(y) - depth
        firsts = [depth - back + (values is not y) for values, back in places]
        states = [
            values[first : first + count] for first, (values, _) in zip(firsts, places, strict=True)
        ]
        return np.array(y[depth:]), np.array(states).reshape(len(places), count)


Read = tuple[
    list[float], int
]  # values, and how far from their end the present one stands: delays need no list of their own


def _wired(
    feedback: Feedback, history: Array, y: list[float]
) -> tuple[list[Read], list[Callable[[], None]]]:
    """Where each node is read, and what appends the next value of those with a rule, in order; the
    outputs `y` end at the sample before.
    """
    reads: list[Read] = []
    advance: list[Callable[[], None]] = []
    for node, before in zip(feedback.nodes, history, strict=True):
        values, back = (y, 0) if node.source == OUTPUT else reads[node.source]
        if node.rule is None:
            reads.append((values, back + node.steps))
        else:
            reads.append((before.tolist(), 1))
            advance.append(_advanced(node.rule, reads[-1][0], values, back))
    return reads, advance


def _advanced(
    rule: Recursion, own: list[float], source: list[float], back: int
) -> Callable[[], None]:
    """Return what appends the next value of an operator to its `own` ones; the present value of its
    source stands `back` from the end.
    """
    following = partial(rule.next, FLOATS)
    if (rule.own, rule.source) == (1, 0):
        return lambda: own.append(following(own[-1], source[-back]))
    if (rule.own, rule.source) == (1, 1):
        return lambda: own.append(following(own[-1], source[-back], source[-back - 1]))
    return lambda: own.append(
        following(
            *[own[-i - 1] for i in range(rule.own)],
            *[source[-back - i] for i in range(rule.source + 1)],
        )
    )


def refuse_unknown_beginning(course: Course) -> None:
    """Raise AtSample where a measured output that the run begins with is missing."""
    first = course.start - course.feedback.longest
    known = np.isfinite(course.measured[first : course.start])
    if course.size and not known.all():
        output = course.feedback.output
        raise AtSample(
            first + int(np.argmin(known)),
            f"{output} is missing where a free run begins: the model goes on from measured outputs",
            f"give the column {output} with values in the first {course.start} samples of "
            "every recording, and after every gap",
        )


def bounds_of(limits: tuple[float, float]) -> tuple[float, float]:
    """Least and greatest output that a run may have, from the training range."""
    low, high = limits
    reach = DIVERGED * (high - low if high > low else max(abs(high), 1.0))
    return max(low - reach, -sys.float_info.max), min(high + reach, sys.float_info.max)
