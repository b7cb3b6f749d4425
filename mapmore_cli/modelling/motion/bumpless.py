"""Sections that share one state: their steady outputs are made to agree at the boundaries, so that nothing jumps there.

A section's steady output is `s(u) = sum_m w_m d_m/(1 - P1 - P2)`. Joined, s is one line of straight pieces along the input, given
by its heights at the boundaries and at the ends of the training range (with a load L, so is the part that is multiplied with L). Rise and
fall have lines of their own; where the direction changes, the output moves from one to the other as fast as the section's poles let it.

Given the poles, the output is linear in the heights, which follow by projection; the poles of all sections are refined together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import BUMPLESS, Motion, MotionSection
from mapmore_cli.modelling.motion.sections import angles, of_angles
from mapmore_cli.modelling.motion.simulation import shared

REFINEMENTS = 20
"""Steps that refine the poles of all sections together, at most."""

TOLERANCE = 1e-8

INMOST = 0.999
"""Largest reflection coefficient to begin with."""


@dataclass(frozen=True)
class Trace:
    """One piece of a record as sections see it: drives (n, m), output, the samples that count, and the section that holds at each."""

    drives: Array
    y: Array
    counts: BoolArray
    holds: IntArray


def joined(motion: Motion, traces: Sequence[Trace], reach: float) -> Motion:
    """Return the model with sections that meet, and poles refined for that.

    Raises DataError where a boundary lies at an end of the training range: the section beyond it would have no width.
    """
    if np.any(np.diff(_knots(motion)) <= 0):
        low, high = motion.limits
        raise DataError(
            f"a boundary of the sections lies at an end of the training input, which goes from {low:.6g} to {high:.6g}",
            "move the boundary inwards, or use `switching: hard`",
        )
    counted = [trace for trace in traces if trace.counts.any()]
    y = np.concatenate([run.y[run.counts] for run in counted])
    bases = [_heights_of(motion, run) for run in counted]

    def outputs(poles: Array) -> Array:
        parts = [
            shared(poles, basis * (1.0 - poles.sum(axis=1))[run.holds, None], run.holds, motion.start)
            for run, basis in zip(counted, bases, strict=True)
        ]
        return np.concatenate([part[run.counts] for part, run in zip(parts, counted, strict=True)])

    def residuals(place: Array) -> Array:
        moved = outputs(_poles(place, reach))
        return np.asarray(moved @ np.linalg.lstsq(moved, y, rcond=None)[0] - y)

    start = np.concatenate([angles(section.p1, section.p2, reach, INMOST) for section in motion.sections])
    best = least_squares(residuals, start, ftol=TOLERANCE, xtol=TOLERANCE, gtol=TOLERANCE, max_nfev=REFINEMENTS)
    poles = _poles(best.x, reach)
    heights = np.linalg.lstsq(outputs(poles), y, rcond=None)[0]
    return _with_heights(motion, poles, heights)


def _poles(place: Array, reach: float) -> Array:
    """P1 and P2 of every section, (s, 2)."""
    return np.array([of_angles(pair, reach) for pair in place.reshape(-1, 2)])


def _knots(motion: Motion) -> Array:
    """Where the steady line has its heights: the ends of the training range, and the boundaries."""
    return np.array([motion.limits[0], *motion.boundaries, motion.limits[1]])


def _lines(motion: Motion) -> int:
    """One steady line, or one for each direction."""
    return 2 if motion.directed else 1


def _shares(motion: Motion, u: Array, holds: IntArray) -> Array:
    """Steady output (n, knots x lines) that a height of one at each knot gives; straight on beyond the ends."""
    knots, lines = _knots(motion), _lines(motion)
    place, line = holds // lines, holds % lines
    along = (u - knots[place]) / (knots[place + 1] - knots[place])
    shares = np.zeros((len(u), len(knots) * lines))
    rows = np.arange(len(u))
    shares[rows, place * lines + line] = 1.0 - along
    shares[rows, (place + 1) * lines + line] = along
    return shares


def _heights_of(motion: Motion, run: Trace) -> Array:
    """Drives (n, heights) of every height; with a load, a second set that is multiplied with it."""
    shares = _shares(motion, run.drives[:, 0], run.holds)
    return shares if len(motion.drives) == 2 else np.column_stack([shares, shares * run.drives[:, 2:3]])


def _with_heights(motion: Motion, poles: Array, heights: Array) -> Motion:
    """Return the weights of the drives `u, 1` (and `L, u L`) that the heights give in every section."""
    knots, lines = _knots(motion), _lines(motion)
    sections = []
    for number, (section, (p1, p2)) in enumerate(zip(motion.sections, poles.tolist(), strict=True)):
        place, line = divmod(number, lines)
        weights = []
        for heights_of_one in heights.reshape(-1, len(knots) * lines):
            low, high = heights_of_one[place * lines + line], heights_of_one[(place + 1) * lines + line]
            slope = (high - low) / (knots[place + 1] - knots[place])
            weights.append((slope, low - slope * knots[place]))
        flat = [*weights[0], *(weights[1][::-1] if len(weights) > 1 else ())]
        sections.append(replace(section, p1=p1, p2=p2, weights=(1.0 - p1 - p2) * np.array(flat)))
    return replace(motion, sections=tuple(sections))


def continued(motion: Motion) -> Motion:
    """Return a model with hard switching as one that shares its state: constants are added so that its sections meet, the first as it is.

    For published sections, whose steady outputs disagree at the boundaries. Rise and fall are joined each for itself.
    """
    lines, knots = _lines(motion), _knots(motion)
    sections: list[MotionSection] = []
    for number, section in enumerate(motion.sections):
        place = number // lines
        constant = 0.0
        if place:
            before = sections[number - lines]
            edge = float(knots[place])
            steady = (before.weights @ np.array([edge, 1.0])) / (1.0 - before.p1 - before.p2)
            constant = steady * (1.0 - section.p1 - section.p2) - section.p3 * edge
        sections.append(replace(section, weights=np.array([section.p3, constant])))
    return replace(motion, switching=BUMPLESS, drives=(motion.input, "1"), sections=tuple(sections))
