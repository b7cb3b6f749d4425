"""From the spec to a model with memory."""

from __future__ import annotations

from collections.abc import Callable

from mapmore_cli.domain.declared import taken
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import FitResult
from mapmore_cli.fitting.kinds.choices import FitChoices, ModelChoices, level_of
from mapmore_cli.fitting.kinds.dictionary import Clock, terms_of
from mapmore_cli.fitting.kinds.formula import fitted
from mapmore_cli.fitting.stage import Workspace
from mapmore_cli.modelling.literature.backbone import residual_of
from mapmore_cli.modelling.memory import model as memory
from mapmore_cli.modelling.memory.fitting import fit_with_memory
from mapmore_cli.modelling.memory.records import records_of, time_step
from mapmore_cli.modelling.pieces.segmentation import uncut
from mapmore_cli.modelling.selection import MemoryRecipe


def fit(part: FitChoices, dataset: Dataset, workspace: Workspace) -> FitResult:
    """One model of all recordings, of what the backbone leaves where there is one.

    Raises DataError where recordings are not sampled alike, or too few samples have a history; FitError where the fit of the backbone
    failed.
    """
    return _fitted(part, dataset, lambda done, total: workspace.progress("models", done, total))


def _fitted(part: FitChoices, dataset: Dataset, progress: Callable[[int, int], None]) -> FitResult:
    backbone = None if part.model.backbone is None else fitted(part.model.backbone, part, dataset)
    curves = [residual_of(curve, dataset.target, backbone) for curve in dataset.curves]
    step = time_step(curves)
    records = records_of(curves, step)
    clock = Clock(step, step * max(int(record.training.sum()) for record in records))
    recipe = taken(MemoryRecipe, part.fit, target=dataset.target, dictionary=terms_of(part.dictionary, clock), step=step)
    found = fit_with_memory(records, recipe, progress)
    return FitResult(found, backbone, () if found.identified is None else found.identified.notes)


def build(part: ModelChoices, dataset: Dataset, workspace: Workspace) -> Model:
    """Return the model, with the training range of its inputs."""
    result = workspace.files.fit()
    assert result.memory is not None
    training = workspace.files.segmentation()
    return memory.build(part.name, result.memory.model, result.backbone, training, dataset.quantities, result.notes)


def refit(part: ModelChoices, dataset: Dataset) -> Model:
    """Return the model of the training samples of a dataset, in one go; raises as `fit`."""
    result = _fitted(part, dataset, lambda _done, _total: None)
    assert result.memory is not None
    training = uncut(dataset.curves, level_of(part.levels, part.segment) is not None, dataset.target)
    return memory.build(part.name, result.memory.model, result.backbone, training, dataset.quantities, result.notes)
