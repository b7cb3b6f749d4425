"""How free runs begin: with measured outputs, at a steady output, or with identified ones."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import MemoryModel
from mapmore_cli.modelling.memory.feedback import Feedback
from mapmore_cli.modelling.memory.simulation import Course, Piece, bounds_of, course_of

FIRST = 0.05
"""Share of a run over which first outputs are identified, and errors of the beginning are told."""

STEPS = 60
"""Steps of a search for the first outputs."""

SETTLED = 1e-12
"""Of the training range: a smaller step is the last."""

NUDGE = 1e-6
"""Of the training range, over which an output is moved for a difference quotient."""


def begun(model: MemoryModel, feedback: Feedback, piece: Piece) -> Course:
    """Return a piece ready to be run, with the first outputs as the model's `start` says.

    Raises DataError where a steady start is asked for and the model has no steady output near its training range.
    """
    course = course_of(feedback, piece)
    if model.start == "measured" or not course.size:
        return course
    if model.start == "steady":
        return _with_first(feedback, piece, course, np.full(feedback.longest, _steady(model, feedback, piece, course)))
    return _identified(model, feedback, piece, course)


def _with_first(feedback: Feedback, piece: Piece, course: Course, first: Array, end: int | None = None) -> Course:
    """Return the course with other outputs before its first sample, up to the row `end` of the piece."""
    measured = piece.measured.copy()
    measured[: course.start] = np.concatenate([np.full(course.start - len(first), first[:1].sum()), first])
    return course_of(feedback, Piece(measured, piece.driven, {}), end)


def _steady(model: MemoryModel, feedback: Feedback, piece: Piece, course: Course) -> float:
    """Return the output that the first inputs hold where it is: a root of (next output - output), by the secant."""
    low, high = model.limits
    width = high - low or 1.0

    def away(y: float) -> float:
        held = _with_first(feedback, piece, course, np.full(feedback.longest, y), course.start + 1)
        output = held.run(model.theta, model.constant, bounds_of(model.limits)).output
        return float(output[0]) - y if len(output) else np.nan

    before, y = low + 0.25 * width, low + 0.75 * width
    error = away(before)
    for _ in range(STEPS):
        now = away(y)
        if abs(now) <= SETTLED * width:
            return y
        if not np.isfinite(now) or abs(now - error) <= SETTLED * abs(y - before):
            break
        before, y, error = y, y - now * (y - before) / (now - error), now
    raise DataError(
        f"the model of {model.output} has no steady output under the first inputs", "start from measured outputs: `fit: {start: measured}`"
    )


def _identified(model: MemoryModel, feedback: Feedback, piece: Piece, course: Course) -> Course:
    """Return the first outputs of least squared error over the first part of the run, by Gauss and Newton from the measured ones."""
    end = course.start + max(int(FIRST * course.size), min(course.size, 4 * feedback.longest))
    wanted = piece.measured[course.start : end]
    known = np.isfinite(wanted)
    first = piece.measured[course.start - feedback.longest : course.start]
    if not np.isfinite(first).all() or known.sum() <= len(first):
        return course  # which tells what is missing
    step = NUDGE * (model.limits[1] - model.limits[0] or 1.0)

    def errors(outputs: Array) -> Array:
        run = _with_first(feedback, piece, course, outputs, end).run(model.theta, model.constant, bounds_of(model.limits)).output
        return (run - wanted)[known] if len(run) == len(wanted) else np.full(int(known.sum()), np.inf)

    left = errors(first)
    for _ in range(STEPS):
        moved = [errors(first + step * one) - left for one in np.eye(len(first))]
        slopes = np.column_stack(moved) / step
        if not np.isfinite(slopes).all():
            break
        tried = first - np.linalg.lstsq(slopes, left, rcond=None)[0]
        found = errors(tried)
        if not found @ found < (1 - NUDGE) * (left @ left):
            break
        first, left = tried, found
    return _with_first(feedback, piece, course, first)


def started(model: MemoryModel) -> str:
    """Say how free runs of a model begin, in a sentence."""
    return {
        "measured": "Free runs begin with measured outputs.",
        "steady": "Free runs begin at the steady output of the first inputs; no measured output is used.",
        "identified": f"The first outputs of a free run are those of which it errs least over its first {FIRST:.0%}.",
    }[model.start]
