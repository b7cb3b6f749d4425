"""Implement the stages `ingest`, `segment`, `fit` and `fuse`. They make curves from recordings, cut
the curves into segments, fit the segments, and make a model from the fits.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic_core import to_json

from mapmore_cli.fitting import kinds
from mapmore_cli.fitting.kinds import Given
from mapmore_cli.fitting.kinds.choices import (
    ModelChoices,
    by_trial,
    fit_choices,
    model_choices,
    summands,
    with_definitions,
)
from mapmore_cli.fitting.stage import Need, Stage, Workspace
from mapmore_cli.ingestion.files import IngestSlice, find_sources, slice_of
from mapmore_cli.modelling.kinds import alone
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.storage.run_folder import DATASET, FIT, MODEL, SEGMENTATION, RunFiles
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.model import ModelChoice

if TYPE_CHECKING:
    from mapmore_cli.domain.models import Model
    from mapmore_cli.domain.recording import Dataset

# Ingest: `ingest.h5`
# --------------------------------------------------------------------------------------------------


def ingest(part: IngestSlice, workspace: Workspace) -> None:
    """Read the recordings, sort their samples into curves, and write the dataset."""
    from mapmore_cli.ingestion.dataset import build_dataset
    from mapmore_cli.storage.artefacts import write_dataset

    static_run = workspace.needed[part.static] if part.static is not None else None
    dataset = build_dataset(
        part,
        workspace.spec_dir,
        static_run=static_run,
        tables=workspace.tables,
        progress=workspace.progress,
        warn=workspace.warn,
    )
    write_dataset(workspace.out / DATASET, dataset)


def recordings(spec: ExperimentSpec, folder: Path) -> list[Path]:
    """Return the paths of the recordings in the spec, and of the logs that are joined to them."""
    sources = find_sources(spec.data.files, folder, spec.data.join, bad=spec.data.skip_bad_files)
    return list(dict.fromkeys(log.path for source in sources for log in (source, *source.joined)))


def static_run(spec: ExperimentSpec) -> list[Need]:
    """Return the static run that the stage ingest needs. Only studies of the damping force need it,
    because this force is the measured force minus the prediction of the static model.
    """
    static = spec.needs.static
    return [Need(static)] if spec.target == "damping" and static is not None else []


INGEST = Stage(
    name="ingest",
    revision=13,
    outputs=(DATASET,),
    reads=slice_of,
    run=ingest,
    sources=recordings,
    needs=static_run,
)


# Segment: `segment.h5`
# --------------------------------------------------------------------------------------------------


def segment_slice(spec: ExperimentSpec) -> ModelChoices:
    """Return the settings on which the segments depend. The dictionary, the model and the fit are
    included only if segment boundaries are chosen by comparing fits.
    """
    spec = with_definitions(spec)
    levels, cuts = spec.data.levels, spec.segment
    if by_trial(cuts):
        return ModelChoices(levels, cuts, spec.dictionary, spec.model, spec.fit, {})
    return ModelChoices(levels, cuts, [], ModelChoice(), Fit(train_level=spec.fit.train_level), {})


def segment(part: ModelChoices, workspace: Workspace) -> None:
    """Cut every training curve into segments over its own range, and write the boundaries. With
    `method: optimal`, boundaries are chosen by comparing the fits of the segments that they give.
    For a model with a backbone, the segments are fitted to the residual of the backbone.
    """
    from mapmore_cli.fitting.kinds.pieces import segmented
    from mapmore_cli.storage.artefacts import write_segmentation
    from mapmore_cli.storage.artefacts.schema import units_of

    dataset = workspace.files.dataset()
    segmentation = segmented(dataset, part)
    for curve in segmentation:
        for name, boundaries in zip(curve.variables, curve.boundaries, strict=True):
            cut = part.segment[name]
            if isinstance(cut, Cuts) and cut.count is not None and len(boundaries) <= cut.count:
                why = ", because neighbours with too few samples are joined" if cut.joins else ""
                workspace.warn(
                    f"curve {curve.curve}: {len(boundaries) - 1} segment(s) along {name} "
                    f"instead of {cut.count}{why}"
                )
    write_segmentation(workspace.out / SEGMENTATION, segmentation, units_of(dataset))


SEGMENT = Stage(
    name="segment", revision=8, outputs=(SEGMENTATION,), reads=segment_slice, run=segment
)


# Fit: `fit.h5`
# --------------------------------------------------------------------------------------------------


def fit(part: ModelChoices, workspace: Workspace) -> None:
    """Fit the model to the training curves: each segment, one model with memory, or a formula. If
    the model is a sum of models of other runs, nothing is fitted.
    """
    from mapmore_cli.modelling.frols.offsets import constant_alone, far_from_zero
    from mapmore_cli.storage.artefacts import write_fit
    from mapmore_cli.storage.artefacts.schema import units_of

    dataset = workspace.files.dataset()
    given = Given(dataset, workspace.files.segmentation(), progress=workspace.progress)
    result = kinds.fit(part, given)
    alone = dict.fromkeys(note for fit in result.each for note in constant_alone(fit))
    for note in alone:
        workspace.warn(note)
    pieces = [piece for fit in result.each for piece in fit.pieces]
    for note in far_from_zero(pieces, dataset.curves):
        workspace.warn(note)
    result = replace(result, notes=(*alone, *result.notes))
    tied = (piece.id for fit in result.each for piece in fit.pieces if piece.selection.tied.any())
    for id_ in dict.fromkeys(tied):
        workspace.warn(
            f"segment {id_}: several candidates are equally good (within 1e-9), and the "
            "first was chosen; remove the others from the dictionary"
        )
    write_fit(workspace.out / FIT, result, units_of(dataset))


FITTING = Stage(name="fit", revision=18, outputs=(FIT,), reads=fit_choices, run=fit)


# Fuse: `model.h5`
# --------------------------------------------------------------------------------------------------


def fuse(part: ModelChoices, workspace: Workspace) -> None:
    """Make the model from the fits, and write it to the run folder."""
    from mapmore_cli.modelling.outputs.model import outputs_model
    from mapmore_cli.storage.artefacts import write_model
    from mapmore_cli.storage.run_record import tool_versions

    files = workspace.files
    dataset, result = files.dataset(), files.fit()
    given = Given(
        dataset,
        files.segmentation(),
        lambda path: alone(RunFiles(workspace.needed[path]).model()),
        workspace.progress,
    )
    model = kinds.build(part, given, result)
    outputs = zip(model.each, dataset.each, strict=True)
    finished = [_finished(part, model, data) for model, data in outputs]
    model = outputs_model(model.name, finished) if dataset.also else finished[0]
    for note in model.notes:
        workspace.warn(note)
    if part.intervals:
        from mapmore_cli.fitting.left_out import residuals
        from mapmore_cli.modelling.validation.intervals import interval_limits

        left_out = residuals(
            part, dataset, workspace.needed, workspace.progress, model, workspace.run_dir
        )
        if (why := interval_limits(left_out)) is not None:
            workspace.warn(f"validate.intervals: {why}")
        model = replace(model, left_out=left_out)
    # the model file contains its own origin, because it may be passed on without the run folder
    provenance = {**tool_versions(), "spec": to_json(part, indent=1).decode()}
    write_model(workspace.out / MODEL, model, provenance)


def _finished(part: ModelChoices, model: Model, dataset: Dataset) -> Model:
    """Complete the model of one output: add the rates and directions that it needs, and notes about
    its residuals. Raises FitError if the training data contradict the shape that `fit.shape`
    requires, or are too few to support it.
    """
    from mapmore_cli.modelling.signals.rates import needed_signals
    from mapmore_cli.modelling.validation.residuals import explained_by_inputs

    if part.fit.shape is not None:
        from mapmore_cli.modelling.kinds import runs_over_time
        from mapmore_cli.modelling.shape.support import refuse_unsupported

        names = model.input_names
        asked = (dataset.curves, model.output.name, names, model.level, part.fit)
        refuse_unsupported(*asked, over_time=runs_over_time(model))
    return replace(
        model,
        signals=needed_signals(part.signals, model.input_names),
        notes=(*model.notes, *explained_by_inputs(model, dataset)),
    )


FUSE = Stage(
    name="fuse",
    revision=15,
    outputs=(MODEL,),
    reads=model_choices,
    run=fuse,
    needs=lambda spec: [Need(path) for path in summands(spec)],
)
