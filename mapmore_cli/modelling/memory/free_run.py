"""Simulate a model in free run, from its inputs and its own earlier outputs, or predict one step
ahead, from measured outputs.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, IntArray, columns_at, joined, row_count
from mapmore_cli.domain.fits import MemoryModel
from mapmore_cli.domain.results import SimulatedRun
from mapmore_cli.modelling.expressions import dictionary_matrix, parse
from mapmore_cli.modelling.memory.feedback import Feedback
from mapmore_cli.modelling.memory.records import AtSample, complete, numbered, uninterrupted
from mapmore_cli.modelling.memory.simulation import (
    ReadyPiece,
    divergence_bounds,
    refuse_unknown_beginning,
)
from mapmore_cli.modelling.memory.states import Past, evaluate_states, memory_inputs
from mapmore_cli.modelling.signals.sampling import UNEVEN


class Along:
    """Prediction of one recording by a model with memory, block after block. Without `ahead`, the
    prediction is a free run, which begins with measured outputs. With `ahead`, every sample is
    predicted one step ahead, from measured outputs.

    The memory restarts at gaps of `time` (s), at steps backwards in time, and after missing inputs.
    A model without delayed outputs needs no measured output, and its free run equals its
    one-step-ahead prediction. A model with delayed outputs needs measured outputs at the beginning
    of every piece, over its longest delay. Its free run does not use later measured outputs.
    """

    def __init__(self, model: MemoryModel, ahead: bool = False) -> None:
        self.model = model
        self.feedback = Feedback(model.terms, model.states, model.output)
        self.ahead = ahead or not self.feedback.names
        self.terms = [parse(term) for term in model.terms]
        self.rows = 0
        self.last: Array = np.empty(0)
        self._begin_anew()

    def _begin_anew(self) -> None:
        """Forget the current piece: its states, its past values, and its first rows, which are kept
        until they are enough for a prediction.
        """
        self.past: Past = {}
        self.recalled: Array | None = None
        self.waiting: Columns = {}
        self.lost = False

    def __call__(self, columns: Columns) -> SimulatedRun:
        """Return the predictions for the n rows of `columns`, (n,). These rows must follow the rows
        of the previous call.

        Raises DataError if an input is missing. Raises AtSample if one of the measured outputs with
        which the memory starts is missing, or if the time steps differ from those of the model.
        """
        values = np.full(row_count(columns), np.nan)
        diverged = list[int]()
        for rows, piece, goes_on in self._pieces(columns, len(values)):
            if not goes_on:
                self._begin_anew()
            if self.ahead:
                values[rows] = self._one_step(piece, len(rows))
            elif not self.lost:
                with numbered(rows):
                    simulated = self._simulated(piece, len(rows))
                values[rows[: len(simulated)]] = simulated
                diverged += rows[len(simulated) :][:1].tolist()
                self.lost = len(simulated) < len(rows)
        self.rows += len(values)
        return SimulatedRun(values, tuple(diverged))

    def _one_step(self, piece: Columns, n: int) -> Array:
        states = evaluate_states(self.model.states, piece, self.past)
        known = complete(states.values(), n)
        predicted = np.full(n, np.nan)
        there = columns_at(states, known)
        matrix = dictionary_matrix(self.terms, there, int(known.sum()))
        predicted[known] = matrix @ self.model.theta + self.model.constant
        return predicted

    def _simulated(self, piece: Columns, n: int) -> Array:
        """Return the free run of a piece, up to the sample at which the output leaves the bounds.
        Rows before the first prediction are NaN.
        """
        if self.waiting:
            piece = {name: np.concatenate([self.waiting[name], x]) for name, x in piece.items()}
        ready = ReadyPiece(self.feedback, piece, self.past)
        if not ready.size:
            self.waiting = piece
            self.past = {}
            return np.full(n, np.nan)
        if self.recalled is None:
            refuse_unknown_beginning(ready)
            self.recalled = ready.recalled_at(0)
        bounds = divergence_bounds(self.model.limits)
        run = ready.run(self.model.theta, self.model.constant, bounds, before=self.recalled)
        whole = np.concatenate([self.recalled, run.values], axis=1)
        self.recalled = whole[:, whole.shape[1] - self.feedback.depth :]
        self.waiting = {}
        return np.concatenate([np.full(ready.start, np.nan), run.output])[-n:]

    def _pieces(self, columns: Columns, n: int) -> Iterator[tuple[IntArray, Columns, bool]]:
        """Yield the uninterrupted pieces of a block. A piece consists of rows with values of all
        inputs, one time step apart. For each piece, yield its row numbers, its columns, and True if
        it may continue the last piece of the previous block.
        """
        inputs = memory_inputs(self.model)
        states = self.model.states
        needed = (columns[name] for name in ("time", *inputs) if name in columns)
        rows = np.flatnonzero(complete(needed, n))
        time: Array = (self.rows + rows).astype(np.float64) * states.step
        if "time" in columns:
            time = np.asarray(columns["time"], dtype=np.float64)[rows]
        before = len(self.last)
        stamps = joined([self.last, time])
        with numbered(np.concatenate([rows[:before], rows])):
            if not self.rows:
                _refuse_other_steps(stamps, rows, states.longest_step)
            parts = uninterrupted(stamps, states.longest_step)
        self.last = stamps[-1:]
        names = [name for name in (*inputs, self.model.output) if name in columns]
        for number, part in enumerate(parts):
            known_rows = rows[max(part.start - before, 0) : part.stop - before]
            if len(known_rows):
                known = {name: np.asarray(columns[name])[known_rows] for name in names}
                yield known_rows, known, number == 0


def _refuse_other_steps(time: Array, rows: IntArray, step: float) -> None:
    """Raise AtSample if most time steps of a recording are longer than the time step of the model,
    because each of them would be a gap, at which the memory restarts. A few such gaps are allowed.
    """
    neighbours = np.flatnonzero(np.diff(rows) == 1)
    longest = step * (1 + UNEVEN)
    distances = np.diff(time)[neighbours]
    if len(distances) < 2:
        return
    if (usual := float(np.quantile(distances, 0.5, method="lower"))) > longest:
        raise AtSample(
            int(neighbours[np.argmax(distances > longest)]) + 1,
            f"{usual:.6g} s after the previous sample, as most samples are, but the model "
            f"was trained with steps of {step:.6g} s, and its memory counts samples",
            f"resample the recording to even steps of {step:.6g} s",
        )
