"""Plan which level, or which points of a map, to measure next."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Unpack

import numpy as np

from mapmore_cli.annexes.planning.folds import training_only
from mapmore_cli.annexes.planning.of_points import Planned, check_prices, of_points
from mapmore_cli.annexes.planning.results import Candidate, Picture, Plan
from mapmore_cli.annexes.planning.tuning import refuse_several_targets
from mapmore_cli.domain.errors import DataError, SpecError, UsageError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.fitting.kinds.choices import ModelChoices, model_choices
from mapmore_cli.pipeline.runner import (
    Listeners,
    bring_up_to_date,
)
from mapmore_cli.pipeline.staleness import as_found
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.study.loader import LoadedSpec

EQUAL = (
    "On measured muscles, equal distances gave smaller errors than a random order of levels "
    "(docs/planning.md)."
)


def plan(
    loaded: LoadedSpec,
    runs: Path,
    *,
    points: int | None,
    until: str | None,
    prices: Mapping[str, float],
    **listeners: Unpack[Listeners],
) -> Plan:
    """Rank possible measurements: levels if the study has some; otherwise, or with `points`, points
    of a map.

    The data are ingested in the folder of the run. If the spec leaves the structure to a search,
    the search and the fit of the model also run there. Nothing else is written. Held-out values are
    not used. `until` is the wanted half width, in per cent of the largest |target| (`2%`) or in the
    target's unit; `prices` holds the cost of a change of each quantity.

    Raises SpecError for a model that runs over time and for a sum of other runs. Raises DataError
    if there is too little to plan with (a single level, or a single place). Raises UsageError if
    `until` is malformed, if `until` is given although the plan is for levels, or if there is a
    price for a quantity that the plan does not choose.
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
                "--until: the number of further measurements can be forecast for points only, but "
                "this study has levels",
                "add, for example, `--points 5` to plan points, or leave out --until",
            )
        planned = _of_levels(loaded.spec.name, whole, prices)
    else:
        planned = of_points(choices, whole, points or 5, wanted, prices)
    quantities = {name: dataset.quantities[name] for name in planned[0][0].at}
    return Plan(loaded.spec.name, dataset.quantities[dataset.target], quantities, largest, *planned)


def _plannable(loaded: LoadedSpec) -> ModelChoices:
    """Return the settings of the model of a study. Raises SpecError if levels or points cannot be
    left out of its fit.
    """
    refuse_several_targets(loaded)
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
            f"--until {text}: is not a half width of an interval",
            "write, for example, `--until 2%`, or a number in the target's unit",
        )
    return value * largest / 100 if percent else value


def _of_levels(name: str, whole: Dataset, prices: Mapping[str, float]) -> Planned:
    """Return the middles of the gaps between levels, the widest gap first. Levels whose data are
    held out have been measured, so they are treated like all other levels.
    """
    level = str(whole.level)
    check_prices(prices, (level,))
    places = np.unique([curve.level for curve in whole.curves if curve.level is not None])
    if len(places) < 2:
        raise DataError(
            f"{name}: there is only one level of {level}",
            "a plan fills gaps between levels: measure the lowest and the highest level first",
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
