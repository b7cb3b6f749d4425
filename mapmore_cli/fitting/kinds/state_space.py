"""From the spec to a state-space model of motion."""

from __future__ import annotations

from collections.abc import Callable

from mapmore_cli.domain.declared import taken
from mapmore_cli.domain.models import Model, MotionFit
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import FitResult
from mapmore_cli.fitting.kinds.choices import FitChoices, ModelChoices, level_of
from mapmore_cli.fitting.stage import Workspace
from mapmore_cli.modelling.memory.records import records_of, time_step
from mapmore_cli.modelling.motion import model as motion
from mapmore_cli.modelling.motion.fitting import fit_motion
from mapmore_cli.modelling.motion.problem import MotionRecipe
from mapmore_cli.modelling.pieces.segmentation import uncut


def fit(part: FitChoices, dataset: Dataset, workspace: Workspace) -> FitResult:
    """Every section, on all recordings.

    Raises DataError where recordings are not sampled alike, the input never changes, or a section has too few samples; SpecError, FitError
    where the solver refuses the sections, or finds no stable one.
    """
    return FitResult(_fitted(part, dataset, lambda done, total: workspace.progress("sections", done, total)))


def _fitted(part: FitChoices, dataset: Dataset, progress: Callable[[int, int], None]) -> MotionFit:
    step = time_step(dataset.curves)
    recipe = taken(MotionRecipe, part.model, output=dataset.target, step=step)
    return fit_motion(records_of(dataset.curves, step), recipe, progress)


def build(part: ModelChoices, dataset: Dataset, workspace: Workspace) -> Model:
    """Return the model, with the training range of its inputs."""
    result = workspace.files.fit()
    assert result.motion is not None
    training = workspace.files.segmentation()
    return motion.build(part.name, result.motion.model, training, dataset.quantities, result.notes)


def refit(part: ModelChoices, dataset: Dataset) -> Model:
    """Return the model of the training samples of a dataset, in one go; raises as `fit`."""
    found = _fitted(part, dataset, lambda _done, _total: None)
    return motion.build(
        part.name,
        found.model,
        uncut(dataset.curves, level_of(part.levels, part.segment) is not None, dataset.target),
        dataset.quantities,
        found.notes,
    )
