"""The first four stages: recordings to curves, curves to segments, segments to fits, fits to a
model that stands alone.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from mapmore_cli.fitting import kinds
from mapmore_cli.fitting.kinds import Given
from mapmore_cli.fitting.kinds.choices import (
    FitChoices,
    ModelChoices,
    SegmentSection,
    by_trial,
    lengths_of,
    model_choices,
    summands,
    with_definitions,
    with_terms,
)
from mapmore_cli.fitting.stage import Stage, Workspace
from mapmore_cli.ingestion.files import IngestSlice, find_sources, slice_of
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.selection import AUTO, Fit
from mapmore_cli.pipeline.staleness import plain
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.sections.data import Levels
from mapmore_cli.spec.sections.dictionary import DictionaryEntry
from mapmore_cli.spec.sections.model import ModelChoice
from mapmore_cli.storage.run_folder import DATASET, FIT, MODEL, SEGMENTATION, RunFiles

# Ingest: `ingest.h5`
# --------------------------------------------------------------------------------------------------


def ingest(part: IngestSlice, workspace: Workspace) -> None:
    """Read the recordings, sort their samples into curves, and write the dataset."""
    from mapmore_cli.ingestion.dataset import build_dataset
    from mapmore_cli.storage.artefacts import write_dataset
    from mapmore_cli.storage.spool import spooling_in

    static_run = workspace.needed[part.static] if part.static is not None else None
    with spooling_in(workspace.out):
        dataset = build_dataset(
            part,
            workspace.spec_dir,
            static_run=static_run,
            progress=workspace.progress,
            warn=workspace.warn,
        )
        write_dataset(workspace.out / DATASET, dataset)


def recordings(spec: ExperimentSpec, folder: Path) -> list[Path]:
    """Return the recordings that the spec names, and the logs that are joined to them."""
    found = find_sources(spec.data.files, folder, spec.data.join)
    return list(dict.fromkeys(log.path for source in found for log in (source, *source.joined)))


def static_run(spec: ExperimentSpec) -> list[str]:
    """Return the static run, where the damping force is what its model leaves."""
    return [spec.needs.static] if spec.target == "damping" and spec.needs.static is not None else []


INGEST = Stage(
    name="ingest",
    revision=5,
    outputs=(DATASET,),
    reads=slice_of,
    run=ingest,
    sources=recordings,
    needs=static_run,
)


# Segment: `segment.h5`
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Trial:
    """What the costs of intervals depend on."""

    dictionary: list[DictionaryEntry]
    model: ModelChoice
    fit: Fit


@dataclass(frozen=True)
class Slice:
    """What the segments depend on; `trial` is None where no boundary is placed by trying out
    fits.
    """

    levels: Levels | None
    segment: SegmentSection
    train_level: Literal["all", "highest"] | float
    trial: Trial | None


def segment_slice(spec: ExperimentSpec) -> Slice:
    """Return what the segments depend on."""
    spec = with_definitions(spec)
    trial = Trial(spec.dictionary, spec.model, spec.fit) if by_trial(spec.segment) else None
    return Slice(spec.data.levels, spec.segment, spec.fit.train_level, trial)


def segment(part: Slice, workspace: Workspace) -> None:
    """Cut every training curve over its own range; what is fitted there is what the backbone
    leaves.
    """
    from mapmore_cli.fitting.kinds.pieces import segmented
    from mapmore_cli.storage.artefacts import units_of, write_segmentation

    dataset = workspace.files.dataset()
    trial = part.trial or Trial([], ModelChoice(), Fit(train_level=part.train_level))
    segmentation = segmented(
        dataset, part.levels, part.segment, trial.dictionary, trial.model.backbone, trial.fit
    )
    for curve in segmentation:
        for name, boundaries in zip(curve.variables, curve.boundaries, strict=True):
            cut = part.segment[name]
            wanted = cut.count if isinstance(cut, Cuts) else None
            if isinstance(cut, Cuts) and wanted is not None and len(boundaries) <= wanted:
                why = ": neighbours with too few samples are joined" if cut.joins else ""
                workspace.warn(
                    f"curve {curve.curve}: {len(boundaries) - 1} segment(s) along {name} "
                    f"instead of {wanted}{why}"
                )
    write_segmentation(workspace.out / SEGMENTATION, segmentation, units_of(dataset))


SEGMENT = Stage(
    name="segment", revision=6, outputs=(SEGMENTATION,), reads=segment_slice, run=segment
)


# Fit: `fit.h5`
# --------------------------------------------------------------------------------------------------


def fit_choices(spec: ExperimentSpec) -> FitChoices:
    """Return what the fit depends on."""
    spec = with_definitions(spec)
    joining = spec.fuse if AUTO in (spec.model.backbone, spec.fit.max_terms) else None
    return FitChoices(
        spec.data.levels,
        spec.segment,
        spec.dictionary,
        spec.model,
        spec.fit,
        lengths_of(spec),
        joining,
    )


def fit(part: FitChoices, workspace: Workspace) -> None:
    """Fit what the kind of model asks for: every segment, one model with memory, a formula, or
    nothing where models are added up.
    """
    from mapmore_cli.fitting.refitting import size_of
    from mapmore_cli.storage.artefacts import units_of, write_fit

    dataset = workspace.files.dataset()
    size = size_of(
        part, dataset, lambda done, total: workspace.progress("numbers of terms", done, total)
    )
    result = kinds.fit(
        with_terms(part, size.terms),
        Given(dataset, workspace.files.segmentation(), progress=workspace.progress),
    )
    alone = result.constant_alone
    for note in alone:
        workspace.warn(note)
    result = replace(result, notes=(*size.notes, *alone, *result.notes), max_terms=size.terms)
    for piece in result.pieces:
        if piece.selection.tied.any():
            workspace.warn(
                f"segment {piece.id}: candidates tie within 1e-9; the first of the dictionary "
                "was taken"
            )
    write_fit(workspace.out / FIT, result, units_of(dataset))


FITTING = Stage(name="fit", revision=10, outputs=(FIT,), reads=fit_choices, run=fit)


# Fuse: `model.h5`
# --------------------------------------------------------------------------------------------------


def fuse(part: ModelChoices, workspace: Workspace) -> None:
    """Join the fits into a model, and write it."""
    from mapmore_cli.modelling.signals.rates import needed_signals
    from mapmore_cli.storage.artefacts import write_model

    files = workspace.files
    dataset, result = files.dataset(), files.fit()
    chosen = with_terms(part, result.max_terms) if part.fit.max_terms == AUTO else part
    given = Given(
        dataset,
        files.segmentation(),
        lambda path: RunFiles(workspace.needed[path]).model(),
        workspace.progress,
    )
    model = kinds.build(chosen, given, result)
    model = replace(
        model, signals=needed_signals(part.signals, [quantity.name for quantity in model.inputs])
    )
    for note in model.notes:
        workspace.warn(note)
    if part.intervals:
        from mapmore_cli.fitting.left_out import residuals
        from mapmore_cli.modelling.validation.intervals import interval_refusal

        left_out = residuals(part, dataset, workspace.needed, workspace.progress, model)
        if (why := interval_refusal(left_out)) is not None:
            workspace.warn(f"validate.intervals: {why}")
        model = replace(model, left_out=left_out)
    write_model(workspace.out / MODEL, model, _provenance(part))


def _provenance(part: ModelChoices) -> dict[str, str]:
    """Return what made the model, for a reader who has nothing but the file: versions, and the
    spec's sections that decide about it.
    """
    from mapmore_cli.storage.run_record import tool_versions

    return {**tool_versions(), "spec": json.dumps(plain(part), indent=1)}


FUSE = Stage(
    name="fuse", revision=10, outputs=(MODEL,), reads=model_choices, run=fuse, needs=summands
)
