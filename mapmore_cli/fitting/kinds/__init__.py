"""From sections of the spec to models: one file for each kind of model, by its name, or the module
that the kind names.

A kind has two functions, which read and write no files: `fit(part, given)` returns a FitResult,
`build(part, given, result)` the model that is made of it. The stages call them one by one, with
files between; `refit` calls them in one go. A kind whose outputs may share their terms also has
`fit_together(part, given)`, which returns a FitResult for each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.results import FitResult, OutputsFit
from mapmore_cli.modelling import kinds
from mapmore_cli.modelling.outputs.model import joined

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import SegmentedCurve
    from mapmore_cli.domain.models import Model
    from mapmore_cli.domain.recording import Dataset
    from mapmore_cli.fitting.kinds.choices import ModelChoices
    from mapmore_cli.fitting.stage import Progress


def added_up(_path: str) -> Model:
    """Refuse to fit a sum where the models of its runs are not known."""
    raise SpecError(
        "a sum of the models of other runs is not fitted itself",
        "do this with the specs that it adds up",
    )


@dataclass(frozen=True)
class Given:
    """Hold what a model is made of: data, segmentation, and the models of needed runs by the path
    of their spec.
    """

    dataset: Dataset
    segmentation: Sequence[SegmentedCurve]
    model_of: Callable[[str], Model] = added_up
    progress: Progress = lambda _what, _done, _total: None


def fit(part: ModelChoices, given: Given) -> FitResult:
    """Fit what the kind of model asks for: every segment, one model with memory, a formula, or
    nothing where models are added up.
    """
    result: FitResult
    if given.dataset.also:
        names = [one.target for one in given.dataset.each]
        fits = _module_of(part).fit_together(part, given)
        result = FitResult(OutputsFit(dict(zip(names, fits, strict=True))))
    else:
        result = _module_of(part).fit(part, given)
    return result


def build(part: ModelChoices, given: Given, result: FitResult) -> Model:
    """Return the model that is made of the fits, of all outputs where there are several."""
    if not given.dataset.also:
        model: Model = _module_of(part).build(part, given, result)
        return model
    outputs = zip(given.dataset.each, result.each, strict=True)
    return joined(
        part.name,
        [
            build(replace(part, name=f"{part.name}_{one.target}"), replace(given, dataset=one), own)
            for one, own in outputs
        ],
    )


def refit(
    part: ModelChoices, dataset: Dataset, model_of: Callable[[str], Model] = added_up
) -> Model:
    """Return the model of the training samples of a dataset, made in one go, every choice included,
    as cross-validation does.
    """
    from mapmore_cli.fitting.kinds.pieces import segmented

    given = Given(dataset, segmented(dataset, part), model_of)
    return build(part, given, fit(part, given))


def _module_of(part: ModelChoices) -> Any:
    """Return the module of a kind; only what that takes is imported."""
    return import_module(kinds.named(part.kind).fitted or f"{__name__}.{part.kind}")
