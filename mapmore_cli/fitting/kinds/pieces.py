"""Fit models that consist of segments (the MAPMORE method of Veale, Xie and Anderson 2018) with the
settings in the spec.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from typing import TYPE_CHECKING

from mapmore_cli.domain.results import FitResult, PiecesFit
from mapmore_cli.fitting.kinds import Given, Maker
from mapmore_cli.fitting.kinds.choices import (
    ModelChoices,
    SegmentSection,
    by_trial,
    level_of,
)
from mapmore_cli.fitting.kinds.dictionary import bounds_of, terms_of
from mapmore_cli.fitting.kinds.formula import fitted
from mapmore_cli.modelling.pieces.recipe import Cut, Recipe
from mapmore_cli.modelling.pieces.segmentation import trained_at
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.study.sections.dictionary import remembers

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import FormulaFit, SegmentedCurve
    from mapmore_cli.domain.models import Model
    from mapmore_cli.domain.recording import Curve, Dataset


def cuts_of(segment: SegmentSection) -> dict[str, Cut]:
    """Return the cuts of the segmented variables. Entries with the value `none` or `levels` are
    left out, because they define no cuts.
    """
    return {name: cut for name, cut in segment.items() if not isinstance(cut, str)}


def recipe_of(target: str, part: ModelChoices) -> Recipe:
    """Return all settings for the fit of the segments. The dictionary is empty if a model with
    memory is fitted instead of segments.
    """
    level = level_of(part.levels, part.segment)
    return Recipe(
        target=target,
        dictionary=() if remembers(part.dictionary) else terms_of(part.dictionary),
        cuts=cuts_of(part.segment),
        level=level,
        pooled=None if part.levels is None or level is not None else part.levels.of,
        fit=part.fit,
        fuse=part.fuse,
        bounds={} if remembers(part.dictionary) else bounds_of(part.dictionary),
    )


def segmented(dataset: Dataset, part: ModelChoices) -> tuple[SegmentedCurve, ...]:
    """Cut every training curve over its own range. With `method: optimal`, boundaries are chosen by
    comparing fits to the residual of the backbone.
    """
    from mapmore_cli.modelling.literature.backbone import fit_formula
    from mapmore_cli.modelling.pieces.build import segment as cut

    backbone = part.model.backbone if by_trial(part.segment) else None
    formula = fit_formula(backbone, dataset.curves, dataset.target) if backbone else None
    curves, recipe = _trained(part, dataset)
    return cut(curves, recipe, formula, dataset.also)


def _trained(part: ModelChoices, dataset: Dataset) -> tuple[Sequence[Curve], Recipe]:
    """Return the curves, and all settings for the fit of the segments. With `fit.train_level`, only
    the curves at this level have training samples.
    """
    curves = trained_at(dataset.curves, part.fit.train_level)
    return curves, recipe_of(dataset.target, part)


def _backbone(
    part: ModelChoices, given: Given, curves: Sequence[Curve], recipe: Recipe
) -> tuple[FormulaFit | None, tuple[str, ...]]:
    """Return the fitted backbone, and notes on how it was chosen. The formula is named in the spec,
    or it is the one with the smallest errors at left-out levels.
    """
    name = part.model.backbone
    notes: tuple[str, ...] = ()
    if name == AUTO:
        from mapmore_cli.modelling.pieces.backbone_choice import choose_backbone

        choice = choose_backbone(
            curves,
            recipe,
            given.dataset.quantities,
            lambda done, of: given.progress("backbones by folds", done, of),
        )
        name, notes = choice.name, (choice.note,)
    return (None if name is None else fitted(name, part, given.dataset)), notes


class PiecesMaker(Maker):
    """Maker of models that consist of fused segments."""

    def fit(self, part: ModelChoices, given: Given) -> FitResult:
        """Fit every segment and return the fits. If there is a backbone, segments are fitted to its
        residual. Raises FitError if the fit of the backbone failed.
        """
        return self.fit_together(part, given)[0]

    def fit_together(self, part: ModelChoices, given: Given) -> tuple[FitResult, ...]:
        """Fit the segments of all outputs with the same terms, and return one fit for each output.
        Raises the same errors as `fit`.
        """
        from mapmore_cli.modelling.pieces import build as method

        curves, recipe = _trained(part, given.dataset)
        backbone, notes = _backbone(part, given, curves, recipe)
        total = sum(len(curve.segments) for curve in given.segmentation)
        done = count(1)
        fits = method.fit(
            curves,
            given.segmentation,
            recipe,
            backbone,
            lambda: given.progress("segments", next(done), total),
            given.dataset.also,
        )
        return tuple(FitResult(PiecesFit(segments), backbone, notes) for segments in fits)

    def build(self, part: ModelChoices, given: Given, result: FitResult) -> Model:
        """Fuse the segments, and return the model. If there is a backbone, cross-validation decides
        whether the segments are used, and by which factor their output is reduced between levels.
        """
        from mapmore_cli.modelling.pieces import build as method
        from mapmore_cli.modelling.pieces.residual_share import with_trusted_residual
        from mapmore_cli.modelling.pieces.shaped import shaped

        quantities = given.dataset.quantities
        curves, recipe = _trained(part, given.dataset)
        model = method.fuse(part.name, curves, given.segmentation, result, recipe, quantities)
        if result.backbone is not None:
            model = with_trusted_residual(
                model,
                curves,
                recipe,
                quantities,
                lambda done, total: given.progress("folds", done, total),
            )
        return shaped(model, curves, given.segmentation, recipe)
