"""From the spec to a state-space model of motion."""

from __future__ import annotations

from collections.abc import Callable

from mapmore_cli.domain.models import Model
from mapmore_cli.domain.motion import MotionFit
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import FitResult
from mapmore_cli.modelling.memory import records_of, time_step
from mapmore_cli.modelling.motion import Box, MotionRecipe, fit_motion
from mapmore_cli.modelling.motion import model as motion
from mapmore_cli.modelling.pieces.segmentation import uncut
from mapmore_cli.spec.sections.method import ModelChoice
from mapmore_cli.spec.sections.state_space import Bounds
from mapmore_cli.stages.kinds.choices import FitChoices, ModelChoices, level_of
from mapmore_cli.stages.pipeline.stage import Workspace


def fit(part: FitChoices, dataset: Dataset, workspace: Workspace) -> FitResult:
    """Every section, on all recordings.

    Raises
    ------
    DataError
        Where recordings are not sampled alike, the input never changes, or a section has too few samples.
    SpecError, FitError
        Where the solver refuses the sections, or finds no stable one.
    """
    return FitResult(_fitted(part, dataset, lambda done, total: workspace.progress("sections", done, total)))


def _fitted(part: FitChoices, dataset: Dataset, progress: Callable[[int, int], None]) -> MotionFit:
    step = time_step(dataset.curves)
    return fit_motion(records_of(dataset.curves, step), recipe_of(part.model, dataset.target, step), progress)


def recipe_of(choice: ModelChoice, target: str, step: float) -> MotionRecipe:
    """The recipe that a spec asks for, with `step` (s) between samples."""
    assert choice.input is not None
    return MotionRecipe(
        input=choice.input,
        output=target,
        step=step,
        sections=choice.sections if isinstance(choice.sections, int) else tuple(choice.sections),
        direction=choice.direction,
        switching=choice.switching,
        dead_band=choice.dead_band,
        offset=choice.offset,
        load=choice.load,
        solver=choice.solver,
        polish=choice.polish,
        particles=choice.particles,
        iterations=choice.iterations,
        seed=choice.seed,
        slowest=choice.slowest,
        start=choice.start,
        mask=choice.mask,
        box=_box(choice.bounds) or Box(),
        begin=_box(choice.begin),
    )


def _box(bounds: Bounds | None) -> Box | None:
    return None if bounds is None else Box(bounds.p1, bounds.p2, bounds.p3)


def build(part: ModelChoices, dataset: Dataset, workspace: Workspace) -> Model:
    """The model, with the training range of its inputs."""
    result = workspace.files.fit()
    assert result.motion is not None
    training = workspace.files.segmentation()
    return motion.build(part.name, result.motion.model, training, dataset.quantities, result.notes)


def refit(part: ModelChoices, dataset: Dataset) -> Model:
    """The model of the training samples of a dataset, in one go; raises as `fit`."""
    found = _fitted(part, dataset, lambda _done, _total: None)
    return motion.build(
        part.name,
        found.model,
        uncut(dataset.curves, level_of(part.levels, part.segment) is not None, dataset.target),
        dataset.quantities,
        found.notes,
    )
