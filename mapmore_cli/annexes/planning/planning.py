"""Compare settings and plan measurements, using training data only, with models that were fitted
without some of it.
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
from mapmore_cli.annexes.planning.points import (
    Committee,
    MeasuredMap,
    next_points,
    picture,
    spread_out,
)
from mapmore_cli.annexes.planning.points import (
    until as more_points,
)
from mapmore_cli.annexes.planning.results import Candidate, Picture, Plan, Trial, Tuning, Until
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError, FitError, MapmoreError, SpecError, UsageError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import Search
from mapmore_cli.fitting.kinds import refit
from mapmore_cli.fitting.kinds.choices import ModelChoices, model_choices
from mapmore_cli.ingestion.files import slice_of
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.kinds import parameters
from mapmore_cli.modelling.literature.backbone import fit_formula, pooled_training
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.modelling.validation.significance import simplest_of
from mapmore_cli.pipeline.processors import shared_out
from mapmore_cli.pipeline.runner import (
    FOUND,
    Listeners,
    bring_up_to_date,
)
from mapmore_cli.pipeline.staleness import as_found
from mapmore_cli.storage.atomic import write_text
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.storage.run_record import SEARCH_STAGE
from mapmore_cli.study.loader import LoadedSpec, load
from mapmore_cli.study.yaml_loader import as_overrides


def tune(
    loaded: LoadedSpec,
    over: Mapping[str, Sequence[Any]],
    runs: Path,
    **listeners: Unpack[Listeners],
) -> Tuning:
    """Compare every combination of settings (`over`, by their place in the spec) on training data
    that are left out of the fits.

    The data are ingested in the folder of the run; nothing else is written. Held-out samples are
    dropped before anything is computed.

    Raises UsageError if a setting changes the data, because errors could then not be compared;
    SpecError, DataError or FitError if the spec is invalid with a setting, or if no combination can
    be fitted.
    """
    _of_one_target(loaded)
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
    """Fit models with some settings without each fold, and return their errors on the fold. If a
    fit fails, return the reason.
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
    """Return the trials with their difference from the best, and the simplest within one standard
    error.

    Raises FitError if none of them could be fitted.
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
    """Search the structure of a study, whatever its spec says about it; return the structures that
    were tried, and the spec that was found.

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
    write_text(
        path, as_found(loaded, outcome.run_dir).resolved_in(outcome.run_dir, given_only=True)
    )
    search = RunFiles(outcome.run_dir).search()
    assert search is not None
    return search, path


COMMITTEE = ("sarosi_hinged", "sarosi")
"""Formulas of the committee, if the study has their inputs. A process without a formula belongs to
it too.
"""

ASTRAY = 2.0
"""A formula is no member of the committee if its range over the map (including the measured values)
exceeds the range of the measured values by this factor.
"""

STEPS = {1: 201, 2: 41, 3: 13}
"""Steps of the grid along each input, by the number of inputs."""

EQUAL = "On measured muscles, no rule was better than equal distances (docs/planning.md)."
MAP = (
    "On six measured maps, the error with such points was 0.3 to 1.2 times that with evenly spread "
    "points, 0.84 times on average (docs/planning.md)."
)
HALVES = "Half widths are right on average; a single one can be wrong by a factor of up to three."


Planned = tuple[tuple[Candidate, ...], Picture, Until | None, tuple[str, ...]]
"""Parts of a plan: the candidates, the best first; the half widths; the forecast, or None; and
notes.
"""


def plan(
    loaded: LoadedSpec,
    runs: Path,
    *,
    points: int | None = None,
    until: str | None = None,
    prices: Mapping[str, float],
    **listeners: Unpack[Listeners],
) -> Plan:
    """Rank possible measurements: levels if the study has some; otherwise, or with `points`, points
    of a map.

    The data are ingested in the folder of the run; nothing else is written. Held-out values are not
    used. `until` is the wanted half width, in per cent of the largest |target| (`2%`) or in the
    target's unit; `prices` holds the cost of a change of each quantity.

    Raises SpecError for a model that runs over time, and a sum of other runs; DataError if there is
    too little to plan with (a single level, or a single place); UsageError if `until` is no size or
    levels are planned, or if a price is for a quantity that the study does not set.
    """
    searched = loaded.spec.model.type == "auto"
    if not searched:
        _plannable(loaded)
    outcome = bring_up_to_date(loaded, runs, "fuse" if searched else "ingest", **listeners)
    loaded = as_found(loaded, outcome.run_dir)
    choices = _plannable(loaded)
    whole = RunFiles(outcome.run_dir).dataset()
    dataset = training_only(whole)
    largest = max(float(np.abs(curve.columns[dataset.target]).max()) for curve in dataset.curves)
    wanted = None if until is None else _size_of(until, largest)
    if dataset.level is not None and points is None:
        if wanted is not None:
            raise UsageError(
                "--until: no forecast is possible for levels",
                "add, for example, `--points 5`, or leave out --until",
            )
        planned = _of_levels(loaded.spec.name, whole, prices)
    else:
        planned = _of_points(choices, whole, points or 5, wanted, prices)
    quantities = {name: dataset.quantities[name] for name in planned[0][0].at}
    return Plan(loaded.spec.name, dataset.quantities[dataset.target], quantities, largest, *planned)


def _of_one_target(loaded: LoadedSpec) -> None:
    if loaded.spec.also:
        raise UsageError(
            f"{loaded.path}: only specs with one target can be tuned or planned",
            f"add `--set target={loaded.spec.target_quantity}`",
        )


def _plannable(loaded: LoadedSpec) -> ModelChoices:
    """Return the settings of the model of a study. Raises SpecError if levels or points cannot be
    left out of its fit.
    """
    _of_one_target(loaded)
    choices = model_choices(loaded.spec)
    if choices.over_time:
        raise SpecError(
            f"{loaded.path}: a model over time has no levels or points to measure next",
            "plan with a static study",
        )
    if choices.kind == "sum":
        raise SpecError(
            f"{loaded.path}: a sum of other runs has no measurements of its own",
            "plan with the specs of its parts",
        )
    return choices


def _size_of(text: str, largest: float) -> float:
    """Return a half width in the target's unit: `2%` of the `largest` |target|, or a number. Raises
    UsageError for anything else.
    """
    number, percent = text.strip().removesuffix("%"), text.strip().endswith("%")
    try:
        value = float(number)
    except ValueError:
        value = float("nan")
    if not 0 < value < float("inf"):
        raise UsageError(
            f"--until {text}: is not a half width",
            "write, for example, `--until 2%`, or a number in the target's unit",
        )
    return value * largest / 100 if percent else value


def _checked(prices: Mapping[str, float], names: Sequence[str]) -> None:
    if wrong := next((name for name in prices if name not in names), None):
        raise UsageError(
            f"--cost {wrong}: the plan does not choose this quantity",
            f"name one of {', '.join(names)}",
        )


def _of_levels(name: str, whole: Dataset, prices: Mapping[str, float]) -> Planned:
    """Return the middles of the gaps between levels, the widest first; held-out levels count as
    measured.
    """
    level = str(whole.level)
    _checked(prices, (level,))
    places = np.unique([curve.level for curve in whole.curves if curve.level is not None])
    if len(places) < 2:
        raise DataError(
            f"{name}: there is only one level of {level}",
            "measure its lowest and its highest value first",
        )
    order = np.argsort(-np.diff(places), kind="stable")
    middles = tuple(
        Candidate(
            {level: float(places[i : i + 2].mean())}, "between", gap=float(np.diff(places)[i])
        )
        for i in order
    )
    low, high = places[order[0] : order[0] + 2]
    why = f"No gap between levels is wider than that from {low:g} to {high:g}. {EQUAL}"
    unknown = np.full(len(places), np.nan)
    return middles, Picture({level: places}, unknown, unknown, {level: places}), None, (why,)


def _of_points(
    choices: ModelChoices,
    whole: Dataset,
    count: int,
    wanted: float | None,
    prices: Mapping[str, float],
) -> Planned:
    """Return the next points to measure. None of them is at a place that was measured already, even
    if the sample there is held out.
    """
    name, dataset = choices.name, training_only(whole)
    columns = pooled_training(dataset.curves)
    inputs = refit(choices, dataset).input_names
    names = tuple(quantity for quantity in inputs if np.ptp(columns[quantity]) > 0)
    if not names:
        raise DataError(
            f"{name}: all training samples have the same inputs", "measure a second place first"
        )
    if len(names) > max(STEPS):
        raise SpecError(
            f"{name}: a plan is possible for few inputs only, and this map has {len(names)}",
            f"plan with at most {max(STEPS)} inputs",
        )
    _checked(prices, names)
    x, y = spread_out(
        np.column_stack([columns[quantity] for quantity in names]), columns[dataset.target]
    )
    measured = MeasuredMap(names, x, y)
    steps = STEPS[len(names)]
    places = measured.grid(steps)
    known = [
        np.concatenate([curve.columns[quantity] for curve in whole.curves]) for quantity in names
    ]
    free = measured.unmeasured(places, np.column_stack(known), steps)
    if not free.any():
        raise DataError(
            f"{name}: all places of a grid of {steps} steps have been measured",
            "extend a range, or measure the same places again",
        )
    formulas = formulas_of(dataset, measured, places)

    planned = Committee(measured, places, formulas)
    next_ones, halves = next_points(planned, names, count, prices, free)
    notes = (*([MAP] if len(names) == 2 else []), HALVES)
    until = None
    if wanted is not None:
        until = more_points(Committee(measured, places, formulas), wanted)
    return next_ones, picture(planned, measured, halves), until, notes


def formulas_of(
    dataset: Dataset, measured: MeasuredMap, places: Array
) -> dict[str, tuple[Array, Array]]:
    """Return the predictions of each member of the committee at the measured points and at the
    places; an empty mapping if there is none.

    A formula that deviates from the measured values by more than their range, as can happen with
    few points, is no member.
    """
    members = {"none": (np.zeros(len(measured.y)), np.zeros(len(places)))}
    for name in COMMITTEE:
        if set(literature.get(name).inputs) != set(measured.names) or dataset.target != "force":
            continue
        try:
            fit = fit_formula(name, dataset.curves, dataset.target)
        except (DataError, FitError):
            continue
        if not fit.failed:
            columns = (dict(zip(measured.names, at.T, strict=True)) for at in (measured.x, places))
            at_measured, at_places = (
                literature.of(fit).predict(fit.parameters, inputs) for inputs in columns
            )
            if np.ptp(np.append(measured.y, at_places)) <= ASTRAY * np.ptp(measured.y):
                members[name] = (at_measured, at_places)
    return members
