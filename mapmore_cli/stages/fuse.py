"""Join the segment functions into a model that stands alone: `model.h5`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mapmore_cli.spec.models import DictionaryEntry, ExperimentSpec, Fit, Fuse, Levels, ModelChoice
from mapmore_cli.stages.fingerprint import plain
from mapmore_cli.stages.recipes import SegmentSection, recipe_of
from mapmore_cli.stages.stage import Stage, Workspace

if TYPE_CHECKING:
    from mapmore_cli.domain.models import Model
    from mapmore_cli.domain.recording import Dataset
    from mapmore_cli.modelling.recipe import Recipe


@dataclass(frozen=True)
class Slice:
    """What the fused model depends on: cross-validation of a backbone repeats the steps before."""

    name: str
    levels: Levels | None
    segment: SegmentSection
    dictionary: list[DictionaryEntry]
    model: ModelChoice
    fit: Fit
    fuse: Fuse


def reads(spec: ExperimentSpec) -> Slice:
    """The stage's slice of the spec."""
    return Slice(spec.name, spec.data.levels, spec.segment, spec.dictionary, spec.model, spec.fit, spec.fuse)


def run(part: Slice, workspace: Workspace) -> None:
    """Fuse; on a backbone, keep the residual only where cross-validation on the training data says that it helps."""
    from mapmore_cli.modelling.mapmore import fuse
    from mapmore_cli.storage.artefacts import read_dataset, read_fit, read_segmentation, write_model

    dataset = read_dataset(workspace.run_dir / "ingest.h5")
    segmentation = read_segmentation(workspace.run_dir / "segment.h5")
    result = read_fit(workspace.run_dir / "fit.h5")
    recipe = recipe_of(dataset.target, part.levels, part.segment, part.dictionary, part.fit, part.fuse)
    model = fuse(part.name, segmentation, result, recipe, dataset.quantities)
    if result.backbone is not None and result.fits:
        model = _with_residual_if_it_helps(model, dataset, recipe, workspace)
    for note in model.notes:
        workspace.warn(note)
    write_model(workspace.out / "model.h5", model, _provenance(part))


def _provenance(part: Slice) -> dict[str, str]:
    """What made the model, for a reader who has nothing but the file: versions, and the spec's sections that decide about it."""
    import json

    from mapmore_cli.storage.versions import tool_versions

    return {**tool_versions(), "spec": json.dumps(plain(part), indent=1)}


def _with_residual_if_it_helps(model: Model, dataset: Dataset, recipe: Recipe, workspace: Workspace) -> Model:
    from mapmore_cli.modelling.cross_validation import cross_validate

    assert model.backbone is not None
    errors = cross_validate(
        dataset.curves, recipe, dataset.quantities, model.backbone.name, lambda done, total: workspace.progress("folds", done, total)
    )
    alone, both = errors
    if both.rmse < alone.rmse:
        return replace(model, cross_validation=errors)
    note = (
        f"cross-validation keeps {model.backbone.name} alone: {alone.rmse:.4g} {model.output.unit}, "
        f"with the residual {both.rmse:.4g} {model.output.unit} ({alone.folds} folds)"
    )
    bare = tuple(replace(curve, segments=()) for curve in model.curves)
    return replace(model, curves=bare, cross_validation=errors, notes=(*model.notes, note))


STAGE = Stage(name="fuse", revision=1, outputs=("model.h5",), reads=reads, run=run)
