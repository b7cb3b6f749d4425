"""Cut the training curves into segments: `ingest.h5` to `segment.h5`."""

from __future__ import annotations

from dataclasses import dataclass

from mapmore_cli.spec.models import ExperimentSpec, Levels
from mapmore_cli.stages.recipes import SegmentSection, cuts_of, level_of
from mapmore_cli.stages.stage import Stage, Workspace


@dataclass(frozen=True)
class Slice:
    """What the segments depend on."""

    levels: Levels | None
    segment: SegmentSection


def reads(spec: ExperimentSpec) -> Slice:
    """The stage's slice of the spec."""
    return Slice(spec.data.levels, spec.segment)


def run(part: Slice, workspace: Workspace) -> None:
    """Segment every curve over its own range."""
    from mapmore_cli.modelling.mapmore import segment
    from mapmore_cli.storage.artefacts import read_dataset, units_of, write_segmentation

    dataset = read_dataset(workspace.run_dir / "ingest.h5")
    by_level = level_of(part.levels, part.segment) is not None
    segmentation = segment(dataset.curves, cuts_of(part.segment), by_level)
    write_segmentation(workspace.out / "segment.h5", segmentation, units_of(dataset))


STAGE = Stage(name="segment", revision=1, outputs=("segment.h5",), reads=reads, run=run)
