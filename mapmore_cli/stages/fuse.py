"""Join the segment functions into a model that stands alone: `model.h5`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mapmore_cli.domain.models import Signal
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.sections.data import Levels
from mapmore_cli.spec.sections.dictionary import DictionaryEntry
from mapmore_cli.spec.sections.method import Fit, Fuse, ModelChoice
from mapmore_cli.stages.kinds.pieces import SegmentSection, recipe_of
from mapmore_cli.stages.kinds.signals import signals_of
from mapmore_cli.stages.pipeline.fingerprint import plain
from mapmore_cli.stages.pipeline.stage import Stage, Workspace

if TYPE_CHECKING:
    from mapmore_cli.domain.models import Model
    from mapmore_cli.domain.recording import Dataset


@dataclass(frozen=True)
class Slice:
    """What the fused model depends on: cross-validation of a backbone repeats the steps before; a sum has two needed models."""

    name: str
    levels: Levels | None
    segment: SegmentSection
    dictionary: list[DictionaryEntry]
    model: ModelChoice
    fit: Fit
    fuse: Fuse
    signals: tuple[Signal, ...]
    summands: tuple[str, ...]


def reads(spec: ExperimentSpec) -> Slice:
    """The stage's slice of the spec."""
    return Slice(
        spec.name, spec.data.levels, spec.segment, spec.dictionary, spec.model, spec.fit, spec.fuse, signals_of(spec), tuple(needs(spec))
    )


def needs(spec: ExperimentSpec) -> list[str]:
    """The specs of the models that are added up."""
    return [str(spec.needs.static), str(spec.needs.damping)] if spec.model.type == "sum" else []


def run(part: Slice, workspace: Workspace) -> None:
    """Build the model and write it."""
    from mapmore_cli.modelling.signals.rates import needed_signals
    from mapmore_cli.storage.artefacts import read_dataset, write_model

    dataset = read_dataset(workspace.run_dir / "ingest.h5")
    model = _sum(part, dataset, workspace) if part.summands else _fused(part, dataset, workspace)
    model = replace(model, signals=needed_signals(part.signals, [quantity.name for quantity in model.inputs]))
    for note in model.notes:
        workspace.warn(note)
    write_model(workspace.out / "model.h5", model, _provenance(part))


def _sum(part: Slice, dataset: Dataset, workspace: Workspace) -> Model:
    """The dynamic model: static plus damping (M2 section 3)."""
    from mapmore_cli.modelling.sums.build import sum_of
    from mapmore_cli.storage.artefacts import read_model

    models = [read_model(workspace.needed[path] / "model.h5") for path in part.summands]
    return sum_of(part.name, models, dataset.quantities[dataset.target], dataset.quantities)


def _fused(part: Slice, dataset: Dataset, workspace: Workspace) -> Model:
    """Fuse; on a backbone, keep as much of the residual as left-out training data support, unless the spec says how much."""
    from mapmore_cli.modelling.memory.assembly import model_with_memory
    from mapmore_cli.modelling.pieces.build import fuse
    from mapmore_cli.modelling.pieces.segmentation import trained_at
    from mapmore_cli.modelling.pieces.shrinkage import with_trusted_residual
    from mapmore_cli.storage.artefacts import read_fit, read_segmentation

    curves = trained_at(dataset.curves, part.fit.train_level)
    segmentation = read_segmentation(workspace.run_dir / "segment.h5")
    result = read_fit(workspace.run_dir / "fit.h5")
    if result.memory is not None:
        return model_with_memory(part.name, result.memory.model, result.backbone, segmentation, dataset.quantities)
    recipe = recipe_of(dataset.target, part.levels, part.segment, part.dictionary, part.fit, part.fuse)
    model = fuse(part.name, curves, segmentation, result, recipe, dataset.quantities)
    if result.backbone is not None and result.fits and recipe.shrink is None:
        model = with_trusted_residual(
            model, curves, recipe, dataset.quantities, lambda done, total: workspace.progress("folds", done, total)
        )
    return model


def _provenance(part: Slice) -> dict[str, str]:
    """What made the model, for a reader who has nothing but the file: versions, and the spec's sections that decide about it."""
    import json

    from mapmore_cli.storage.provenance import tool_versions

    return {**tool_versions(), "spec": json.dumps(plain(part), indent=1)}


STAGE = Stage(name="fuse", revision=4, outputs=("model.h5",), reads=reads, run=run, needs=needs)
