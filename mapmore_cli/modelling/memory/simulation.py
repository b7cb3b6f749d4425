"""Prepare an uninterrupted piece of a recording, so that it can be simulated many times with
different coefficients.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, Ends, IntArray, Value, row_count
from mapmore_cli.modelling.expressions import evaluate
from mapmore_cli.modelling.memory.feedback import Feedback
from mapmore_cli.modelling.memory.records import AtSample, complete
from mapmore_cli.modelling.memory.states import Past, evaluate_states, value_of

# a free run has diverged if it leaves the training range by more than this multiple of the range
DIVERGED = 100.0


@dataclass(frozen=True)
class Trajectory:
    """A simulated run, and the samples at which it was restarted from measured outputs.

    - `values`: (q, n) the output, and all other values that are needed at later samples. If the run
      diverged, n is smaller than the number of samples in the piece.
    - `begins`: (n,) for each sample, the sample at which its run was last restarted.
    """

    values: Array
    begins: IntArray

    @property
    def output(self) -> Array:
        """Simulated outputs, (n,)."""
        return np.asarray(self.values[0])


class ReadyPiece:
    """A piece of a recording, prepared for one set of terms. The n samples begin at the row
    `start`, the first row at which all states of inputs and all delayed outputs have values.

    - `inputs`: (n, k) for each of the k terms, the factor that depends only on inputs.
    - `measured`: (start + n,) output; NaN if it is unknown.
    - `history`: (q, start + n) values that are needed at later samples, computed from the measured
      output. In the rows before the first known value, this value is repeated.
    - `past`: the last values of the states in an earlier piece, if this piece continues it.
    """

    def __init__(self, feedback: Feedback, columns: Columns, past: Past | None = None) -> None:
        self.feedback = feedback
        rows = row_count(columns)
        nothing = np.full(rows, np.nan)
        self.measured = np.asarray(columns.get(feedback.output, nothing), dtype=np.float64)
        goes_on = bool(past)
        driven = evaluate_states(feedback.states, {**columns, feedback.output: nothing}, past)
        for name in feedback.names:
            del driven[name]
        ready = complete(driven.values(), rows)
        first = int(np.argmax(ready)) if ready.any() else rows
        self.start = 0 if goes_on else min(rows, max(feedback.longest, first))
        self.size = rows - self.start
        driven = {name: values[self.start :] for name, values in driven.items()}
        self.inputs = np.empty((self.size, len(feedback.parts.inputs)), order="F")
        for column, part in zip(self.inputs.T, feedback.parts.inputs, strict=True):
            column[:] = evaluate(part, driven, self.size)
        self.history = np.empty((len(feedback.queues), rows))
        known: dict[str, Array] = {}
        for row, queue in zip(self.history, feedback.queues, strict=True):
            row[:] = value_of(queue, {feedback.output: self.measured}, feedback.states, known)
            first = int(np.argmax(np.isfinite(row))) if rows else 0
            row[:first] = row[first : first + 1]

    @cached_property
    def restarts(self) -> BoolArray:
        """Mask of the samples at which a run may restart, (n,). All earlier values that the run
        needs are known at these samples.
        """
        known = np.isfinite(self.measured) & np.isfinite(self.history).all(axis=0)
        back = np.concatenate([[0], np.cumsum(~known)])
        rows = np.arange(self.start, self.start + self.size)
        return np.asarray(back[rows] == back[np.maximum(rows - self.feedback.depth, 0)])

    def begins(self, horizon: int | None) -> IntArray:
        """Return, for each sample, the sample at which the run was last restarted, (n,). Without a
        `horizon`, a run is never restarted.
        """
        rows = np.arange(self.size)
        if horizon is None:
            return np.zeros_like(rows)
        return np.maximum.accumulate(np.where((rows % horizon == 0) & self.restarts, rows, 0))

    def run(
        self,
        theta: Array,
        constant: float,
        bounds: Ends,
        horizon: int | None = None,
        before: Array | None = None,
    ) -> Trajectory:
        """Simulate with the coefficients `theta`, (k,), restarting from measured outputs after
        every `horizon` samples. If the piece continues another piece, `before`, (q, depth), holds
        the last values of that piece.

        The run ends before the first sample whose output lies outside the `bounds`.
        """
        feedback, (low, high), weighted = self.feedback, bounds, self.inputs * theta
        groups = feedback.parts.groups
        sums = {
            name: weighted[:, groups == group].sum(axis=1)
            for group, name in enumerate(feedback.weights)
        }
        sums["base"] = constant + weighted[:, groups < 0].sum(axis=1)
        driven = [(name, column.tolist()) for name, column in sums.items()]
        begins = self.begins(horizon)
        done = 0
        parts = [np.empty((len(self.history), 0))]
        for begin, end in pairwise([*np.unique(begins).tolist(), self.size]):
            queues = (self.recalled_at(begin) if before is None else before).tolist()
            recalls = [
                (name, queues[place], -steps) for name, (place, steps) in feedback.recalls.items()
            ]
            with np.errstate(all="ignore"):
                for k in range(begin, end):
                    known: dict[str, Any] = {name: queue[back] for name, queue, back in recalls}
                    known.update([(name, column[k]) for name, column in driven])
                    values = feedback.step(known, 1)
                    if not low <= values[0] <= high:
                        break
                    for queue, value in zip(queues, values, strict=True):
                        queue.append(value)
            parts.append(np.array(queues)[:, feedback.depth :])
            done += parts[-1].shape[1]
            if done < end:
                break
        return Trajectory(np.concatenate(parts, axis=1), begins[:done])

    def recalled_at(self, sample: int) -> Array:
        """Return the last `depth` values of each queue before a sample, shape (q, depth). They are
        computed from the measured output.
        """
        back = np.arange(-self.feedback.depth, 0) + self.start + sample
        return self.history[:, np.maximum(back, 0)]

    def recalled(self, trajectory: Trajectory) -> dict[str, Value]:
        """Return every past value that a run needs, shape (n,) each, by name. Values from before
        the last restart are computed from measured outputs.
        """
        rows = np.arange(len(trajectory.begins))
        begins = trajectory.begins
        columns: dict[str, Value] = {}
        for name, (place, steps) in self.feedback.recalls.items():
            back = rows - steps
            columns[name] = np.where(
                back >= begins,
                trajectory.values[place][np.maximum(back, 0)],
                self.history[place][np.maximum(self.start + back, 0)],
            )
        return columns


def refuse_unknown_beginning(piece: ReadyPiece) -> None:
    """Raise AtSample if a measured output from which the run starts is missing."""
    first = piece.start - piece.feedback.longest
    known = np.isfinite(piece.measured[first : piece.start])
    if piece.size and not known.all():
        output = piece.feedback.output
        raise AtSample(
            first + int(np.argmin(known)),
            f"{output} is missing at the start of a run, where the model must know measured "
            "outputs before it uses its own predictions",
            f"give the column {output} values in the first {piece.start} samples of every "
            "recording, and after every gap",
        )


def divergence_bounds(limits: Ends) -> Ends:
    """Return the smallest and the largest output that a run may reach; beyond them, it has
    diverged. `limits` is the training range of the output.
    """
    low, high = limits
    reach = DIVERGED * (high - low if high > low else max(abs(high), 1.0))
    return max(low - reach, -sys.float_info.max), min(high + reach, sys.float_info.max)
