"""Choose and fit the terms of every segment: `fit.h5`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.sections.data import Levels
from mapmore_cli.spec.sections.dictionary import DictionaryEntry, remembers
from mapmore_cli.spec.sections.method import Fit, Fuse, ModelChoice
from mapmore_cli.stages.kinds.memory import fit_memory
from mapmore_cli.stages.kinds.pieces import SegmentSection, recipe_of
from mapmore_cli.stages.pipeline.stage import Stage, Workspace

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import FormulaFit, SegmentFit
    from mapmore_cli.domain.recording import Dataset


@dataclass(frozen=True)
class Slice:
    """What the segment functions depend on."""

    levels: Levels | None
    segment: SegmentSection
    dictionary: list[DictionaryEntry]
    model: ModelChoice
    fit: Fit
    lengths: dict[str, float | None]


def reads(spec: ExperimentSpec) -> Slice:
    """The stage's slice of the spec; the muscle's dimensions are in it where the formula has one."""
    return Slice(spec.data.levels, spec.segment, spec.dictionary, spec.model, spec.fit, _lengths(spec))


def _lengths(spec: ExperimentSpec) -> dict[str, float | None]:
    from mapmore_cli.modelling import literature

    needed = literature.get(spec.model.name).dimensions if spec.model.name is not None else ()
    return {name: length for name, length in spec.muscle.lengths.items() if name in needed}


def run(part: Slice, workspace: Workspace) -> None:
    """Fit the formula where the model has one, then what it leaves: segment by segment, or with memory along whole recordings."""
    from mapmore_cli.domain.results import FitResult
    from mapmore_cli.modelling.pieces.build import fit
    from mapmore_cli.modelling.pieces.segmentation import trained_at
    from mapmore_cli.storage.artefacts import read_dataset, read_segmentation, units_of, write_fit

    dataset = read_dataset(workspace.run_dir / "ingest.h5")
    formula = _formula(part.model, dataset, part.lengths)
    if part.model.type != "mapmore":
        write_fit(workspace.out / "fit.h5", FitResult((), formula), units_of(dataset))
        return
    if remembers(part.dictionary):
        memory = fit_memory(dataset, part.dictionary, part.fit, formula)
        _warn_of_ties(memory.piece, workspace)
        write_fit(workspace.out / "fit.h5", FitResult((), formula, memory=memory), units_of(dataset))
        return
    segmentation = read_segmentation(workspace.run_dir / "segment.h5")
    recipe = recipe_of(dataset.target, part.levels, part.segment, part.dictionary, part.fit, Fuse())
    total = sum(len(curve.segments) for curve in segmentation)
    done = 0

    def tick() -> None:
        nonlocal done
        done += 1
        workspace.progress("segments", done, total)

    fits = fit(trained_at(dataset.curves, part.fit.train_level), segmentation, recipe, formula, tick)
    for one in fits:
        _warn_of_ties(one, workspace)
    write_fit(workspace.out / "fit.h5", FitResult(fits, formula), units_of(dataset))


def _warn_of_ties(fit: SegmentFit, workspace: Workspace) -> None:
    if fit.selection.tied.any():
        workspace.warn(f"segment {fit.id}: candidates tie within 1e-9; the first of the dictionary was taken")


def _formula(model: ModelChoice, dataset: Dataset, lengths: Mapping[str, float | None]) -> FormulaFit | None:
    """The fitted backbone, or the run's own formula.

    Raises
    ------
    FitError
        Where it did not converge to anything usable: the model stands on it.
    """
    from mapmore_cli.domain.errors import FitError
    from mapmore_cli.modelling.literature.backbone import fit_formula

    name = model.name if model.type == "literature" else model.backbone
    if name is None:
        return None
    formula = fit_formula(name, dataset.curves, dataset.target, model.method, lengths, model.starts)
    if formula.failed:
        reasons = "; ".join(formula.notes) or "no finite parameters were found"
        raise FitError(f"the fit of {name} failed: {reasons}", "take another formula, or build the model without one")
    return formula


STAGE = Stage(name="fit", revision=4, outputs=("fit.h5",), reads=reads, run=run)
