"""Join the fits into a model that stands alone: `model.h5`."""

from __future__ import annotations

from dataclasses import replace

from mapmore_cli.fitting.kinds import maker_of
from mapmore_cli.fitting.kinds.choices import ModelChoices, model_choices, summands, with_terms
from mapmore_cli.fitting.stage import Stage, Workspace
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.pipeline.staleness import plain
from mapmore_cli.storage.run_folder import MODEL


def run(part: ModelChoices, workspace: Workspace) -> None:
    """Build the model and write it."""
    from mapmore_cli.modelling.signals.rates import needed_signals
    from mapmore_cli.storage.artefacts import write_model

    dataset = workspace.files.dataset()
    chosen = with_terms(part, workspace.files.fit().max_terms) if part.fit.max_terms == AUTO else part
    model = maker_of(part).build(chosen, dataset, workspace)
    model = replace(model, signals=needed_signals(part.signals, [quantity.name for quantity in model.inputs]))
    for note in model.notes:
        workspace.warn(note)
    if part.intervals:
        from mapmore_cli.fitting.left_out import residuals
        from mapmore_cli.modelling.validation.intervals import refusal

        left_out = residuals(part, dataset, workspace.needed, workspace.progress, model)
        if (why := refusal(left_out)) is not None:
            workspace.warn(f"validate.intervals: {why}")
        model = replace(model, left_out=left_out)
    write_model(workspace.out / MODEL, model, _provenance(part))


def _provenance(part: ModelChoices) -> dict[str, str]:
    """Return what made the model, for a reader who has nothing but the file: versions, and the spec's sections that decide about it."""
    import json

    from mapmore_cli.storage.run_record import tool_versions

    return {**tool_versions(), "spec": json.dumps(plain(part), indent=1)}


STAGE = Stage(name="fuse", revision=9, outputs=(MODEL,), reads=model_choices, run=run, needs=summands)
