"""Settings against each other by training data alone: models that were made without some of it, and what they say of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, TypedDict, Unpack

import numpy as np

from mapmore_cli.domain.errors import FitError, MapmoreError, SpecError, UsageError
from mapmore_cli.domain.processors import shared_out
from mapmore_cli.domain.results import Search
from mapmore_cli.domain.scores import Trial, Tuning
from mapmore_cli.fitting.kinds import maker_of
from mapmore_cli.fitting.kinds.choices import ModelChoices, model_choices
from mapmore_cli.fitting.refitting import refitted
from mapmore_cli.fitting.stage import Progress, Warn
from mapmore_cli.fitting.trials import Bench, bench_of, errors_of, training_only
from mapmore_cli.ingestion.files import slice_of
from mapmore_cli.modelling.kinds import parameters
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.modelling.validation.significance import simplest_of
from mapmore_cli.pipeline.runner import FOUND, SEARCH_STAGE, OnStage, bring_up_to_date, search_stages
from mapmore_cli.pipeline.search import SEARCH, as_found, read_search
from mapmore_cli.spec.layers import as_overrides
from mapmore_cli.spec.loader import LoadedSpec, load
from mapmore_cli.storage.atomic import write_text
from mapmore_cli.storage.run_folder import RunFiles


class Listeners(TypedDict):
    """What is told of the work, as `bring_up_to_date` takes it."""

    progress: Progress
    warn: Warn
    on_stage: OnStage


def tune(loaded: LoadedSpec, over: Mapping[str, Sequence[Any]], runs: Path, **listeners: Unpack[Listeners]) -> Tuning:
    """Try every combination of settings (`over`, by their place in the spec) on training data that its models were made without.

    The data are ingested in the folder of the run; nothing else is written. Held-out samples are dropped before anything is computed.

    Raises UsageError where a setting changes the data, so that errors could not be compared; SpecError, DataError, FitError where the spec
    is wrong with some setting, or no combination can be fitted.
    """
    variants = list(_variants(loaded, over))
    outcome = bring_up_to_date(loaded, runs, "ingest", **listeners)
    dataset = training_only(RunFiles(outcome.run_dir).dataset())
    split, levels = loaded.spec.data.split, loaded.spec.data.levels
    held = levels is not None and (split.leave_one_level_out or (split.hold_out is not None and levels.of in split.hold_out.quantities))
    bench = bench_of(dataset, model_choices(loaded.spec), loaded.spec.validation.normaliser, held)
    trials = shared_out(lambda variant: _tried(*variant, bench), variants, partial(listeners["progress"], "combinations"))
    return _ranked(loaded.spec.name, bench, trials)


def _variants(loaded: LoadedSpec, over: Mapping[str, Sequence[Any]]) -> Iterator[tuple[dict[str, Any], ModelChoices]]:
    for values in product(*over.values()):
        settings = dict(zip(over, values, strict=True))
        spec = load(loaded.path, (*loaded.overrides, *as_overrides(settings))).spec
        if slice_of(spec) != slice_of(loaded.spec):
            what = f"--over {', '.join(over)}: changes the data, so that errors could not be compared"
            raise UsageError(what, "tune how the model is made of them")
        choices = model_choices(spec)
        if maker_of(choices).refit is None:
            raise SpecError(f"{loaded.path}: a sum of other runs has no settings of its own", "tune the specs that it adds up")
        yield settings, choices


def _tried(settings: Mapping[str, Any], choices: ModelChoices, bench: Bench) -> Trial:
    """Return the errors on the folds, of models that were made without them; where a fit fails, why."""
    try:
        size = parameters(refitted(choices, bench.dataset))
        errors = errors_of(choices, bench, refitted)
    except MapmoreError as fault:
        return Trial(settings, failure=fault.message)
    lost = sum(not np.isfinite(error) for error in errors)
    if lost:
        return Trial(settings, size, failure=f"no finite prediction on {lost} of {len(errors)} folds")
    return Trial(settings, size, tuple(errors), float(np.mean(errors)))


def _ranked(name: str, bench: Bench, trials: Sequence[Trial]) -> Tuning:
    """Return the trials with what they err beyond the best, and the simplest within one standard error.

    Raises FitError where none of them could be fitted.
    """
    usable = [number for number, trial in enumerate(trials) if trial.errors]
    if not usable:
        raise FitError(f"{name}: no combination could be fitted without some of the data: {trials[0].failure}", "try simpler settings")
    rank = simplest_of([trials[i].parameters for i in usable], np.array([trials[i].errors for i in usable]))
    told = list(trials)
    for place, number in enumerate(usable):
        told[number] = replace(trials[number], excess=float(rank.excess[place]), spread=float(rank.spread[place]))
    return Tuning(name, bench.left_out, bench.full_scale, tuple(told), told[usable[rank.best]], told[usable[rank.chosen]])


def searched(loaded: LoadedSpec, runs: Path, budget: str | None, **listeners: Unpack[Listeners]) -> tuple[Search, Path]:
    """Search the structure of a study, whatever its spec says of it; return what was tried, and the spec that was found.

    Raises SpecError, DataError or FitError where the data cannot be read, or no structure can be fitted.
    """
    asked: dict[str, Any] = {"model.type": AUTO}
    if loaded.spec.model.type != AUTO:
        asked = {"dictionary": None, "segment": None, "fit": None, "model": {"type": AUTO}}
    if budget is not None:
        asked["model.budget"] = budget
    loaded = load(loaded.path, (*loaded.overrides, *as_overrides(asked)))
    outcome = bring_up_to_date(loaded, runs, SEARCH_STAGE, stages=search_stages(), **listeners)
    path = outcome.run_dir / FOUND
    write_text(path, as_found(loaded, outcome.run_dir).resolved_in(outcome.run_dir, given_only=True))
    return read_search(outcome.run_dir / SEARCH), path
