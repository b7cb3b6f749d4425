"""Simulation: a model driven by its inputs and by its own output; one step ahead, by the measured output."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, IntArray
from mapmore_cli.domain.fits import MemoryModel
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling.expressions import Expression, dictionary_matrix, parse
from mapmore_cli.modelling.memory.feedback import Feedback, feedback_of
from mapmore_cli.modelling.memory.records import AtSample, numbered, uninterrupted
from mapmore_cli.modelling.memory.simulation import bounds_of, piece_of, refuse_unknown_beginning
from mapmore_cli.modelling.memory.starts import begun
from mapmore_cli.modelling.memory.states import evaluate_states, memory_inputs
from mapmore_cli.modelling.signals.sampling import UNEVEN

FEW = 2
"""Samples up to which a longer step is taken for a gap."""


def one_step_ahead(model: MemoryModel, columns: Columns) -> Array:
    """Prediction of every sample from the measured past, (n,); NaN before there is history. Memory starts anew where `free_run`'s does."""
    terms = [parse(term) for term in model.terms]
    values = _nothing(columns)
    for rows in _pieces(model, columns):
        values[rows] = _one_step_ahead(model, terms, _rows_of(model, columns, rows))
    return values


def free_run(model: MemoryModel, columns: Columns) -> Run:
    """Return simulation from the first outputs, as the model's `start` says.

    It starts anew at gaps of `time`, where that runs backwards, and after empty inputs. A model without delayed outputs needs none, and its
    free run is its one-step-ahead prediction. Otherwise the output must be measured at the beginning of every piece, for as many samples as
    the longest delay (over a twentieth of it to identify them; not for a steady start); measured outputs after them are not used.

    - `columns`: the model's inputs, (n,) each, in its units; the output where it has a part; `time` in s, without which all samples are one
      piece.

    Raises DataError where an input is missing; as `AtSample` where a first output is, or samples are not at the model's time steps.
    """
    feedback = feedback_of(model.terms, model.states, model.output)
    if not feedback.names:
        return Run(one_step_ahead(model, columns))
    values, diverged = _nothing(columns), list[int]()
    for rows in _pieces(model, columns):
        with numbered(rows):
            run = _free_run(model, feedback, _rows_of(model, columns, rows))
        values[rows] = run.values
        diverged += [int(rows[row]) for row in run.diverged]
    return Run(values, tuple(diverged))


def _nothing(columns: Columns) -> Array:
    return np.full(len(next(iter(columns.values()))), np.nan)


def _rows_of(model: MemoryModel, columns: Columns, rows: IntArray) -> Columns:
    return {name: np.asarray(columns[name])[rows] for name in (*memory_inputs(model), model.output) if name in columns}


def _pieces(model: MemoryModel, columns: Columns) -> Iterator[IntArray]:
    """Row numbers of the pieces within which memory lasts: rows with all inputs, one step apart."""
    needed = [name for name in ("time", *memory_inputs(model)) if name in columns]
    complete = np.logical_and.reduce([np.ones(len(_nothing(columns)), dtype=np.bool_), *(np.isfinite(columns[name]) for name in needed)])
    rows = np.flatnonzero(complete)
    time = np.asarray(columns["time"], dtype=np.float64)[rows] if "time" in columns else rows.astype(np.float64) * model.states.step
    with numbered(rows):
        _refuse_other_steps(time, model.states.step)
        parts = uninterrupted(time, model.states.step)
    yield from (rows[part] for part in parts if len(rows[part]))


def _refuse_other_steps(time: Array, step: float) -> None:
    """Refuse a record with longer steps than the model's, which would be all gaps."""
    usual = float(np.median(np.diff(time))) if len(time) > FEW else step
    if usual > step * (1 + UNEVEN):
        raise AtSample(
            int(np.argmax(np.diff(time) > step * (1 + UNEVEN))) + 1,
            f"{usual:.6g} s after the one before, as most are; those that the model was trained on are {step:.6g} s apart, and its memory "
            "counts samples",
            f"bring the recording onto even steps of {step:.6g} s",
        )


def _one_step_ahead(model: MemoryModel, terms: Sequence[Expression], piece: Columns) -> Array:
    states = evaluate_states(model.states, piece)
    n = len(next(iter(piece.values())))
    known = np.logical_and.reduce([np.ones(n, dtype=np.bool_), *(np.isfinite(values) for values in states.values())])
    values = np.full(n, np.nan)
    rows = {name: column[known] for name, column in states.items()}
    values[known] = dictionary_matrix(terms, rows, int(known.sum())) @ model.theta + model.constant
    return values


def _free_run(model: MemoryModel, feedback: Feedback, piece: Columns) -> Run:
    course = begun(model, feedback, piece_of(model.states, model.output, piece))
    refuse_unknown_beginning(course)
    simulated = course.run(model.theta, model.constant, bounds_of(model.limits)).output
    values = np.full(course.start + course.size, np.nan)
    end = course.start + len(simulated)
    values[course.start : end] = simulated
    return Run(values, (end,) if end < len(values) else ())
