"""Compare settings or structures of a model. Each error is measured on training data that were left
out of the fit; held-out data are not used.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from mapmore_cli.annexes.planning.folds import (
    Folds,
    errors_of,
    folds_of,
    geometric_mean,
    training_only,
)
from mapmore_cli.annexes.planning.results import Trial, Tuning
from mapmore_cli.domain.errors import FitError, MapmoreError, SpecError, UsageError
from mapmore_cli.domain.results import Search
from mapmore_cli.fitting.kinds import refit
from mapmore_cli.fitting.kinds.choices import ModelChoices, model_choices
from mapmore_cli.ingestion.files import slice_of
from mapmore_cli.modelling.kinds import parameters
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.modelling.validation.significance import simplest_of
from mapmore_cli.pipeline.processors import shared_out
from mapmore_cli.pipeline.runner import Listeners, bring_up_to_date
from mapmore_cli.pipeline.staleness import FOUND
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.storage.run_record import SEARCH_STAGE
from mapmore_cli.study.loader import LoadedSpec, load
from mapmore_cli.study.yaml_dumper import as_overrides


def tune(
    loaded: LoadedSpec,
    over: Mapping[str, Sequence[Any]],
    runs: Path,
    **listeners: Unpack[Listeners],
) -> Tuning:
    """Compare every combination of settings (`over`, by their paths in the spec) on training data
    that are left out of the fits.

    The data are ingested in the folder of the run; nothing else is written. Held-out samples are
    dropped before anything is computed.

    Raises UsageError if a setting changes the data, because errors could then not be compared;
    SpecError, DataError or FitError if the spec is invalid with a setting, or if no combination can
    be fitted.
    """
    refuse_several_targets(loaded)
    variants = list(_variants(loaded, over))
    outcome = bring_up_to_date(loaded, runs, "ingest", **listeners)
    dataset = training_only(RunFiles(outcome.run_dir).dataset())
    split, levels = loaded.spec.data.split, loaded.spec.data.levels
    held = levels is not None and (
        split.leave_one_level_out
        or (split.hold_out is not None and levels.of in split.hold_out.quantities)
    )
    folds = folds_of(dataset, model_choices(loaded.spec), loaded.spec.validation.normaliser, held)
    trials = shared_out(
        lambda variant: _try_settings(*variant, folds),
        variants,
        partial(listeners["progress"], "combinations"),
    )
    return _ranked(loaded.spec.name, folds, trials)


def _variants(
    loaded: LoadedSpec, over: Mapping[str, Sequence[Any]]
) -> Iterator[tuple[dict[str, Any], ModelChoices]]:
    for values in product(*over.values()):
        settings = dict(zip(over, values, strict=True))
        spec = load(loaded.path, (*loaded.overrides, *as_overrides(settings))).spec
        if slice_of(spec) != slice_of(loaded.spec):
            raise UsageError(
                f"--over {', '.join(over)}: changes the data, so that errors could not be compared",
                "choose settings of the model instead",
            )
        choices = model_choices(spec)
        if choices.kind == "sum":
            raise SpecError(
                f"{loaded.path}: a sum of other runs has no settings of its own",
                "tune the specs of its parts",
            )
        yield settings, choices


def _try_settings(settings: Mapping[str, Any], choices: ModelChoices, folds: Folds) -> Trial:
    """Return the errors of a model with these settings: for each fold, the model is fitted without
    the samples of the fold, and its error is measured on these samples. If a fit fails, return the
    reason instead.
    """
    try:
        size = parameters(refit(choices, folds.dataset))
        errors = errors_of(folds, partial(refit, choices))
    except MapmoreError as fault:
        return Trial(settings, failure=fault.message)
    lost = sum(not np.isfinite(error) for error in errors)
    if lost:
        return Trial(
            settings, size, failure=f"no finite prediction on {lost} of {len(errors)} folds"
        )
    return Trial(settings, size, tuple(errors), geometric_mean(errors))


def _ranked(name: str, folds: Folds, trials: Sequence[Trial]) -> Tuning:
    """Return the comparison of the trials: each trial with its difference from the best trial, the
    best trial, and the simplest trial within one standard error of the best.

    Raises FitError if none of the settings could be fitted.
    """
    usable = [number for number, trial in enumerate(trials) if trial.errors]
    if not usable:
        raise FitError(
            f"{name}: no combination could be fitted with a part of the data left out: "
            f"{trials[0].failure}",
            "try simpler settings",
        )
    rank = simplest_of(
        [trials[i].parameters for i in usable], np.array([trials[i].errors for i in usable])
    )
    ranked = list(trials)
    for place, number in enumerate(usable):
        ranked[number] = replace(
            trials[number], excess=float(rank.excess[place]), spread=float(rank.spread[place])
        )
    return Tuning(
        name,
        folds.left_out,
        folds.full_scale,
        tuple(ranked),
        ranked[usable[rank.best]],
        ranked[usable[rank.chosen]],
    )


def searched(
    loaded: LoadedSpec, runs: Path, budget: str | None, **listeners: Unpack[Listeners]
) -> tuple[Search, Path]:
    """Search the structure of a study, even if the spec of the study gives a structure. Return the
    structures that were tried, and the path of the spec that was found.

    Raises SpecError, DataError or FitError if the data cannot be read, or if no structure can be
    fitted.
    """
    asked: dict[str, Any] = {"model.type": AUTO}
    if loaded.spec.model.type != AUTO:
        asked = {"dictionary": None, "segment": None, "fit": None, "model": {"type": AUTO}}
    if budget is not None:
        asked["model.budget"] = budget
    loaded = load(loaded.path, (*loaded.overrides, *as_overrides(asked)))
    outcome = bring_up_to_date(loaded, runs, SEARCH_STAGE, **listeners)
    path = outcome.run_dir / FOUND
    search = RunFiles(outcome.run_dir).search()
    assert search is not None
    return search, path


def refuse_several_targets(loaded: LoadedSpec) -> None:
    """Raise UsageError for a spec with several targets."""
    if loaded.spec.also:
        raise UsageError(
            f"{loaded.path}: only specs with one target can be tuned or planned",
            f"add `--set target={loaded.spec.target_quantity}`",
        )
