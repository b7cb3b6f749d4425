"""Join the segment functions into a model that stands alone: `model.h5`."""

from __future__ import annotations

from dataclasses import dataclass

from mapmore_cli.spec.models import DictionaryEntry, ExperimentSpec, Fit, Fuse, Levels, ModelChoice
from mapmore_cli.stages.fingerprint import plain
from mapmore_cli.stages.recipes import SegmentSection, recipe_of
from mapmore_cli.stages.stage import Stage, Workspace


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
    """Fuse; on a backbone, keep as much of the residual as left-out training data support, unless the spec says how much."""
    from mapmore_cli.modelling.mapmore import fuse
    from mapmore_cli.modelling.shrinkage import with_trusted_residual
    from mapmore_cli.storage.artefacts import read_dataset, read_fit, read_segmentation, write_model

    dataset = read_dataset(workspace.run_dir / "ingest.h5")
    segmentation = read_segmentation(workspace.run_dir / "segment.h5")
    result = read_fit(workspace.run_dir / "fit.h5")
    recipe = recipe_of(dataset.target, part.levels, part.segment, part.dictionary, part.fit, part.fuse)
    model = fuse(part.name, dataset.curves, segmentation, result, recipe, dataset.quantities)
    if result.backbone is not None and result.fits and recipe.shrink is None:
        model = with_trusted_residual(
            model, dataset.curves, recipe, dataset.quantities, lambda done, total: workspace.progress("folds", done, total)
        )
    for note in model.notes:
        workspace.warn(note)
    write_model(workspace.out / "model.h5", model, _provenance(part))


def _provenance(part: Slice) -> dict[str, str]:
    """What made the model, for a reader who has nothing but the file: versions, and the spec's sections that decide about it."""
    import json

    from mapmore_cli.storage.versions import tool_versions

    return {**tool_versions(), "spec": json.dumps(plain(part), indent=1)}


STAGE = Stage(name="fuse", revision=2, outputs=("model.h5",), reads=reads, run=run)
