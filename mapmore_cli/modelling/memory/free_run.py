"""Simulation: a model driven by its inputs and by its own output, from first outputs; one step
ahead, by the measured output.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import MemoryModel
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling.expressions import dictionary_matrix, parse
from mapmore_cli.modelling.memory.feedback import Feedback
from mapmore_cli.modelling.memory.records import AtSample, complete, numbered, uninterrupted
from mapmore_cli.modelling.memory.simulation import (
    Course,
    Piece,
    bounds_of,
    piece_of,
    refuse_unknown_beginning,
)
from mapmore_cli.modelling.memory.states import evaluate_states, memory_inputs
from mapmore_cli.modelling.signals.sampling import UNEVEN

FEW = 2  # samples up to which a longer step is taken for a gap


def one_step_ahead(model: MemoryModel, columns: Columns) -> Array:
    """Prediction of every sample from the measured past, (n,); NaN before there is history. Memory
    starts anew where `free_run`'s does.
    """
    terms = [parse(term) for term in model.terms]
    predicted = _nothing(columns)
    for rows, piece in _pieces(model, columns):
        states = evaluate_states(model.states, piece)
        known = complete(states.values(), len(rows))
        matrix = dictionary_matrix(
            terms, {name: values[known] for name, values in states.items()}, int(known.sum())
        )
        predicted[rows[known]] = matrix @ model.theta + model.constant
    return predicted


def free_run(model: MemoryModel, columns: Columns) -> Run:
    """Return simulation from the first outputs, as the model's `start` says; `columns`, (n,) each,
    as for `kinds.simulate`.

    It starts anew at gaps of `time` (s), where that runs backwards, and after empty inputs. A model
    without delayed outputs needs none: its free run is its one-step-ahead prediction. Otherwise the
    output must be measured at the beginning of every piece, over the longest delay (over a
    twentieth of the piece to identify them; not for a steady start); measured outputs after that
    are not used.

    Raises DataError where an input is missing; as `AtSample` where a first output is, or samples
    are not at the model's time steps.
    """
    feedback = Feedback(model.terms, model.states, model.output)
    if not feedback.names:
        return Run(one_step_ahead(model, columns))
    values, diverged = _nothing(columns), list[int]()
    for rows, piece in _pieces(model, columns):
        with numbered(rows):
            course = _Beginning(
                model, feedback, piece_of(model.states, model.output, piece)
            ).begun()
            refuse_unknown_beginning(course)
        simulated = _outputs(model, course)
        end = course.start + len(simulated)
        values[rows[course.start : end]] = simulated
        diverged += rows[end : end + 1].tolist()
    return Run(values, tuple(diverged))


def _nothing(columns: Columns) -> Array:
    return np.full(len(next(iter(columns.values()))), np.nan)


def _pieces(model: MemoryModel, columns: Columns) -> Iterator[tuple[IntArray, Columns]]:
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
    """Refuse a record with longer steps than the model's, which would be all gaps."""
    usual, longest = (
        float(np.median(np.diff(time))) if len(time) > FEW else step,
        step * (1 + UNEVEN),
    )
    if usual > longest:
        raise AtSample(
            int(np.argmax(np.diff(time) > longest)) + 1,
            f"{usual:.6g} s after the one before, as most are; the model was trained on steps "
            f"of {step:.6g} s: its memory counts samples",
            f"bring the recording onto even steps of {step:.6g} s",
        )


def _outputs(model: MemoryModel, course: Course) -> Array:
    return course.run(model.theta, model.constant, bounds_of(model.limits)).output


# How a run begins
# --------------------------------------------------------------------------------------------------

# share of a run over which first outputs are identified, and errors of the beginning are told
FIRST = 0.05
STEPS = 60  # steps of a search for the first outputs
SETTLED = 1e-12  # of the training range: a smaller step is the last
NUDGE = 1e-6  # of the training range, over which an output is moved for a difference quotient


def started(model: MemoryModel) -> str:
    """Say how free runs of a model begin, in a sentence."""
    return {
        "measured": "Free runs begin with measured outputs.",
        "steady": (
            "Free runs begin at the steady output of the first inputs; no measured output is used."
        ),
        "identified": (
            "The first outputs of a free run are those of which it errs least over its first "
            f"{FIRST:.0%}."
        ),
    }[model.start]


class _Beginning:
    """A piece whose run may begin with other outputs than the measured ones; `width` is the
    training range of the output.
    """

    def __init__(self, model: MemoryModel, feedback: Feedback, piece: Piece) -> None:
        self.model, self.piece, self.course = model, piece, Course(feedback, piece)
        self.width = model.limits[1] - model.limits[0] or 1.0

    def begun(self) -> Course:
        """Return the piece ready to be run, with the first outputs as the model's `start` says."""
        if self.model.start == "measured" or not self.course.size:
            return self.course
        return self.steady() if self.model.start == "steady" else self.identified()

    def with_first(self, first: Array, end: int | None = None) -> Course:
        """Return the course with other outputs before its first sample, up to the row `end` of the
        piece.
        """
        measured = self.piece.measured.copy()
        measured[: self.course.start - len(first)] = first[:1].sum()
        measured[self.course.start - len(first) : self.course.start] = first
        return Course(self.course.feedback, Piece(measured, self.piece.driven, {}), end)

    def steady(self) -> Course:
        """Begin with the output that the first inputs hold where it is: a root of (next output -
        output), by the secant.

        Raises DataError where there is none near the training range.
        """

        def held(y: float, end: int | None) -> Course:
            return self.with_first(np.full(self.course.feedback.longest, y), end)

        def away(y: float) -> float:
            output = _outputs(self.model, held(y, self.course.start + 1))
            return float(output[0]) - y if len(output) else np.nan

        before, y = (
            self.model.limits[0] + 0.25 * self.width,
            self.model.limits[0] + 0.75 * self.width,
        )
        error = away(before)
        for _ in range(STEPS):
            now = away(y)
            if abs(now) <= SETTLED * self.width:
                return held(y, None)
            if not np.isfinite(now) or abs(now - error) <= SETTLED * abs(y - before):
                break
            before, y, error = y, y - now * (y - before) / (now - error), now
        raise DataError(
            f"the model of {self.model.output} has no steady output under the first inputs",
            "start from measured outputs: `fit: {start: measured}`",
        )

    def identified(self) -> Course:
        """Begin with the outputs of least squared error over the first part of the run, by Gauss
        and Newton from the measured ones.
        """
        start, size, longest = self.course.start, self.course.size, self.course.feedback.longest
        end = start + max(int(FIRST * size), min(size, 4 * longest))
        wanted = self.piece.measured[start:end]
        known = np.isfinite(wanted)
        first = self.piece.measured[start - longest : start]
        if not np.isfinite(first).all() or known.sum() <= len(first):
            return self.course  # which tells what is missing
        step = NUDGE * self.width

        def errors(outputs: Array) -> Array:
            run = _outputs(self.model, self.with_first(outputs, end))
            return (
                (run - wanted)[known]
                if len(run) == len(wanted)
                else np.full(int(known.sum()), np.inf)
            )

        left = errors(first)
        for _ in range(STEPS):
            slopes = (
                np.column_stack([errors(first + step * one) - left for one in np.eye(len(first))])
                / step
            )
            if not np.isfinite(slopes).all():
                break
            tried = first - np.linalg.lstsq(slopes, left, rcond=None)[0]
            found = errors(tried)
            if not found @ found < (1 - NUDGE) * (left @ left):
                break
            first, left = tried, found
        return self.with_first(first)
