"""Simulation: a model driven by its inputs and by its own output, from first outputs; one step
ahead, by the measured output.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, IntArray
from mapmore_cli.domain.fits import MemoryModel
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling.expressions import dictionary_matrix, parse
from mapmore_cli.modelling.memory.feedback import Feedback
from mapmore_cli.modelling.memory.records import AtSample, complete, numbered, uninterrupted
from mapmore_cli.modelling.memory.simulation import (
    ReadyPiece,
    bounds_of,
    refuse_unknown_beginning,
)
from mapmore_cli.modelling.memory.states import evaluate_states, memory_inputs
from mapmore_cli.modelling.signals.sampling import UNEVEN


def predict_one_step(model: MemoryModel, columns: Columns) -> Array:
    """Prediction of every sample from the measured past, (n,); NaN before there is history. Memory
    starts anew where `free_run`'s does.
    """
    terms = [parse(term) for term in model.terms]
    predicted = _nothing(columns)
    for rows, piece in _uninterrupted_rows(model, columns):
        states = evaluate_states(model.states, piece)
        known = complete(states.values(), len(rows))
        matrix = dictionary_matrix(
            terms, {name: values[known] for name, values in states.items()}, int(known.sum())
        )
        predicted[rows[known]] = matrix @ model.theta + model.constant
    return predicted


def free_run(model: MemoryModel, columns: Columns) -> Run:
    """Return simulation from the first measured outputs; `columns`, (n,) each, as for
    `kinds.simulate`.

    It starts anew at gaps of `time` (s), where that runs backwards, and after empty inputs. A model
    without delayed outputs needs none: its free run is its one-step-ahead prediction. Otherwise the
    output must be measured at the beginning of every piece, over the longest delay; measured
    outputs after that are not used.

    Raises DataError where an input is missing; as `AtSample` where a first output is, or samples
    are not at the model's time steps.
    """
    feedback = Feedback(model.terms, model.states, model.output)
    if not feedback.names:
        return Run(predict_one_step(model, columns))
    values, diverged = _nothing(columns), list[int]()
    for rows, piece in _uninterrupted_rows(model, columns):
        with numbered(rows):
            ready = ReadyPiece(feedback, piece)
            refuse_unknown_beginning(ready)
        simulated = ready.run(model.theta, model.constant, bounds_of(model.limits)).output
        end = ready.start + len(simulated)
        values[rows[ready.start : end]] = simulated
        diverged += rows[end : end + 1].tolist()
    return Run(values, tuple(diverged))


def _nothing(columns: Columns) -> Array:
    return np.full(len(next(iter(columns.values()))), np.nan)


def _uninterrupted_rows(model: MemoryModel, columns: Columns) -> Iterator[tuple[IntArray, Columns]]:
    """Yield row numbers and columns of the pieces within which memory lasts: rows with all inputs,
    one step apart.
    """
    inputs, step = memory_inputs(model), model.states.step
    rows = np.flatnonzero(
        complete(
            (columns[name] for name in ("time", *inputs) if name in columns), len(_nothing(columns))
        )
    )
    time = (
        np.asarray(columns["time"], dtype=np.float64)[rows]
        if "time" in columns
        else rows.astype(np.float64) * step
    )
    with numbered(rows):
        _refuse_other_steps(time, step)
        parts = [rows[part] for part in uninterrupted(time, step)]
    given = {name: np.asarray(columns[name]) for name in (*inputs, model.output) if name in columns}
    yield from (
        (part, {name: column[part] for name, column in given.items()})
        for part in parts
        if len(part)
    )


def _refuse_other_steps(time: Array, step: float) -> None:
    """Refuse a record with longer steps than the model's, which would be all gaps; a longer step
    between two samples is taken for a gap.
    """
    distances, longest = np.diff(time), step * (1 + UNEVEN)
    if len(distances) > 1 and (usual := float(np.median(distances))) > longest:
        raise AtSample(
            int(np.argmax(distances > longest)) + 1,
            f"{usual:.6g} s after the one before, as most are; the model was trained on steps "
            f"of {step:.6g} s: its memory counts samples",
            f"bring the recording onto even steps of {step:.6g} s",
        )
