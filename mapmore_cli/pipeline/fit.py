"""Choose and fit the terms of the model: `fit.h5`."""

from __future__ import annotations

from dataclasses import replace

from mapmore_cli.fitting.kinds import maker_of
from mapmore_cli.fitting.kinds.choices import FitChoices, lengths_of, size_of, with_definitions, with_terms
from mapmore_cli.fitting.stage import Stage, Workspace
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.storage.run_folder import FIT


def reads(spec: ExperimentSpec) -> FitChoices:
    """Return the stage's slice of the spec."""
    spec = with_definitions(spec)
    joining = spec.fuse if AUTO in (spec.model.backbone, spec.fit.max_terms) else None
    return FitChoices(spec.data.levels, spec.segment, spec.dictionary, spec.model, spec.fit, lengths_of(spec), joining)


def run(part: FitChoices, workspace: Workspace) -> None:
    """Fit what the kind of model asks for: every segment, one model with memory, a formula, or nothing where models are added up."""
    from mapmore_cli.storage.artefacts import units_of, write_fit

    dataset = workspace.files.dataset()
    size = size_of(part, dataset, lambda done, total: workspace.progress("numbers of terms", done, total))
    result = maker_of(part).fit(with_terms(part, size.terms), dataset, workspace)
    result = replace(result, notes=(*size.notes, *result.notes), max_terms=size.terms)
    for piece in result.pieces:
        if piece.selection.tied.any():
            workspace.warn(f"segment {piece.id}: candidates tie within 1e-9; the first of the dictionary was taken")
    write_fit(workspace.out / FIT, result, units_of(dataset))


STAGE = Stage(name="fit", revision=9, outputs=(FIT,), reads=reads, run=run)
