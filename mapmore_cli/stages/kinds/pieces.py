"""From sections of the spec to MAPMORE, the pieces of M1 and M2."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from mapmore_cli.spec.sections.data import Levels
from mapmore_cli.spec.sections.dictionary import DictionaryEntry, remembers
from mapmore_cli.spec.sections.method import AUTO, BelowAbove, CutByDirection, Cuts, Fit, Fuse
from mapmore_cli.stages.kinds.choices import FitChoices, ModelChoices, SegmentSection, level_of
from mapmore_cli.stages.kinds.dictionary import terms_of

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import FormulaFit
    from mapmore_cli.domain.models import Model, Side
    from mapmore_cli.domain.recording import Curve, Dataset
    from mapmore_cli.domain.results import FitResult
    from mapmore_cli.modelling.pieces.recipe import Cut, Recipe, Scale
    from mapmore_cli.stages.pipeline.stage import Workspace


def cuts_of(segment: SegmentSection) -> dict[str, Cut]:
    """The segmented variables; words (`none`, `levels`) are about the level quantity."""
    return {name: _cut(cuts) for name, cuts in segment.items() if not isinstance(cuts, str)}


def _cut(cuts: Cuts | CutByDirection) -> Cut:
    from mapmore_cli.modelling.pieces.recipe import Breakpoints, Directions, Even, Gradient, Optimal

    if isinstance(cuts, CutByDirection):
        return Directions()
    if cuts.method == "breakpoints":
        return Breakpoints(tuple(cuts.at or ()), cuts.min_samples or 0)
    assert cuts.count is not None
    if cuts.method == "gradient":
        return Gradient(cuts.count, cuts.window, cuts.separation)
    if cuts.method == "optimal":
        chosen = {"grid": cuts.grid, "min_samples": cuts.min_samples}
        return Optimal(cuts.count, **{name: value for name, value in chosen.items() if value is not None})
    return Even(cuts.count, cuts.min_samples or 0)


def recipe_of(
    target: str, levels: Levels | None, segment: SegmentSection, dictionary: Sequence[DictionaryEntry], fit: Fit, fuse: Fuse
) -> Recipe:
    """The whole recipe of a MAPMORE model; without candidate terms where one model with memory stands in place of the segments."""
    from mapmore_cli.domain.models import Fusion
    from mapmore_cli.modelling.pieces.recipe import Cutting, Fitting, Fusing, Recipe

    candidates = () if remembers(dictionary) else terms_of(dictionary)
    level = level_of(levels, segment)
    return Recipe(
        target=target,
        cutting=Cutting(level, cuts_of(segment), None if levels is None or level is not None else levels.of),
        fitting=Fitting(candidates, _scaling(fit), fit.most_terms, fit.tolerance, fit.stop),
        fusing=Fusing(
            joints=Fusion(fuse.transition, fuse.z_s, {}, levels=fuse.levels, hold=fuse.hold),
            align=fuse.align,
            limits=fuse.limits,
            shrink=None if fuse.shrink == "auto" else fuse.shrink,
            extrapolation=_sides(fuse),
            beyond=fuse.extrapolation if isinstance(fuse.extrapolation, str) else None,
        ),
    )


def _scaling(fit: Fit) -> Scale:
    """The scaling of segments; `range` is that of states with memory, and leaves pieces none."""
    return "none" if fit.scaling == "range" else fit.scaling


def _sides(fuse: Fuse) -> dict[str, tuple[Side | None, Side | None]]:
    if not isinstance(fuse.extrapolation, Mapping):
        return {}
    return {
        name: (sides.below, sides.above) if isinstance(sides, BelowAbove) else (sides, sides) for name, sides in fuse.extrapolation.items()
    }


def fit(part: FitChoices, dataset: Dataset, workspace: Workspace) -> FitResult:
    """The terms of every segment, fitted to what the backbone leaves where there is one; raises FitError where its fit failed."""
    from mapmore_cli.domain.results import FitResult, PiecesFit
    from mapmore_cli.modelling.pieces import build as method
    from mapmore_cli.modelling.pieces.segmentation import trained_at

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
    """The formula that the spec names, or the one that left-out levels choose, fitted; and on what grounds it was chosen."""
    from mapmore_cli.stages.kinds.formula import fitted

    name = part.model.backbone
    notes: tuple[str, ...] = ()
    if name == AUTO:
        from mapmore_cli.modelling.pieces.backbone_choice import choose_backbone

        choice = choose_backbone(curves, recipe, dataset.quantities, progress)
        name, notes = choice.name, (choice.note,)
    return (None if name is None else fitted(name, part, dataset)), notes


def backbone_name(part: FitChoices, dataset: Dataset) -> str | None:
    """The backbone that left-out levels choose."""
    from mapmore_cli.modelling.pieces.segmentation import trained_at

    curves = trained_at(dataset.curves, part.fit.train_level)
    recipe = recipe_of(dataset.target, part.levels, part.segment, part.dictionary, part.fit, part.joined)
    found, _ = _backbone(part, dataset, curves, recipe, lambda _done, _of: None)
    return None if found is None else found.name


def build(part: ModelChoices, dataset: Dataset, workspace: Workspace) -> Model:
    """Fuse; on a backbone, keep as much of the residual as left-out training data support, unless the spec says how much."""
    from mapmore_cli.modelling.pieces import build as method
    from mapmore_cli.modelling.pieces.segmentation import trained_at
    from mapmore_cli.modelling.pieces.shrinkage import with_trusted_residual

    curves = trained_at(dataset.curves, part.fit.train_level)
    segmentation = workspace.files.segmentation()
    result = workspace.files.fit()
    recipe = recipe_of(dataset.target, part.levels, part.segment, part.dictionary, part.fit, part.fuse)
    model = method.fuse(part.name, curves, segmentation, result, recipe, dataset.quantities)
    if result.backbone is None or recipe.fusing.shrink is not None:
        return model
    return with_trusted_residual(model, curves, recipe, dataset.quantities, lambda done, total: workspace.progress("folds", done, total))


def refit(part: ModelChoices, dataset: Dataset) -> Model:
    """Everything in one go on the training samples of a dataset: cuts, backbone, terms, and the share of the residual that is trusted."""
    from mapmore_cli.modelling.pieces import build as method
    from mapmore_cli.modelling.pieces.segmentation import trained_at
    from mapmore_cli.modelling.pieces.shrinkage import with_trusted_residual

    curves = trained_at(dataset.curves, part.fit.train_level)
    recipe = recipe_of(dataset.target, part.levels, part.segment, part.dictionary, part.fit, part.fuse)
    backbone, _ = _backbone(part, dataset, curves, recipe, lambda _done, _of: None)
    model = method.build(part.name, curves, recipe, dataset.quantities, backbone)
    if backbone is None or recipe.fusing.shrink is not None:
        return model
    return with_trusted_residual(model, curves, recipe, dataset.quantities)
