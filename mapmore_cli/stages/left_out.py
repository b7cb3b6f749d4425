"""Cross-validation over the levels: what models of the other levels say of the one that was left out of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.scores import OWN
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.stages import kinds
from mapmore_cli.stages.competitors import Contest, Forecasts
from mapmore_cli.stages.kinds import maker_of
from mapmore_cli.stages.kinds.choices import ModelChoices

if TYPE_CHECKING:
    from mapmore_cli.stages.pipeline.stage import Progress

Compare = Callable[[Contest], dict[str, Forecasts]]
"""What every model of a comparison says of every curve; models whose fit failed are left out."""


def left_out(choices: ModelChoices, contest: Contest, compare: Compare, progress: Progress) -> tuple[Dataset, dict[str, Forecasts]]:
    """The dataset with every sample held out, and what models of the other levels say of each curve, by the name of the model.

    Everything is fitted anew without the level: cuts, terms, backbone, how much of its residual is trusted, and every competitor.
    """
    dataset = contest.dataset
    levels = list(dict.fromkeys(curve.level for curve in dataset.curves))
    found: dict[str, list[Forecasts]] = {}
    for number, level in enumerate(levels):
        fold = replace(dataset, curves=tuple(replace(c, held_out=np.full(c.size, c.level == level)) for c in dataset.curves))
        model = refitted(choices, fold)
        said = compare(replace(contest, dataset=fold, model=model, refit=refit_run))
        for name, forecasts in {OWN: _own(model, fold), **said}.items():
            found.setdefault(name, []).append(forecasts)
        progress("levels left out", number + 1, len(levels))
    whole = replace(dataset, curves=tuple(replace(c, held_out=np.ones(c.size, dtype=np.bool_)) for c in dataset.curves))
    folds = [levels.index(curve.level) for curve in dataset.curves]
    return whole, {name: _joined(parts, folds) for name, parts in found.items() if len(parts) == len(levels)}


def refitted(choices: ModelChoices, dataset: Dataset) -> Model:
    """A model of the training samples of a dataset, made in one go."""
    if maker_of(choices).refit is None or choices.over_time:
        raise SpecError("split.leave_one_level_out: a model over time cannot be fitted without a level", "hold out recordings instead")
    return kinds.refitted(choices, dataset)


def refit_run(run_dir: Path, dataset: Dataset) -> Model:
    """The model of another run, made anew by its own spec on the training samples of a dataset."""
    from mapmore_cli.spec.loader import load
    from mapmore_cli.stages.fuse import reads

    return refitted(reads(load(run_dir / "experiment.yaml").spec), dataset)


def _own(model: Model, dataset: Dataset) -> Forecasts:
    return tuple(forecast(model, curve) for curve in dataset.curves)


def _joined(parts: Sequence[Forecasts], folds: Sequence[int]) -> Forecasts:
    """Of each curve the forecast of the fold that it was left out of."""
    return tuple(parts[fold][number] for number, fold in enumerate(folds))
