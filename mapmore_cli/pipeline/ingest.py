"""Read the recordings and sort their samples into curves: `ingest.h5`."""

from __future__ import annotations

from pathlib import Path

from mapmore_cli.fitting.stage import Stage, Workspace
from mapmore_cli.ingestion.files import IngestSlice, find_sources, slice_of
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.storage.run_folder import DATASET


def run(part: IngestSlice, workspace: Workspace) -> None:
    """Build the dataset and write it."""
    from mapmore_cli.ingestion.dataset import build_dataset
    from mapmore_cli.storage.artefacts import write_dataset
    from mapmore_cli.storage.spool import spooling_in

    static_run = workspace.needed[part.static] if part.static is not None else None
    with spooling_in(workspace.out):
        dataset = build_dataset(part, workspace.spec_dir, static_run=static_run, progress=workspace.progress, warn=workspace.warn)
        write_dataset(workspace.out / DATASET, dataset)


def sources(spec: ExperimentSpec, folder: Path) -> list[Path]:
    """Return the recordings that the spec names, and the logs that are joined to them."""
    found = find_sources(spec.data.files, folder, spec.data.join)
    return list(dict.fromkeys(log.path for source in found for log in (source, *source.joined)))


def needs(spec: ExperimentSpec) -> list[str]:
    """Return the static run, where the damping force is what its model leaves."""
    return [spec.needs.static] if spec.target == "damping" and spec.needs.static is not None else []


STAGE = Stage(name="ingest", revision=4, outputs=(DATASET,), reads=slice_of, run=run, sources=sources, needs=needs)
