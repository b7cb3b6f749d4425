"""Fit a model of motion to pieces of recordings, and join sections that share one state so that
nothing jumps at their boundaries.

The steady output of a section is `s(u) = sum_m w_m d_m/(1 - P1 - P2)`. If sections are joined, s is
one piecewise linear function of the input. This function is given by its heights at the boundaries
and at the ends of the training range. With a load L, a second function of this kind is multiplied
by L. Rise and fall have separate functions. When the direction changes, the output moves from one
function to the other as fast as the poles of the section allow.

For given poles, the output is linear in the heights, so that linear least squares gives them. The
poles of all sections are refined together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from mapmore_cli.annexes.motion.body import (
    ALL,
    BUMPLESS,
    FALL,
    RISE,
    Motion,
    MotionFit,
    MotionSection,
    SectionSearch,
)
from mapmore_cli.annexes.motion.problem import MotionRecipe, Piece, Problem
from mapmore_cli.annexes.motion.simulation import (
    active,
    angles,
    driven,
    extent,
    of_angles,
    shared,
    spread,
)
from mapmore_cli.annexes.motion.solvers import NEAREST, SOLVERS
from mapmore_cli.domain.arrays import Array, extremes
from mapmore_cli.domain.declared import from_fields
from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.memory.records import Record

REFINEMENTS = 20  # largest number of steps that refine the poles of all sections together
TOLERANCE = 1e-8


def fit_motion(
    records: Sequence[Record],
    recipe: MotionRecipe,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> MotionFit:
    """Fit every section to its own training samples. If sections share a state, then fit all of
    them together.

    A section's own samples are the samples at which it is active. With hard switching, each section
    is simulated with the whole input, including the samples of other sections.

    Raises DataError if the input never changes, or if boundaries leave a section without samples or
    with too few of them; SpecError if the solver refuses the sections; FitError if it finds no
    stable section.
    """
    outline = _outline(records, recipe)
    pieces = []
    for record in records:
        columns = record.columns
        mask = recipe.output if recipe.mask == "displacement" else recipe.input
        holds = active(outline, columns[recipe.input], columns[mask])
        pieces.append(
            Piece(driven(outline.drives, columns), columns[recipe.output], record.training, holds)
        )
    reach = recipe.reach(max(int(piece.counts.sum()) for piece in pieces))
    sections: list[MotionSection] = []
    searches: list[SectionSearch] = []
    for number, section in enumerate(outline.sections):
        own_pieces = [
            replace(piece, counts=piece.counts & (piece.holds == number)) for piece in pieces
        ]
        samples = int(sum(piece.counts.sum() for piece in own_pieces))
        if samples <= (needed := 2 + len(outline.drives)):
            place, (low, high) = extent(outline.boundaries, section.place), outline.limits
            raise DataError(
                f"section {section.id} ({outline.input} {place}): {samples} training "
                f"sample(s), too few for {needed} parameters; the training input goes from "
                f"{low:.6g} to {high:.6g}",
                "move the boundaries of `model.sections` into this range, or train with "
                "recordings that reach further",
            )
        problem = Problem(own_pieces, reach, recipe.start, (recipe.seed, number))
        solution = SOLVERS[recipe.solver](problem, recipe)
        sections.append(replace(section, p1=solution.p1, p2=solution.p2, weights=solution.weights))
        searches.append(
            SectionSearch(
                section.id, samples, solution.rmse, solution.evaluations, solution.history
            )
        )
        progress(number + 1, len(outline.sections))
    model = replace(outline, sections=tuple(sections))
    return MotionFit(
        joined(model, pieces, reach) if recipe.switching == BUMPLESS else model,
        recipe.solver,
        tuple(searches),
    )


def _outline(records: Sequence[Record], recipe: MotionRecipe) -> Motion:
    """Return the model with the boundaries of its sections, but without their parameters."""
    u = np.concatenate([record.columns[recipe.input][record.training] for record in records])
    if not len(u):
        raise DataError("there is no training sample", "loosen `data.keep`, or hold out less")
    if np.ptp(u) == 0:
        raise DataError(
            f"the input `{recipe.input}` is {u[0]:.6g} at all {len(u)} training samples",
            "train with a recording in which it changes",
        )
    boundaries = (
        spread(u, recipe.sections) if isinstance(recipe.sections, int) else tuple(recipe.sections)
    )
    empty = np.zeros(len(recipe.drives))
    sections = tuple(
        MotionSection(
            f"{way} {place}" if recipe.direction else str(place), place, way, 0.0, 0.0, empty
        )
        for place in range(1, len(boundaries) + 2)
        for way in ((RISE, FALL) if recipe.direction else (ALL,))
    )
    return from_fields(
        Motion,
        recipe,
        boundaries=boundaries,
        directed=recipe.direction,
        sections=sections,
        limits=extremes(u),
    )


def joined(motion: Motion, pieces: Sequence[Piece], reach: float) -> Motion:
    """Return the model with sections whose steady outputs meet at the boundaries. The poles are
    refined under this condition.

    Raises DataError if a boundary lies at an end of the training range, because the section outside
    it would have no width.
    """
    if np.any(np.diff(_knots(motion)[0]) <= 0):
        low, high = motion.limits
        raise DataError(
            "a boundary of the sections lies at an end of the training input, which goes "
            f"from {low:.6g} to {high:.6g}; the section outside it would have no width",
            "move the boundary inwards, or use `switching: hard`",
        )
    counted = [piece for piece in pieces if piece.counts.any()]
    y = np.concatenate([run.y[run.counts] for run in counted])
    bases = [_heights_of(motion, run) for run in counted]

    def outputs(poles: Array) -> Array:
        steady = 1.0 - poles.sum(axis=1)[:, None]
        runs = (
            shared(poles, basis * steady[run.holds], run.holds, motion.start)[run.counts]
            for run, basis in zip(counted, bases, strict=True)
        )
        return np.concatenate(list(runs))

    def residuals(place: Array) -> Array:
        moved = outputs(_poles(place, reach))
        return np.asarray(moved @ np.linalg.lstsq(moved, y, rcond=None)[0] - y)

    start = np.concatenate(
        [angles(section.p1, section.p2, reach, NEAREST) for section in motion.sections]
    )
    best = least_squares(
        residuals, start, ftol=TOLERANCE, xtol=TOLERANCE, gtol=TOLERANCE, max_nfev=REFINEMENTS
    )
    poles = _poles(best.x, reach)
    heights = np.linalg.lstsq(outputs(poles), y, rcond=None)[0]
    return _with_heights(motion, poles, heights)


def _poles(place: Array, reach: float) -> Array:
    """Return P1 and P2 of every section, (s, 2), from search coordinates."""
    return np.array([of_angles(pair, reach) for pair in place.reshape(-1, 2)])


def _knots(motion: Motion) -> tuple[Array, int]:
    """Return the inputs at which the heights of the steady output are given: the ends of the
    training range and the boundaries. Also return the number of functions: two if rise and fall
    have separate functions, otherwise one.
    """
    low, high = motion.limits
    return np.array([low, *motion.boundaries, high]), 1 + motion.directed


def _heights_of(motion: Motion, run: Piece) -> Array:
    """Return one input signal (drive) for each height of the steady output, (n, knots x lines).

    The steady output of the model is a piecewise linear function of the input, given by its heights
    at the knots. Each drive is the steady output that has the height one at its own knot and zero
    at all other knots. Outside the outer knots, it continues as a straight line. With a load, these
    drives are followed by the same drives multiplied by the load.
    """
    knots, lines = _knots(motion)
    u, place, line = run.drives[:, 0], run.holds // lines, run.holds % lines
    along = (u - knots[place]) / (knots[place + 1] - knots[place])
    shares = np.zeros((len(u), len(knots) * lines))
    rows = np.arange(len(u))
    shares[rows, place * lines + line] = 1.0 - along
    shares[rows, (place + 1) * lines + line] = along
    return (
        shares
        if len(motion.drives) == 2
        else np.column_stack([shares, shares * run.drives[:, 2:3]])
    )


def _with_heights(motion: Motion, poles: Array, heights: Array) -> Motion:
    """Return the model with new weights of the drives `u, 1` (and `L, u L`) in every section. The
    weights are computed from the heights of the steady output at the knots.
    """
    knots, lines = _knots(motion)

    def straight(heights_of_one: Array) -> list[Array]:
        """Return slopes and constants of the straight lines between the heights at neighbouring
        knots, (sections,) each.
        """
        table = heights_of_one.reshape(len(knots), lines)
        slopes = np.diff(table, axis=0) / np.diff(knots)[:, None]
        return [slopes.ravel(), (table[:-1] - slopes * knots[:-1, None]).ravel()]

    unloaded, *loaded = (straight(part) for part in heights.reshape(-1, len(knots) * lines))
    weights = np.column_stack([*unloaded, *(column for part in loaded for column in part[::-1])])
    parts = zip(motion.sections, poles.tolist(), weights, strict=True)
    sections = (
        replace(section, p1=p1, p2=p2, weights=(1.0 - p1 - p2) * drives)
        for section, (p1, p2), drives in parts
    )
    return replace(motion, sections=tuple(sections))
