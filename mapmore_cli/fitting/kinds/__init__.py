"""From sections of the spec to models: one file for each kind of model, found by the name of the kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
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
    the models of other runs are needed: there, `refit_parts` does, given their models by the path of their specs.
    """

    fit: Callable[[FitChoices, Dataset, Workspace], FitResult]
    build: Callable[[ModelChoices, Dataset, Workspace], Model]
    refit: Callable[[ModelChoices, Dataset], Model] | None = None
    refit_parts: Callable[[ModelChoices, Dataset, Callable[[str], Model]], Model] | None = None


def maker_of(part: FitChoices) -> Maker:
    """Return how the model of a study is made, by the file of its kind; only what that takes is imported."""
    found = import_module(f"{__name__}.{part.kind}")
    return Maker(found.fit, found.build, getattr(found, "refit", None), getattr(found, "refit_parts", None))
