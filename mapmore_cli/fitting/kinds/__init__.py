"""From sections of the spec to models: one file for each kind of model, found by the name of the kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mapmore_cli.domain.models import Model
    from mapmore_cli.domain.recording import Dataset
    from mapmore_cli.domain.results import FitResult
    from mapmore_cli.fitting.kinds.choices import FitChoices, ModelChoices
    from mapmore_cli.fitting.stage import Workspace


@dataclass(frozen=True)
class Maker:
    """How a kind is fitted (the fit stage), and how the model is made of the fits (the fuse stage).

    `refit` does all of it in one go on the training samples of another dataset, as cross-validation does, every choice included; None where
    the models of other runs are needed: there, `refit_parts` does, given the folders of these runs.
    """

    fit: Callable[[FitChoices, Dataset, Workspace], FitResult]
    build: Callable[[ModelChoices, Dataset, Workspace], Model]
    refit: Callable[[ModelChoices, Dataset], Model] | None = None
    refit_parts: Callable[[ModelChoices, Dataset, Mapping[str, Path]], Model] | None = None


def maker_of(part: FitChoices) -> Maker:
    """Return how the model of a study is made, by the file of its kind; only what that takes is imported."""
    found = import_module(f"{__name__}.{part.kind}")
    return Maker(found.fit, found.build, getattr(found, "refit", None), getattr(found, "refit_parts", None))


def refitted(choices: ModelChoices, dataset: Dataset) -> Model:
    """Return the model of the training samples of a dataset, made in one go, its number of terms included where left-out data choose it.

    Raises SpecError where the model is a sum of those of other runs.
    """
    from mapmore_cli.domain.errors import SpecError
    from mapmore_cli.fitting.kinds.choices import size_of, with_terms

    refit = maker_of(choices).refit
    if refit is None:
        raise SpecError("a sum of the models of other runs is not fitted itself", "do this with the specs that it adds up")
    return refit(with_terms(choices, size_of(choices, dataset).terms), dataset)
