"""Cross-validation over levels, recordings or blocks: what models of the rest say of the data that
were left out of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import DataError, FitError, SpecError
from mapmore_cli.domain.models import LeftOut, LeftOutKind, Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.results import Forecast
from mapmore_cli.domain.scores import OWN
from mapmore_cli.fitting import refitting
from mapmore_cli.fitting.competitors import Contest, Forecasts
from mapmore_cli.fitting.kinds.choices import ModelChoices, model_choices
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.pieces.cross_validation import BLOCKS, block, in_curve
from mapmore_cli.modelling.validation.intervals import Training, left_out_summary
from mapmore_cli.spec.loader import load
from mapmore_cli.storage.run_folder import RunFiles

if TYPE_CHECKING:
    from mapmore_cli.fitting.stage import Progress

LEAST_PARTS = 3
"""With fewer levels or recordings, blocks of all of them are left out."""

Said = dict[str, Forecasts]
"""What models say of every curve, by their names."""

Compare = Callable[[Contest], tuple[Said, Sequence[str]]]
"""What every model of a comparison says, but those whose fit failed, and what the user is to be
warned of.
"""


def left_out(
    choices: ModelChoices,
    contest: Contest,
    compare: Compare,
    progress: Progress,
    fitted_to: str,
    group: str | None = None,
) -> tuple[Dataset, Said, list[str]]:
    """Return the dataset with every sample held out, what models of the other levels say of each
    curve, and warnings.

    With `group`, the quantity that tells groups apart, each group is left out in place of a level.
    Everything is fitted anew without it: cuts, terms, backbone, how much of its residual is
    trusted, and every competitor. The run's own model is `fitted_to` a quantity, which need not be
    the one that is scored. A model that fails without some level is left out.
    """
    dataset = contest.dataset
    every = _levels(dataset) if group is None else _groups(dataset, group)

    def without(outs: Sequence[BoolArray]) -> tuple[Said, Sequence[str]]:
        fold = replace(
            dataset,
            curves=tuple(
                replace(c, held_out=out) for c, out in zip(dataset.curves, outs, strict=True)
            ),
        )
        model = refitted(choices, replace(fold, target=fitted_to))
        said, warnings = compare(replace(contest, dataset=fold, model=model, refit=refit_run))
        return {OWN: _own(model, fold), **said}, warnings

    found = []
    for outs in every:
        found.append(without(outs))
        progress(f"{'levels' if group is None else 'groups'} left out", len(found), len(every))
    whole = replace(
        dataset,
        curves=tuple(replace(c, held_out=np.ones(c.size, dtype=np.bool_)) for c in dataset.curves),
    )
    names = [name for name in found[0][0] if all(name in said for said, _ in found)]
    joined = {name: _joined([said[name] for said, _ in found], every) for name in names}
    return whole, joined, [warning for _, warnings in found for warning in warnings]


def _levels(dataset: Dataset) -> list[list[BoolArray]]:
    """For every level, which samples of each curve are at it."""
    levels = dict.fromkeys(curve.level for curve in dataset.curves)
    return [
        [np.full(curve.size, curve.level == level) for curve in dataset.curves] for level in levels
    ]


def _groups(dataset: Dataset, of: str) -> list[list[BoolArray]]:
    """For every value of the quantity, which samples of each curve have it; DataError for a single
    one.
    """
    values = np.unique(np.concatenate([curve.columns[of] for curve in dataset.curves]))
    if len(values) < 2:
        raise DataError(
            f"split.leave_one_group_out: {of} is {values[0]:g} in all recordings",
            "name what tells them apart in `data.groups`",
        )
    return [[curve.columns[of] == value for curve in dataset.curves] for value in values]


def refitted(choices: ModelChoices, dataset: Dataset) -> Model:
    """Return a model of the training samples of a dataset, made in one go."""
    if choices.kind == "sum" or choices.over_time:
        raise SpecError(
            "split.leave_one_level_out: a model over time cannot be fitted without a level",
            "hold out recordings instead",
        )
    return refitting.refitted(choices, dataset)


def residuals(
    choices: ModelChoices,
    dataset: Dataset,
    needed: Mapping[str, Path],
    progress: Progress,
    model: Model,
) -> LeftOut:
    """Return how models of the rest, everything fitted anew, miss each part of the training data
    that the `model` has.

    `needed` are the folders of the runs that a sum adds up, which are fitted anew as well. Held-out
    data are in nothing of it.

    Raises SpecError where runs are added up that were trained on fewer than three levels or
    recordings; DataError, FitError where a model cannot be fitted without a part, or has no
    prediction for it; the part is named.
    """
    kind, count, folds = parts_of(dataset, choices)
    if kind == "blocks" and needed:
        found = (
            "the runs that are added up can be fitted anew without a level or a recording, "
            "and there are fewer than three"
        )
        raise SpecError(
            f"validate.intervals: {found}", "leave it out, or ask for the intervals of the parts"
        )

    def missed(name: str, outs: tuple[BoolArray, ...]) -> tuple[list[Array], float]:
        try:
            every = refitting.left_out_of(
                dataset, outs, lambda rest: made_anew(choices, rest, needed)
            )
        except (DataError, FitError) as error:
            raise type(error)(
                f"validate.intervals: without {name}, {error.message}",
                "leave it out, or change what that fit needs",
            ) from error
        said = np.concatenate([found.values[out & found.ready] for _, out, found in every])
        beyond = max(
            0.0, float(np.max(said - high, initial=0.0)), float(np.max(low - said, initial=0.0))
        )
        return [
            (curve.columns[dataset.target] - found.values)[out & found.ready]
            for curve, out, found in every
        ], beyond

    low, high = _training_span(dataset)
    astray = 0.0
    errors: dict[str, list[Array]] = {}
    for part in folds.items():
        errors[part[0]], beyond = missed(*part)
        astray = max(astray, beyond / (high - low) if high > low else 0.0)
        progress(f"{kind} left out", len(errors), len(folds))
    return left_out_summary(kind, count, errors, _training(dataset, model, astray))


def _training_span(dataset: Dataset) -> tuple[float, float]:
    y = np.concatenate([curve.columns[dataset.target][curve.training] for curve in dataset.curves])
    return float(y.min()), float(y.max())


def _training(dataset: Dataset, model: Model, astray: float) -> Training:
    """Return what intervals with few levels need of the training data."""
    at: dict[float, int] = {}
    for curve in dataset.curves:
        if curve.level is not None and curve.training.any():
            at[curve.level] = at.get(curve.level, 0) + len(curve.recordings)
    missed = []
    for curve in dataset.curves:
        said = forecast(model, curve)
        missed.append((curve.columns[dataset.target] - said.values)[curve.training & said.ready])
    residual = np.concatenate(missed)
    return Training(
        tuple(sorted(at)),
        tuple(at[level] for level in sorted(at)),
        max(map(abs, _training_span(dataset))),
        float(np.sqrt(np.mean(residual[np.isfinite(residual)] ** 2)))
        if np.isfinite(residual).any()
        else 0.0,
        astray,
    )


def parts_of(
    dataset: Dataset, choices: ModelChoices
) -> tuple[LeftOutKind, int, dict[str, tuple[BoolArray, ...]]]:
    """Return what is left out of the training data in turn, how many such parts train, and each
    part's name and samples of every curve.

    They are the inner levels, since within its training range a new curve lies between two others;
    recordings where there are no levels; of a family, specimens;
    blocks of all recordings where there are fewer than `LEAST_PARTS` of either. The samples of a
    plateau, which do not train, are a part of their level or recording, since they are predicted
    and scored.
    """
    known = [~curve.held_out for curve in dataset.curves]
    names = [_part(dataset, curve) for curve in dataset.curves]
    fixed = choices.fit.train_level
    if choices.model.family is not None:
        of = choices.model.family.of
        values = np.unique(
            np.concatenate(
                [curve.columns[of][rows] for curve, rows in zip(dataset.curves, known, strict=True)]
            )
        )
        if len(values) < LEAST_PARTS:
            raise DataError(
                f"validate.intervals: each specimen is left out in turn, and {len(values)} "
                f"{'is' if len(values) == 1 else 'are'} too few",
                "leave it out, or add recordings of a third specimen",
            )
        specimens = {
            f"{of}={value:g}": tuple(
                rows & (c.columns[of] == value)
                for c, rows in zip(dataset.curves, known, strict=True)
            )
            for value in values
        }
        return "specimens", len(values), specimens
    trains = [
        number
        for number, curve in enumerate(dataset.curves)
        if curve.training.any() and curve.level != fixed
    ]
    if dataset.level is not None:
        trains.sort(key=lambda number: dataset.curves[number].level or 0.0)
    parts = list(dict.fromkeys(names[number] for number in trains))
    if len(parts) >= LEAST_PARTS:
        out = parts if dataset.level is None else parts[1:-1]
        masks = {
            part: tuple(rows & (name == part) for name, rows in zip(names, known, strict=True))
            for part in out
        }
        return ("recordings" if dataset.level is None else "levels"), len(parts), masks
    timed = all("time" in curve.columns for curve in dataset.curves)
    along = (
        "time"
        if timed
        else in_curve(dataset.curves, tuple(choices.segment), dataset.target, dataset.level)
    )
    number = range(BLOCKS) if timed else range(1, BLOCKS - 1)
    return (
        "blocks",
        BLOCKS,
        {
            f"block {n + 1} of {BLOCKS}": tuple(block(curve, along, n) for curve in dataset.curves)
            for n in number
        },
    )


def _part(dataset: Dataset, curve: Curve) -> str:
    return (
        dataset.logs.get(curve.recordings[0], curve.id)
        if curve.level is None
        else f"{dataset.level}={curve.level:g}"
    )


def made_anew(choices: ModelChoices, dataset: Dataset, needed: Mapping[str, Path]) -> Model:
    """Return a model of any kind, made of the training samples of a dataset; `needed` are the
    folders of the runs that a sum adds up.
    """
    return refitting.refitted(choices, dataset, lambda path: _without(needed[path], dataset))


def _without(run_dir: Path, dataset: Dataset) -> Model:
    """Return the model of a run, fitted anew to its data without the curves that a dataset holds
    out as a whole: by level, else by name.
    """
    choices = model_choices(load(run_dir / "experiment.yaml").spec)
    if choices.summands:
        found = (
            f"{choices.name} adds runs up itself, and cannot be fitted anew without a part of "
            "the data"
        )
        raise SpecError(
            f"validate.intervals: {found}", "leave it out, or add up all runs in one spec"
        )
    own = RunFiles(run_dir).dataset()
    out = {_key(curve) for curve in dataset.curves if not curve.training.any()}
    curves = tuple(
        replace(c, held_out=np.ones(c.size, dtype=np.bool_)) if _key(c) in out else c
        for c in own.curves
    )
    return made_anew(choices, replace(own, curves=curves), {})


def _key(curve: Curve) -> float | str:
    return curve.id if curve.level is None else curve.level


def refit_run(run_dir: Path, dataset: Dataset) -> Model:
    """Return the model of another run, made anew by its own spec on the training samples of a
    dataset.
    """
    own_target = RunFiles(run_dir).dataset().target
    return refitted(
        model_choices(load(run_dir / "experiment.yaml").spec), replace(dataset, target=own_target)
    )


def _own(model: Model, dataset: Dataset) -> Forecasts:
    return tuple(forecast(model, curve, dataset.target) for curve in dataset.curves)


def _joined(parts: Sequence[Forecasts], folds: Sequence[Sequence[BoolArray]]) -> Forecasts:
    """Of each sample the forecast of the fold that it was left out of."""
    return tuple(
        _of_curve([said[number] for said in parts], [fold[number] for fold in folds])
        for number in range(len(parts[0]))
    )


def _of_curve(said: Sequence[Forecast], outs: Sequence[BoolArray]) -> Forecast:
    whole = next((one for one, out in zip(said, outs, strict=True) if out.all()), None)
    if whole is not None:
        return whole
    values, ready = (
        np.select(outs, [getattr(one, name) for one in said]) for name in ("values", "ready")
    )
    return Forecast.of(np.where(ready, values, np.nan))
