"""From pieces of recordings to a model of motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import BUMPLESS, Motion, MotionFit, MotionSection, SectionSearch
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.motion.bumpless import Trace, joined
from mapmore_cli.modelling.motion.problem import Found, MotionRecipe, Piece, Problem
from mapmore_cli.modelling.motion.sections import active, extent, named, spread
from mapmore_cli.modelling.motion.simulation import driven
from mapmore_cli.modelling.motion.solvers import solve


def _silent(_done: int, _total: int) -> None:
    pass


def fit_motion(records: Sequence[Record], recipe: MotionRecipe, progress: Callable[[int, int], None] = _silent) -> MotionFit:
    """Fit every section to its own training samples, then, where they share a state, all of them together.

    A section's samples are those at which it holds; with hard switching it runs on the whole input all the same.

    Raises DataError where the input never changes, boundaries leave a section without samples or with too few of them; SpecError, FitError
    where the solver refuses the sections, or finds no stable one.
    """
    u = _training_input(records, recipe)
    boundaries = spread(u, recipe.sections) if isinstance(recipe.sections, int) else tuple(recipe.sections)
    outline = _outline(recipe, boundaries, (float(u.min()), float(u.max())))
    traces = [_trace(record, outline, recipe.mask) for record in records]
    searched: list[Found] = []
    for number in range(len(outline.sections)):
        searched.append(_search(traces, recipe, outline, number))
        progress(number + 1, len(outline.sections))
    sections = tuple(
        replace(section, p1=found.p1, p2=found.p2, weights=found.weights) for section, found in zip(outline.sections, searched, strict=True)
    )
    searches = tuple(
        SectionSearch(section.id, _count(traces, number), found.rmse, found.evaluations, found.history)
        for number, (section, found) in enumerate(zip(sections, searched, strict=True))
    )
    model = replace(outline, sections=sections)
    if recipe.switching != BUMPLESS:
        return MotionFit(model, recipe.solver, searches)
    return MotionFit(joined(model, traces, _reach(traces, recipe)), recipe.solver, searches)


def _training_input(records: Sequence[Record], recipe: MotionRecipe) -> Array:
    """Return the input at all training samples."""
    u = np.concatenate([record.columns[recipe.input][record.training] for record in records])
    if len(u) and np.ptp(u) == 0:
        raise DataError(
            f"the input `{recipe.input}` is {u[0]:.6g} at all {len(u)} training samples", "train on a record in which it changes"
        )
    if not len(u):
        raise DataError("there is no training sample", "keep more samples")
    return u


def _outline(recipe: MotionRecipe, boundaries: tuple[float, ...], limits: tuple[float, float]) -> Motion:
    """Return the model with sections that know their place, and no parameters yet."""
    empty = np.zeros(len(recipe.drives))
    sections = tuple(
        MotionSection(name, place, direction, 0.0, 0.0, empty)
        for name, place, direction in named(len(boundaries) + 1, directed=recipe.direction)
    )
    return Motion(
        input=recipe.input,
        output=recipe.output,
        step=recipe.step,
        switching=recipe.switching,
        boundaries=boundaries,
        directed=recipe.direction,
        dead_band=recipe.dead_band,
        drives=recipe.drives,
        sections=sections,
        limits=limits,
        start=recipe.start,
    )


def _trace(record: Record, outline: Motion, mask: str) -> Trace:
    columns = record.columns
    moving = columns[outline.output if mask == "displacement" else outline.input]
    return Trace(driven(outline.drives, columns), columns[outline.output], record.training, active(outline, columns[outline.input], moving))


def _reach(traces: Sequence[Trace], recipe: MotionRecipe) -> float:
    return recipe.reach(max(int(trace.counts.sum()) for trace in traces))


def _count(traces: Sequence[Trace], number: int) -> int:
    return sum(int(np.sum(trace.counts & (trace.holds == number))) for trace in traces)


def _search(traces: Sequence[Trace], recipe: MotionRecipe, outline: Motion, number: int) -> Found:
    """Return the parameters of one section."""
    section, samples, needed = outline.sections[number], _count(traces, number), 2 + len(outline.drives)
    if samples <= needed:
        low, high = outline.limits
        where = f"section {section.id} ({outline.input} {extent(outline.boundaries, section.place)})"
        raise DataError(
            f"{where}: {samples} training sample(s), too few for {needed} parameters; the training input goes from {low:.6g} to {high:.6g}",
            "move the boundaries of `model.sections` to where the input has been, or train on records that go there",
        )
    pieces = [Piece(trace.drives, trace.y, trace.counts & (trace.holds == number)) for trace in traces]
    return solve(Problem(pieces, _reach(traces, recipe), recipe.start, (recipe.seed, number)), recipe)
