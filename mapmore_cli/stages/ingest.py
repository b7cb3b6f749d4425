"""Read the recordings and sort their samples into curves: `ingest.h5`."""

from __future__ import annotations

from pathlib import Path

from mapmore_cli.spec.models import ExperimentSpec
from mapmore_cli.stages.ingestion.files import find_sources
from mapmore_cli.stages.ingestion.slice import IngestSlice, slice_of
from mapmore_cli.stages.stage import Stage, Workspace


def run(part: IngestSlice, workspace: Workspace) -> None:
    """Build the dataset and write it."""
    from mapmore_cli.stages.ingestion.dataset import build_dataset
    from mapmore_cli.storage.artefacts import write_dataset

    dataset = build_dataset(part, workspace.spec_dir, progress=workspace.progress, warn=workspace.warn)
    write_dataset(workspace.out / "ingest.h5", dataset)


def sources(spec: ExperimentSpec, folder: Path) -> list[Path]:
    """The recordings that the spec names, and the logs that are joined to them."""
    found = find_sources(spec.data.files, folder, spec.data.join)
    return list(dict.fromkeys(log.path for source in found for log in (source, *source.joined)))


STAGE = Stage(name="ingest", revision=1, outputs=("ingest.h5",), reads=slice_of, run=run, sources=sources)
