"""From sections of the spec to MAPMORE, the pieces of M1 and M2."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from mapmore_cli.domain.results import FitResult, PiecesFit
from mapmore_cli.fitting.kinds.choices import FitChoices, ModelChoices, SegmentSection, level_of
from mapmore_cli.fitting.kinds.dictionary import terms_of
from mapmore_cli.fitting.kinds.formula import fitted
from mapmore_cli.modelling.pieces.recipe import Cut, Fuse, Recipe
from mapmore_cli.modelling.pieces.segmentation import trained_at
from mapmore_cli.modelling.selection import AUTO, Fit
from mapmore_cli.spec.sections.data import Levels
from mapmore_cli.spec.sections.dictionary import DictionaryEntry, remembers

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import FormulaFit
    from mapmore_cli.domain.models import Model
    from mapmore_cli.domain.recording import Curve, Dataset
    from mapmore_cli.fitting.stage import Workspace


def cuts_of(segment: SegmentSection) -> dict[str, Cut]:
    """Return the segmented variables; words (`none`, `levels`) are about the level quantity."""
    return {name: cut for name, cut in segment.items() if not isinstance(cut, str)}


def recipe_of(
    target: str, levels: Levels | None, segment: SegmentSection, dictionary: Sequence[DictionaryEntry], fit: Fit, fuse: Fuse
) -> Recipe:
    """Return the whole recipe; without candidate terms where one model with memory stands in place of the segments."""
    level = level_of(levels, segment)
    return Recipe(
        target=target,
        dictionary=() if remembers(dictionary) else terms_of(dictionary),
        cuts=cuts_of(segment),
        level=level,
        pooled=None if levels is None or level is not None else levels.of,
        fit=fit,
        fuse=fuse,
    )


def fit(part: FitChoices, dataset: Dataset, workspace: Workspace) -> FitResult:
    """Return the terms of every segment, fitted to what the backbone leaves where there is one; raises FitError where its fit failed."""
    from mapmore_cli.modelling.pieces import build as method

    curves = trained_at(dataset.curves, part.fit.train_level)
    segmentation = workspace.files.segmentation()
    recipe = recipe_of(dataset.target, part.levels, part.segment, part.dictionary, part.fit, part.joined)
    backbone, notes = _backbone(part, dataset, curves, recipe, lambda done, of: workspace.progress("backbones by folds", done, of))
    total = sum(len(curve.segments) for curve in segmentation)
    done = 0

    def tick() -> None:
        nonlocal done
        done += 1
        workspace.progress("segments", done, total)

    segments = method.fit(curves, segmentation, recipe, backbone, tick)
    return FitResult(PiecesFit(segments), backbone, notes)


def _backbone(
    part: FitChoices, dataset: Dataset, curves: Sequence[Curve], recipe: Recipe, progress: Callable[[int, int], None]
) -> tuple[FormulaFit | None, tuple[str, ...]]:
    """Return the formula that the spec names, or the one that left-out levels choose, fitted; and on what grounds it was chosen."""
    name = part.model.backbone
    notes: tuple[str, ...] = ()
    if name == AUTO:
        from mapmore_cli.modelling.pieces.cross_validation import choose_backbone

        choice = choose_backbone(curves, recipe, dataset.quantities, progress)
        name, notes = choice.name, (choice.note,)
    return (None if name is None else fitted(name, part, dataset)), notes


def backbone_name(part: FitChoices, dataset: Dataset) -> str | None:
    """Return the backbone that left-out levels choose."""
    curves = trained_at(dataset.curves, part.fit.train_level)
    recipe = recipe_of(dataset.target, part.levels, part.segment, part.dictionary, part.fit, part.joined)
    found, _ = _backbone(part, dataset, curves, recipe, lambda _done, _of: None)
    return None if found is None else found.name


def build(part: ModelChoices, dataset: Dataset, workspace: Workspace) -> Model:
    """Fuse; on a backbone, keep as much of the residual as left-out training data support, unless the spec says how much."""
    from mapmore_cli.modelling.pieces import build as method
    from mapmore_cli.modelling.pieces.cross_validation import with_trusted_residual

    curves = trained_at(dataset.curves, part.fit.train_level)
    segmentation = workspace.files.segmentation()
    result = workspace.files.fit()
    recipe = recipe_of(dataset.target, part.levels, part.segment, part.dictionary, part.fit, part.fuse)
    model = method.fuse(part.name, curves, segmentation, result, recipe, dataset.quantities)
    if result.backbone is None or recipe.fuse.shrink != AUTO:
        return model
    return with_trusted_residual(model, curves, recipe, dataset.quantities, lambda done, total: workspace.progress("folds", done, total))


def refit(part: ModelChoices, dataset: Dataset) -> Model:
    """Everything in one go on the training samples of a dataset: cuts, backbone, terms, and the share of the residual that is trusted."""
    from mapmore_cli.modelling.pieces import build as method
    from mapmore_cli.modelling.pieces.cross_validation import with_trusted_residual

    curves = trained_at(dataset.curves, part.fit.train_level)
    recipe = recipe_of(dataset.target, part.levels, part.segment, part.dictionary, part.fit, part.fuse)
    backbone, _ = _backbone(part, dataset, curves, recipe, lambda _done, _of: None)
    model = method.build(part.name, curves, recipe, dataset.quantities, backbone)
    if backbone is None or recipe.fuse.shrink != AUTO:
        return model
    return with_trusted_residual(model, curves, recipe, dataset.quantities)
