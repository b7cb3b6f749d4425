"""Cross-validate over levels, recordings or blocks: predict data with models that were fitted
without them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain import plugins
from mapmore_cli.domain.arrays import Array, BoolArray, extremes
from mapmore_cli.domain.errors import DataError, FitError, SpecError
from mapmore_cli.domain.models import LeftOut, LeftOutKind, Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.results import Forecast
from mapmore_cli.domain.scores import OWN
from mapmore_cli.fitting.competitors import Contest, Forecasts
from mapmore_cli.fitting.groups import regrouped
from mapmore_cli.fitting.kinds import refit
from mapmore_cli.fitting.kinds.choices import ModelChoices, model_choices
from mapmore_cli.fitting.refitting import FEWEST, Masks, folds_by_value, left_out_of, without
from mapmore_cli.modelling import kinds
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.pieces.cross_validation import BLOCKS, block, in_curve
from mapmore_cli.modelling.validation.intervals import left_out_summary, with_levels
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.storage.run_record import SEARCH_STAGE, load_records
from mapmore_cli.study.loader import load

if TYPE_CHECKING:
    from mapmore_cli.fitting.stage import Progress, Workspace

Said = dict[str, Forecasts]
"""Forecasts of every curve, for each model by its name."""

Compare = Callable[[Contest], tuple[Said, Sequence[str]]]
"""Function that returns the forecasts of every model of a comparison whose fit did not fail, and
warnings for the user.
"""


MOST_SEARCHES = 12
"""Largest number of structure searches in one cross-validation; each takes as long as the search of
the run.
"""


def choices_by_fold(
    run_dir: Path | None, choices: ModelChoices, dataset: Dataset, folds: Sequence[Masks]
) -> Callable[[int], ModelChoices]:
    """Return a function that takes the number of a fold, and returns the settings of the model for
    this fold.

    If the structure of the run was found by a search, the search is repeated without this fold.
    With more than `MOST_SEARCHES` folds, several folds share a search that leaves out all of them,
    so that no structure was chosen with the data on which it is scored.
    """
    again = None if run_dir is None else _searching_again(run_dir)
    if again is None:
        return lambda _number: choices

    @cache
    def searched(first: int) -> ModelChoices:
        outs = zip(*folds[first::MOST_SEARCHES], strict=True)
        rest = without(dataset, [np.logical_or.reduce(every) for every in outs])
        choices_of_fold = again(regrouped(rest))
        return replace(choices_of_fold, name=choices.name, signals=choices.signals)

    return lambda number: searched(number % MOST_SEARCHES)


def was_searched(run_dir: Path) -> bool:
    """Return True if the structure of a run was found by a search."""
    return SEARCH_STAGE in load_records(run_dir)


def _searching_again(run_dir: Path) -> Callable[[Dataset], ModelChoices] | None:
    """Return a function that repeats the structure search of a run on another dataset; None if the
    run had no search.
    """
    if not was_searched(run_dir):
        return None
    again: Callable[[Dataset], ModelChoices]
    again = plugins.load("stages", SEARCH_STAGE).searching_again(run_dir)
    return again


def left_out(
    choices: ModelChoices,
    contest: Contest,
    compare: Compare,
    workspace: Workspace,
    fitted_to: str,
    group: str | None = None,
) -> tuple[Dataset, Said, list[str]]:
    """Leave out each level once. Return the dataset with every sample held out, the forecasts of
    each curve by models that were fitted to the other levels, and warnings.

    With `group`, the quantity that distinguishes groups, each group is left out instead of a level.
    Every step is repeated without the left-out level or group: the effects of groups, the structure
    search if there is one, cuts, terms, backbone, the weight of the residual, and every competitor.
    The gain and the offset of its group are removed from a sample before it is scored; both are
    estimated in the fold that leaves the sample out. The run's own model predicts the quantity
    `fitted_to`. If the scored quantity is an input of the model instead, the model is inverted. A
    model whose fit fails without one of the levels is left out of the comparison.
    """
    refuse_over_time(choices)
    dataset = contest.dataset
    folds = folds_by_value(dataset, group)
    datasets, parts, warnings = list[Dataset](), list[Said](), list[str]()
    own_data = replace(dataset, target=fitted_to)
    made_by = choices_by_fold(workspace.run_dir, choices, own_data, folds)
    for number, outs in enumerate(folds):
        fold, own_choices = regrouped(_held_out(dataset, outs)), made_by(number)
        refuse_over_time(own_choices)
        model = refit(own_choices, replace(fold, target=fitted_to))
        outputs, fold_warnings = compare(
            replace(contest, dataset=fold, model=model, refit=refit_run)
        )
        forecasts = tuple(forecast(model, curve, fold.target) for curve in fold.curves)
        datasets.append(fold)
        parts.append({OWN: forecasts, **outputs})
        warnings += fold_warnings
        task = f"{'levels' if group is None else 'groups'} left out"
        workspace.progress(task, len(parts), len(folds))
    pooled = {
        name: _by_fold([outputs[name] for outputs in parts], folds)
        for name in parts[0]
        if all(name in outputs for outputs in parts)
    }
    return _scored(dataset, datasets, folds), pooled, warnings


def _held_out(dataset: Dataset, outs: Sequence[BoolArray]) -> Dataset:
    """Return the dataset with the samples in `outs` held out, and all other samples used for
    training.
    """
    curves = zip(dataset.curves, outs, strict=True)
    return replace(dataset, curves=tuple(replace(curve, held_out=out) for curve, out in curves))


def _scored(dataset: Dataset, datasets: Sequence[Dataset], folds: Sequence[Masks]) -> Dataset:
    """Return the dataset with every sample held out. If there are groups, the target of each sample
    is corrected by the gain and the offset of its group, as estimated in the fold that leaves the
    sample out.
    """
    everywhere = [np.ones(curve.size, dtype=np.bool_) for curve in dataset.curves]
    whole = _held_out(dataset, everywhere)
    if dataset.grouping is None:
        return whole
    target, curves = dataset.grouping.target, list[Curve]()
    for number, curve in enumerate(whole.curves):
        outs = [masks[number] for masks in folds]
        of_folds = [fold.curves[number].columns[target] for fold in datasets]
        curves.append(replace(curve, columns={**curve.columns, target: np.select(outs, of_folds)}))
    return replace(whole, curves=tuple(curves))


def _by_fold(parts: Sequence[Forecasts], folds: Sequence[Masks]) -> Forecasts:
    """Combine the forecasts of all folds. Every sample gets its value from the fold in which it was
    left out of the fit.
    """
    pooled = []
    for of_curve, outs in zip(zip(*parts, strict=True), zip(*folds, strict=True), strict=True):
        whole = next((each for each, out in zip(of_curve, outs, strict=True) if out.all()), None)
        values = np.select(list(outs), [each.values for each in of_curve])
        ready = np.select(list(outs), [each.ready for each in of_curve])
        pooled.append(whole or Forecast.of(np.where(ready, values, np.nan)))
    return tuple(pooled)


def refuse_over_time(choices: ModelChoices) -> None:
    """Raise SpecError for a sum of models or a model with memory, because these cannot be fitted
    again without a level.
    """
    if choices.kind == "sum" or choices.over_time:
        raise SpecError(
            "split.leave_one_level_out: a sum of models and a model that runs over time cannot be "
            "fitted again without a level",
            "hold out recordings instead",
        )


def refit_run(run_dir: Path, dataset: Dataset) -> Model:
    """Fit the model of another run again, with the spec of that run, to the training samples of a
    dataset, and return it.
    """
    again = _searching_again(run_dir)
    dataset = replace(dataset, target=RunFiles(run_dir).dataset().target)
    choices = again(dataset) if again else model_choices(load(run_dir / "experiment.yaml").spec)
    refuse_over_time(choices)
    return refit(choices, dataset)


MUCH = 0.1
"""Largest fraction of the held-out samples that may be equal to training samples of a model by
chance. With a larger fraction, the model is regarded as trained with the held-out samples.
"""


def trained_on(run_dir: Path, dataset: Dataset) -> bool:
    """Return True if the model of another run was trained with samples that a dataset holds out.

    Two samples are regarded as the same if all their numbers are equal. Samples that are also among
    the training samples of the dataset are ignored. The result is True only if more than the
    fraction `MUCH` of the held-out samples are found, because a few may be equal by chance.
    """
    curves, of_run = dataset.raw_curves, RunFiles(run_dir).dataset().raw_curves
    names = [name for name in curves[0].columns if name in of_run[0].columns]

    def rows(curves: Sequence[Curve], held_out: bool) -> list[bytes]:
        parts = [
            np.column_stack([curve.columns[name][mask] for name in names])
            for curve in curves
            for mask in (curve.held_out if held_out else curve.training,)
        ]
        return [row.tobytes() for row in np.concatenate(parts)]

    held = rows(curves, True)
    seen = {*rows(of_run, False)} - {*rows(curves, False)}
    return sum(row in seen for row in held) > MUCH * len(held)


def residuals(
    choices: ModelChoices,
    dataset: Dataset,
    needed: Mapping[str, Path],
    progress: Progress,
    model: Model,
    run_dir: Path | None = None,
) -> LeftOut:
    """Leave out each part of the training data in turn, fit everything again, and return the errors
    of the predictions of the left-out parts. These errors are an estimate of the errors of `model`
    on new data.

    `needed` holds the folders of the runs whose models are added; they are fitted again as well. If
    the structure of the model was found by a search (in `run_dir`), the search is repeated too. The
    held-out data of the study are never used.

    Raises SpecError for a sum of runs with fewer than three training levels or recordings;
    DataError or FitError, with the name of a part, if a model cannot be fitted without this part or
    cannot predict it.
    """
    kind, count, parts = parts_of(dataset, choices)
    made_by = choices_by_fold(run_dir, choices, dataset, [*parts.values()])
    if kind == "blocks" and needed:
        raise SpecError(
            "validate.intervals: a sum of models needs at least three levels or recordings "
            "that can be left out in turn, and there are fewer",
            "remove `intervals` here, or set it in the spec of each run that is part of the sum",
        )
    y = np.concatenate([curve.columns[dataset.target][curve.training] for curve in dataset.curves])
    errors: dict[str, list[Array]] = {}
    predictions: list[Array] = []
    for name, outs in parts.items():
        try:
            made = partial(_refitted_sum, made_by(len(errors)), needed)
            every = left_out_of(dataset, outs, made)
        except (DataError, FitError) as error:
            raise type(error)(
                f"validate.intervals: the fit without {name} failed: {error.message}",
                "remove `intervals`, or remove the cause of this failure",
            ) from error
        errors[name] = [
            (curve.columns[dataset.target] - output.values)[out & output.ready]
            for curve, out, output in every
        ]
        predictions += [output.values[out & output.ready] for _, out, output in every]
        progress(f"{kind} left out", len(errors), len(parts))
    return with_levels(
        replace(
            left_out_summary(kind, count, errors),
            largest=float(np.abs(y).max()),
            astray=share_beyond(np.concatenate(predictions), y),
        ),
        _training_residuals(dataset, model, choices.fit.train_level),
        kinds.parameters(model),
    )


def share_beyond(predictions: Array, targets: Array) -> float:
    """Return the largest distance by which predictions, (n,), lie outside the range of the training
    targets, (m,), as a fraction of this range; zero for a constant target.
    """
    low, high = extremes(targets)
    farthest = np.max(np.maximum(low - predictions, predictions - high), initial=0.0)
    return float(farthest / (high - low)) if high > low else 0.0


def _training_residuals(
    dataset: Dataset, model: Model, but: object
) -> dict[float | None, list[Array]]:
    """Return the training residuals of each recording, grouped by level. Samples without a
    prediction are left out, and so is the curve at the level `but`.
    """
    by_level: dict[float | None, list[Array]] = {}
    for curve in dataset.curves:
        output = forecast(model, curve)
        residual = curve.columns[dataset.target] - output.values
        known = curve.training & output.ready & np.isfinite(residual)
        logs = [residual[log][known[log]] for log in curve.logs]
        if known.any() and (curve.level is None or curve.level != but):
            by_level.setdefault(curve.level, []).extend(log for log in logs if len(log))
    return by_level


def parts_of(dataset: Dataset, choices: ModelChoices) -> tuple[LeftOutKind, int, dict[str, Masks]]:
    """Return the parts of the training data that are left out one after the other: their kind,
    their number, and for each part its name and its samples of every curve.

    If the curves have levels, each part is a level. The lowest and the highest level are not left
    out, because a new curve within the training range lies between two levels. Without levels, each
    part is a recording, or a specimen in the model of a family. If there are fewer than `FEWEST`
    levels or recordings, each part is a block of every recording. Samples on a plateau are not used
    for training, but they are left out together with their level or recording, because they are
    predicted and scored too.
    """
    if choices.model.family is not None:
        return _specimens(dataset, choices.model.family.of)
    curves, level = dataset.curves, dataset.level
    trains = [c for c in curves if c.training.any() and c.level != choices.fit.train_level]
    if level is not None:
        trains.sort(key=lambda curve: curve.level or 0.0)
    names = list(dict.fromkeys(_part_name(dataset, curve) for curve in trains))
    if len(names) >= FEWEST:
        masks = {
            name: tuple(~curve.held_out & (_part_name(dataset, curve) == name) for curve in curves)
            for name in (names if level is None else names[1:-1])
        }
        return "recordings" if level is None else "levels", len(names), masks
    timed = "time" in curves[0].columns
    along = "time" if timed else in_curve(curves, tuple(choices.segment), dataset.target, level)
    blocks = {
        f"block {number + 1} of {BLOCKS}": tuple(block(curve, along, number) for curve in curves)
        for number in (range(BLOCKS) if timed else range(1, BLOCKS - 1))
    }
    return "blocks", BLOCKS, blocks


def _specimens(dataset: Dataset, of: str) -> tuple[LeftOutKind, int, dict[str, Masks]]:
    values = np.unique(
        np.concatenate([curve.columns[of][~curve.held_out] for curve in dataset.curves])
    )
    if len(values) < FEWEST:
        raise DataError(
            f"validate.intervals leaves out one specimen at a time and needs {FEWEST} specimens; "
            f"the training data have {len(values)}",
            "remove `intervals`, or add recordings of a third specimen",
        )
    masks = {
        f"{of}={value:g}": tuple(~c.held_out & (c.columns[of] == value) for c in dataset.curves)
        for value in values
    }
    return "specimens", len(values), masks


def _part_name(dataset: Dataset, curve: Curve) -> str:
    """Return the name of the level or recording that a curve belongs to."""
    if curve.level is None:
        return dataset.logs.get(curve.recordings[0], curve.id)
    return f"{dataset.level}={curve.level:g}"


def _refitted_sum(choices: ModelChoices, needed: Mapping[str, Path], dataset: Dataset) -> Model:
    """Fit a model of any kind to the training samples of a dataset, and return it. If the model is
    a sum, the added models are fitted again; `needed` holds the folders of their runs.
    """
    return refit(choices, dataset, lambda path: _summand_without(needed[path], dataset))


def _summand_without(run_dir: Path, dataset: Dataset) -> Model:
    """Fit the model of a run again and return it. Curves that the given dataset holds out
    completely are left out of the run's own data. Curves are matched by level, or by name if there
    are no levels.
    """
    choices = model_choices(load(run_dir / "experiment.yaml").spec)
    if choices.summands:
        raise SpecError(
            f"validate.intervals: {choices.name} is itself a sum of runs, which cannot be "
            "fitted with a part of the data left out",
            "remove `intervals`, or add up all runs in one spec",
        )
    of_summand = RunFiles(run_dir).dataset()
    out = {_level_or_id(curve) for curve in dataset.curves if not curve.training.any()}
    masks = [
        np.ones(curve.size, dtype=np.bool_) if _level_or_id(curve) in out else curve.held_out
        for curve in of_summand.curves
    ]
    rest = regrouped(_held_out(of_summand, masks))
    again = _searching_again(run_dir)
    return refit(again(rest) if again else choices, rest)


def _level_or_id(curve: Curve) -> float | str:
    return curve.id if curve.level is None else curve.level
