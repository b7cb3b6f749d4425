"""Models of needed runs, added up (M2 section 3)."""

from __future__ import annotations

from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import FitResult
from mapmore_cli.modelling.sums.build import sum_of
from mapmore_cli.stages.kinds.choices import FitChoices, ModelChoices
from mapmore_cli.stages.pipeline.stage import Workspace
from mapmore_cli.storage.artefacts import read_model


def fit(part: FitChoices, dataset: Dataset, workspace: Workspace) -> FitResult:
    """Nothing: the summands are fitted by runs of their own."""
    del part, dataset, workspace
    return FitResult(None)


def build(part: ModelChoices, dataset: Dataset, workspace: Workspace) -> Model:
    """The dynamic model: static plus damping."""
    models = [read_model(workspace.needed[path] / "model.h5") for path in part.summands]
    return sum_of(part.name, models, dataset.quantities[dataset.target], dataset.quantities)
