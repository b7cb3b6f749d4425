"""Score the model of a run and its competitors on the same samples. This is the work of the stage
`validate`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, by_blocks, row_by_row
from mapmore_cli.domain.compared import Normaliser
from mapmore_cli.domain.errors import SpecError, Warn
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.results import Forecast, Validation
from mapmore_cli.domain.scores import OWN, REPEATABILITY, STRUCTURE_SEEN, Score
from mapmore_cli.fitting.competitors import Contest, Forecasts, Rival
from mapmore_cli.fitting.kinds.choices import ModelChoices
from mapmore_cli.fitting.left_out import Said, left_out, trained_on, was_searched
from mapmore_cli.fitting.stage import Progress, Workspace
from mapmore_cli.modelling.forecast import forecast_each, outside
from mapmore_cli.modelling.kinds import parameters
from mapmore_cli.modelling.validation.intervals import INTERVAL, half_widths_of
from mapmore_cli.modelling.validation.metrics import divisor, on_common_rows, score_rows
from mapmore_cli.modelling.validation.outliers import outliers
from mapmore_cli.modelling.validation.repeatability import repeated_cycles, repeats
from mapmore_cli.modelling.validation.residuals import alarms
from mapmore_cli.modelling.validation.shown import for_report
from mapmore_cli.pipeline.scores_slice import ScoresSlice
from mapmore_cli.reporting.fit_tables import rival_minima
from mapmore_cli.reporting.sections import shown_by
from mapmore_cli.storage.artefacts import write_validation
from mapmore_cli.storage.run_folder import VALIDATION
from mapmore_cli.storage.scores import write_scores


def score(part: ScoresSlice, workspace: Workspace) -> None:
    """Fit the competitors to the training data of the model, predict every sample with all models,
    and compute the scores. This is done for each output.
    """
    dataset, model = workspace.files.dataset(), workspace.files.model()
    validations = [
        _scored(
            replace(part, target=curves.target) if dataset.also else part,
            workspace,
            curves,
            own_model,
        )
        for curves, own_model in zip(dataset.each, model.each, strict=True)
    ]
    validation = replace(validations[0], others=tuple(validations[1:]))
    write_validation(workspace.out / VALIDATION, validation)
    write_scores(workspace.out, validation.table, model.name)


def _scored(part: ScoresSlice, workspace: Workspace, measured: Dataset, model: Model) -> Validation:
    """Fit the competitors for one output, and return the predictions and scores of all models."""
    dataset = measured if part.seen_as is None else scored_as(part.seen_as, measured, model)
    static_run = workspace.needed[part.static] if part.static is not None else None
    contest = Contest(
        dataset, model, workspace.needed, static_run, part.lengths, workspace.spec_dir
    )
    rivals = _fit_rivals(contest, part, workspace.progress, workspace.warn)
    forecasts = {OWN: _own_forecasts(part, model, dataset)}
    forecasts |= {rival.name: rival.forecasts for rival in rivals}
    formulas = {name: fit for rival in rivals for name, fit in rival.formulas.items()}
    _warn_of_fits(workspace.warn, formulas, forecasts, dataset)
    failed = {rival.name for rival in rivals if rival.failed}
    judged = dataset, {name: every for name, every in forecasts.items() if name not in failed}
    in_turn = None
    if part.folds is not None:
        in_turn = _left_out(part.folds, contest, part, workspace, measured.target)
    scale = divisor((in_turn or judged)[0], part.normaliser)
    scores = [*_rows(part, model, *judged, scale)]
    if in_turn is None:
        scores = _with_seen(scores, rivals, dataset)
    else:
        scores += _rows(part, model, *in_turn, scale)
    scores += _repeatability_scores(part, model, dataset, scale)
    predictions = {
        name: tuple(forecast.values for forecast in every) for name, every in forecasts.items()
    }
    warnings = alarms(model, dataset, predictions[OWN], scores)
    searched_again = part.folds and was_searched(workspace.run_dir)
    if part.structure_seen and not searched_again:
        chosen = f"{STRUCTURE_SEEN}{part.structure_seen}"
        warnings = (f"{chosen}, so that errors on new ones are probably larger", *warnings)
    far = () if part.robust is None else outliers(dataset, forecasts[OWN], part.robust)
    if far:
        worst = f"the farthest is {far[0].file}:{far[0].place}"
        workspace.warn(
            f"{len(far)} training samples lie far from the fit and are listed on the page; {worst}"
        )
    validation = Validation(
        predictions,
        formulas,
        tuple(scores),
        {part.target: dataset.unit(dataset.target)},
        {
            rival.name: rival.own_fit
            for rival in rivals
            if rival.own_fit and shown_by(rival.own_fit)
        },
        warnings,
        outliers=far,
        models={rival.name: replace(rival.model, left_out=None) for rival in rivals if rival.model},
    )
    return for_report(validation, model, dataset)


def _rows(
    part: ScoresSlice, model: Model, dataset: Dataset, forecasts: Said, scale: Normaliser
) -> Iterator[Score]:
    """Yield the scores of every model. All models are scored on the same samples: those that every
    model can predict.
    """
    for name, every in on_common_rows(forecasts).items():
        free = parameters(model) if name == OWN else 0
        yield from score_rows(
            name, part.target, every, dataset, scale, group=part.groups, free=free
        )


def _with_seen(scores: list[Score], rivals: list[Rival], dataset: Dataset) -> list[Score]:
    """Return the scores, with the split changed in some of them. If a competitor is the model of
    another run that was trained with samples that are held out here, its scores on these samples
    get the split `seen` instead of `validate`.
    """
    saw = {
        rival.name for rival in rivals if rival.run is not None and trained_on(rival.run, dataset)
    }
    return [
        replace(row, split="seen") if row.model in saw and row.split == "validate" else row
        for row in scores
    ]


def _warn_of_fits(
    warn: Warn, formulas: Mapping[str, FormulaFit], forecasts: Said, dataset: Dataset
) -> None:
    """Warn about formulas whose fit has a second local minimum with nearly the same error, and
    about models whose free run diverges.
    """
    for name, fit in formulas.items():
        for sentence in rival_minima(name, fit):
            warn(sentence)
    for name, every in forecasts.items():
        for curve, output in zip(dataset.curves, every, strict=True):
            for row in output.diverged:
                warn(_diverged(name, curve, row, dataset))


def _own_forecasts(part: ScoresSlice, model: Model, dataset: Dataset) -> Forecasts:
    """Return the forecast of every curve by the run's own model. If the model has intervals, the
    forecasts include them, unless the model is inverted for scoring.
    """
    every = forecast_each(model, dataset.curves, dataset.target)
    if model.left_out is None or part.seen_as is not None:
        return every
    curves = zip(dataset.curves, every, strict=True)
    return tuple(_with_interval(model, curve, output) for curve, output in curves)


def _with_interval(model: Model, curve: Curve, output: Forecast) -> Forecast:
    """Return the forecast of a curve with the half width of the interval at every held-out sample.
    The half width is NaN at training samples, and outside the training range.
    """

    def known(widths: Array, held_out: BoolArray, beyond: BoolArray) -> Array:
        return np.where(held_out & ~beyond, widths, np.nan)

    half_widths = partial(half_widths_of, model, level=INTERVAL)
    widths, beyond = row_by_row(half_widths, curve.columns), outside(model, curve)
    return replace(output, half=by_blocks(known, widths, curve.held_out, beyond))


def _diverged(name: str, curve: Curve, row: int, dataset: Dataset) -> str:
    """Return a warning that the free run of a model diverges. It names the sample at which this
    happens, and says that the model has no scores there.
    """
    log = next(number for number, rows in enumerate(curve.logs) if row in rows)
    at = f"sample {int(np.searchsorted(curve.logs[log], row))}"
    if "time" in curve.columns:
        at += f" ({curve.columns['time'][row]:g} {dataset.unit('time')})"
    return (
        f"{name}: its free run diverges on {curve.recordings[log]} at {at}, so that it has "
        "no scores there (in a free run, a model gets its own predictions as past outputs)"
    )


def scored_as(name: str, dataset: Dataset, model: Model) -> Dataset:
    """Return the dataset with the input `name` of the model as the target, because the model is
    scored by its prediction of this input. Raises SpecError if the model has no such input.
    """
    inputs = model.input_names
    if name not in inputs:
        raise SpecError(
            f"validate.as: the model of {model.output.name} cannot be inverted for `{name}`",
            f"give `as` an input of the model ({', '.join(inputs)}), "
            f"or add terms of `{name}` to the dictionary",
        )
    return replace(dataset, target=name)


def _fit_rivals(contest: Contest, part: ScoresSlice, progress: Progress, warn: Warn) -> list[Rival]:
    """Fit every competitor to the training samples, and return all competitors. Warns of those
    whose fit failed.
    """
    named = {
        competitor if isinstance(competitor, str) else competitor.label
        for competitor in part.against
    }
    wanted = [*part.against, *(contest.simple_beside(named) if part.simple else ())]
    rivals = []
    for competitor in wanted:
        rivals.append(contest.rival(competitor))
        progress("competitors", len(rivals), len(wanted))
    for rival in rivals:
        if rival.failed:
            reasons = "; ".join(note for fit in rival.formulas.values() for note in fit.notes)
            warn(f"{rival.name}: the fit failed, so that its rows are left out: {reasons}")
    return rivals


def _left_out(
    choices: ModelChoices, contest: Contest, part: ScoresSlice, workspace: Workspace, fitted_to: str
) -> tuple[Dataset, Said]:
    """Predict every sample by models that were fitted without its level, or without its group if
    the spec leaves out groups (cross-validation). Return the dataset with all samples marked as
    held out, and the predictions of all models.
    """

    def compare(fold: Contest) -> tuple[Said, list[str]]:
        warnings: list[str] = []
        rivals = _fit_rivals(fold, part, lambda _what, _done, _total: None, warnings.append)
        return {rival.name: rival.forecasts for rival in rivals if not rival.failed}, warnings

    group = part.groups if part.without_groups else None
    whole, outputs, warnings = left_out(choices, contest, compare, workspace, fitted_to, group)
    for warning in warnings:
        workspace.warn(warning)
    return whole, outputs


def _repeatability_scores(
    part: ScoresSlice, model: Model, dataset: Dataset, scale: Normaliser
) -> Iterator[Score]:
    """Yield scores for the repeatability of the measurement: each measured value is predicted by
    its repetitions. If cycles are held out, the repetition is the last training cycle; otherwise,
    the repetitions are other recordings at the same level, coordinate and direction. Yield nothing
    if no measurement was repeated.
    """
    data = (dataset.curves, dataset.target)
    if part.cycles_of is not None:
        others = repeated_cycles(*data, part.cycles_of, dataset.logs)
    else:
        known = [quantity.name for quantity in (model.output, *model.inputs)]
        along = [name for name in known if name not in (dataset.target, dataset.level)]
        others = repeats(*data, along, dataset.logs)
    if others is not None:
        repeated = [Forecast(values, np.isfinite(values)) for values in others]
        yield from score_rows(REPEATABILITY, part.target, repeated, dataset, scale, partial=True)
