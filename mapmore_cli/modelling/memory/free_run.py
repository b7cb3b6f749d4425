"""Simulation: a model driven by its inputs and by its own output; one step ahead, by the measured output."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import MemoryModel
from mapmore_cli.modelling.memory.evaluation import evaluate_states
from mapmore_cli.modelling.memory.feedback import Feedback, fed_back
from mapmore_cli.modelling.memory.records import uninterrupted
from mapmore_cli.modelling.memory.resolution import output_lags
from mapmore_cli.modelling.terms import Expression, dictionary_matrix, parse

DIVERGED = 100.0
"""Training ranges by which a free run may leave the training range before it counts as diverged."""


@dataclass(frozen=True)
class Run:
    """Predictions (n,), empty (NaN) before there is history and from a sample at which the run left all bounds to the end of its piece.

    `diverged` are the rows of such samples.
    """

    values: Array
    diverged: tuple[int, ...] = ()


def one_step_ahead(model: MemoryModel, columns: Columns) -> Array:
    """Prediction of every sample from the measured past, (n,); NaN before there is history. Memory starts anew at gaps of `time`."""
    terms = [parse(term) for term in model.terms]
    return np.concatenate([_one_step_ahead(model, terms, piece) for piece in _pieces(model, columns)])


def free_run(model: MemoryModel, columns: Columns) -> Run:
    """Simulation from the first measured outputs; it starts anew at gaps of `time`, and where time runs backwards.

    A model without delayed outputs needs none, and its free run is its one-step-ahead prediction. Otherwise the output must be measured at
    the beginning of every piece, for as many samples as the longest delay; measured outputs after them are not used.

    Parameters
    ----------
    columns
        The model's inputs, (n,) each, in its units; the output where it has a part; `time` in s, without which all samples are one piece.

    Raises
    ------
    DataError
        Where an input or a first output is missing, or samples are not at the model's time steps.
    """
    if not output_lags(model.states, model.output):
        return Run(one_step_ahead(model, columns))
    runs, diverged, begin = [], [], 0
    for piece in _pieces(model, columns):
        run = _free_run(model, piece)
        diverged += [begin + row for row in run.diverged]
        begin += len(run.values)
        runs.append(run.values)
    return Run(np.concatenate(runs), tuple(diverged))


def _pieces(model: MemoryModel, columns: Columns) -> Iterator[Columns]:
    if "time" not in columns:
        yield columns
        return
    for rows in uninterrupted(np.asarray(columns["time"]), model.states.step):
        yield {name: values[rows] for name, values in columns.items()}


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
    if not np.isfinite(history).all():
        raise DataError(
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
