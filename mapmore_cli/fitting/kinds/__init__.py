"""Make models from sections of the spec. Each kind of model has a file with a `Maker`, which fits
and builds models of this kind. The stages call `fit` and `build` separately and store the results
in between; `refit` calls both. The functions here read and write no files.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.results import FitResult, OutputsFit
from mapmore_cli.modelling import kinds
from mapmore_cli.modelling.outputs.model import outputs_model

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import FormulaFit, SegmentedCurve
    from mapmore_cli.domain.models import Model
    from mapmore_cli.domain.recording import Dataset
    from mapmore_cli.fitting.kinds.choices import ModelChoices
    from mapmore_cli.fitting.stage import Progress
    from mapmore_cli.study.sections.model import Summand


def added_up(_path: str) -> Model:
    """Raise SpecError, because a sum of runs cannot be fitted without the models of these runs."""
    raise SpecError(
        "a model of type `sum` cannot be fitted again without the runs of its models",
        "apply the command to the spec of each model in the sum instead of to the sum",
    )


@dataclass(frozen=True)
class Given:
    """Everything from which a model is made: the data, the segmentation, and the function
    `model_of`, which takes the path of a spec and returns the model of its run.

    If `near` is not None, it is an earlier fit to the samples of `dataset` and further samples. The
    search for parameters then begins at the parameters of this earlier fit.
    """

    dataset: Dataset
    segmentation: Sequence[SegmentedCurve]
    model_of: Callable[[str], Model] = added_up
    progress: Progress = lambda _what, _done, _total: None
    near: FitResult | None = None


class Maker(Protocol):
    """Interface of objects that fit and build the models of one kind."""

    @abstractmethod
    def fit(self, part: ModelChoices, given: Given) -> FitResult:
        """Fit a model of this kind, and return the fit."""

    @abstractmethod
    def build(self, part: ModelChoices, given: Given, result: FitResult) -> Model:
        """Make the model from its fit, and return it."""

    def fit_together(
        self,
        part: ModelChoices,
        given: Given,  # noqa: ARG002
    ) -> tuple[FitResult, ...]:
        """Fit all outputs with common terms, and return a fit for each output. Only some kinds of
        models can do this.
        """
        raise SpecError(f"a model of type {part.kind} has one output only", "name one target")


@runtime_checkable
class FitsSums(Protocol):
    """A maker that can also fit the formulas of a sum together. Such a sum can be a competitor of
    any model.
    """

    def fit_sum(
        self, name: str, summands: Sequence[Summand], dataset: Dataset, method: str | None
    ) -> tuple[FormulaFit, Model]:
        """Fit all summands together. Return the fit, and the sum as a model called `name`."""


@runtime_checkable
class FittedKind(Protocol):
    """A kind of model that is defined in a plug-in and can be fitted."""

    def maker(self) -> Maker:
        """Return the `Maker` for models of this kind."""


def maker_of(name: str) -> Maker:
    """Return the maker of the models of a kind. Only the modules that this kind needs are imported.

    Raises NotInstalled if the kind belongs to a part of mapmore that is not installed.
    """
    if name == "pieces":
        from mapmore_cli.fitting.kinds.pieces import PiecesMaker

        return PiecesMaker()
    if name == "memory":
        from mapmore_cli.fitting.kinds.memory import MemoryMaker

        return MemoryMaker()
    if name == "formula":
        from mapmore_cli.fitting.kinds.formula import FormulaMaker

        return FormulaMaker()
    kind = kinds.named(name)
    assert isinstance(kind, FittedKind), f"no fit exists for models of type {name}"
    return kind.maker()


def fit(part: ModelChoices, given: Given) -> FitResult:
    """Fit a model of any kind: every segment, one model with memory, or a formula. If the model is
    a sum of the models of other runs, nothing is fitted.
    """
    maker = maker_of(part.kind)
    if not given.dataset.also:
        return maker.fit(part, given)
    names = [dataset.target for dataset in given.dataset.each]
    fits = maker.fit_together(part, given)
    return FitResult(OutputsFit(dict(zip(names, fits, strict=True))))


def build(part: ModelChoices, given: Given, result: FitResult) -> Model:
    """Return the model that is made from the fits. If there are several outputs, the model contains
    all of them.
    """
    if not given.dataset.also:
        return maker_of(part.kind).build(part, given, result)
    outputs = zip(given.dataset.each, result.each, strict=True)
    return outputs_model(
        part.name,
        [
            build(
                replace(part, name=f"{part.name}_{dataset.target}"),
                replace(given, dataset=dataset),
                fit_of_output,
            )
            for dataset, fit_of_output in outputs
        ],
    )


def refit(
    part: ModelChoices, dataset: Dataset, model_of: Callable[[str], Model] = added_up
) -> Model:
    """Fit a model to the training samples of a dataset, and return it. All choices (segments,
    terms, parameters) are made again, as cross-validation requires.
    """
    return refit_near(part, dataset, None, model_of)[0]


def refit_near(
    part: ModelChoices,
    dataset: Dataset,
    near: FitResult | None,
    model_of: Callable[[str], Model] = added_up,
) -> tuple[Model, FitResult]:
    """Do the same as `refit`, and return the model and its fit. If `near` is not None, the search
    for parameters begins at the parameters of this fit.
    """
    from mapmore_cli.fitting.kinds.pieces import segmented

    given = Given(dataset, segmented(dataset, part), model_of, near=near)
    result = fit(part, given)
    return build(part, given, result), result
