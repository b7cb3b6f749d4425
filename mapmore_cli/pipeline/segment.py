"""Cut the training curves into segments: `ingest.h5` to `segment.h5`."""

from __future__ import annotations

from dataclasses import dataclass

from mapmore_cli.fitting.kinds.choices import SegmentSection, with_definitions
from mapmore_cli.fitting.stage import Stage, Workspace
from mapmore_cli.modelling.pieces.recipe import Cuts, Fuse
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.sections.data import Levels
from mapmore_cli.spec.sections.dictionary import DictionaryEntry
from mapmore_cli.spec.sections.model import ModelChoice
from mapmore_cli.storage.run_folder import SEGMENTATION


@dataclass(frozen=True)
class Trial:
    """What the costs of intervals depend on."""

    dictionary: list[DictionaryEntry]
    model: ModelChoice
    fit: Fit


@dataclass(frozen=True)
class Slice:
    """What the segments depend on; `trial` is None where no boundary is placed by trying out fits."""

    levels: Levels | None
    segment: SegmentSection
    train_level: str | float
    trial: Trial | None


def reads(spec: ExperimentSpec) -> Slice:
    """Return the stage's slice of the spec."""
    spec = with_definitions(spec)
    tries = any(isinstance(cut, Cuts) and cut.method == "optimal" for cut in spec.segment.values())
    return Slice(spec.data.levels, spec.segment, spec.fit.train_level, Trial(spec.dictionary, spec.model, spec.fit) if tries else None)


def run(part: Slice, workspace: Workspace) -> None:
    """Segment every curve over its own range; what is fitted there is what the backbone leaves."""
    from mapmore_cli.fitting.kinds.pieces import recipe_of
    from mapmore_cli.modelling.literature.backbone import fit_formula
    from mapmore_cli.modelling.pieces.build import segment
    from mapmore_cli.modelling.pieces.segmentation import trained_at
    from mapmore_cli.storage.artefacts import units_of, write_segmentation

    dataset = workspace.files.dataset()
    trial = part.trial or Trial([], ModelChoice(), Fit())
    recipe = recipe_of(dataset.target, part.levels, part.segment, trial.dictionary, trial.fit, Fuse())
    backbone = trial.model.backbone
    formula = fit_formula(backbone, dataset.curves, dataset.target) if backbone else None
    segmentation = segment(trained_at(dataset.curves, part.train_level), recipe, formula)
    for curve in segmentation:
        for name, boundaries in zip(curve.variables, curve.boundaries, strict=True):
            cut = recipe.cuts[name]
            wanted = cut.count if isinstance(cut, Cuts) else None
            if isinstance(cut, Cuts) and wanted is not None and len(boundaries) <= wanted:
                why = ": neighbours with too few samples are joined" if cut.joins else ""
                workspace.warn(f"curve {curve.curve}: {len(boundaries) - 1} segment(s) along {name} instead of {wanted}{why}")
    write_segmentation(workspace.out / SEGMENTATION, segmentation, units_of(dataset))


STAGE = Stage(name="segment", revision=5, outputs=(SEGMENTATION,), reads=reads, run=run)
