"""Simulation: a model driven by its inputs and by its own output; one step ahead, by the measured output."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, IntArray
from mapmore_cli.domain.memory import MemoryModel
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling.memory.evaluation import evaluate_states
from mapmore_cli.modelling.memory.feedback import Feedback, fed_back
from mapmore_cli.modelling.memory.records import UNEVEN, AtSample, numbered, uninterrupted
from mapmore_cli.modelling.memory.resolution import memory_inputs, output_lags
from mapmore_cli.modelling.terms import Expression, dictionary_matrix, parse

DIVERGED = 100.0
"""Training ranges by which a free run may leave the training range before it counts as diverged."""

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
    """Simulation from the first measured outputs; it starts anew at gaps of `time`, where that runs backwards, and after empty inputs.

    A model without delayed outputs needs none, and its free run is its one-step-ahead prediction. Otherwise the output must be measured at
    the beginning of every piece, for as many samples as the longest delay; measured outputs after them are not used.

    Parameters
    ----------
    columns
        The model's inputs, (n,) each, in its units; the output where it has a part; `time` in s, without which all samples are one piece.

    Raises
    ------
    DataError
        Where an input is missing; as `AtSample` where a first output is, or samples are not at the model's time steps.
    """
    if not output_lags(model.states, model.output):
        return Run(one_step_ahead(model, columns))
    values, diverged = _nothing(columns), list[int]()
    for rows in _pieces(model, columns):
        with numbered(rows):
            run = _free_run(model, _rows_of(model, columns, rows))
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
    """A record with longer steps than the model's would be all gaps."""
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


def _free_run(model: MemoryModel, piece: Columns) -> Run:
    lags = output_lags(model.states, model.output)
    longest = max(lags.values())
    n = len(next(iter(piece.values())))
    nothing = {**piece, model.output: np.full(n, np.nan)}  # what is fed back comes from the run itself
    driven = {name: values for name, values in evaluate_states(model.states, nothing).items() if name not in lags}
    ready = np.logical_and.reduce([np.ones(n, dtype=np.bool_), *(np.isfinite(values) for values in driven.values())])
    start = min(n, max(longest, int(np.argmax(ready)) if ready.any() else n))
    values = np.full(n, np.nan)
    if start == n:
        return Run(values)
    feedback = fed_back(model, lags, {name: values[start:] for name, values in driven.items()}, n - start)
    simulated = _simulated(feedback, _history(model, piece, start, longest), _bounds(model))
    end = start + len(simulated)
    values[start:end] = simulated
    return Run(values, (end,) if end < n else ())


def _history(model: MemoryModel, piece: Columns, start: int, longest: int) -> list[float]:
    """The measured outputs before `start`."""
    if model.output not in piece:
        history = np.full(longest, np.nan)
    else:
        history = np.asarray(piece[model.output][start - longest : start], dtype=np.float64)
    known = np.isfinite(history)
    if not known.all():
        raise AtSample(
            start - longest + int(np.argmin(known)),
            f"{model.output} is missing where a free run begins: the model goes on from measured outputs",
            f"give the column {model.output} with values in the first {start} samples of every recording, and after every gap",
        )
    return history.tolist()


def _bounds(model: MemoryModel) -> tuple[float, float]:
    low, high = model.limits
    reach = DIVERGED * (high - low if high > low else max(abs(high), 1.0))
    return max(low - reach, -sys.float_info.max), min(high + reach, sys.float_info.max)


def _simulated(feedback: Feedback, history: list[float], bounds: tuple[float, float]) -> list[float]:
    """The outputs up to the first that leaves the bounds, which is left out with all after it."""
    low, high = bounds
    past = list(history)
    for k, y in enumerate(feedback.base):
        delayed = feedback.delayed(past)
        for own, weights in zip(feedback.own, feedback.weights, strict=True):
            y += weights[k] * own(delayed)
        if not low <= y <= high:
            break
        past.append(y)
    return past[len(history) :]
