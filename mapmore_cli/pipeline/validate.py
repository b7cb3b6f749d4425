"""Score the model and its competitors: `validate.h5`, `scores.csv`, `scores.json`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns, by_blocks, row_by_row
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.scores import OWN, STRUCTURE_SEEN, Limit, deciding
from mapmore_cli.fitting.kinds.choices import ModelChoices, model_choices, with_definitions
from mapmore_cli.fitting.stage import Need, Progress, Stage, Warn, Workspace
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.storage.run_folder import VALIDATION
from mapmore_cli.study.experiment import Competitor, ExperimentSpec
from mapmore_cli.study.yaml_loader import as_overrides

if TYPE_CHECKING:
    from mapmore_cli.domain.compared import Normaliser
    from mapmore_cli.domain.models import Model
    from mapmore_cli.domain.recording import Curve, Dataset
    from mapmore_cli.domain.results import Forecast, Validation
    from mapmore_cli.domain.scores import Score
    from mapmore_cli.fitting.competitors import Contest, Forecasts, Rival


@dataclass(frozen=True)
class ScoresSlice:
    """What the scores depend on beyond the model.

    `target` is what is scored, `seen_as` the same where it is not what the model predicts, so that
    this is inverted. `static` is the spec of the needed static run, `lengths` are the muscle's in
    m, `cycles_of` is the quantity whose cycles are held out, `robust` the section `fit` with a
    robust loss, and `folds` has the choices that models are made by where every level is left out
    in turn. `structure_seen` says with what the structure was chosen, where that is held out.
    """

    target: str
    seen_as: str | None
    against: list[str | Competitor]
    simple: bool
    static: str | None
    lengths: dict[str, float | None]
    normaliser: str
    cycles_of: str | None
    folds: ModelChoices | None
    groups: str | None
    without_groups: bool
    structure_seen: str
    robust: Fit | None


def scores_slice(spec: ExperimentSpec) -> ScoresSlice:
    """Return the stage's slice of the spec; what only composites and load-cycle formulas need is in
    it where they may stand.
    """
    spec = with_definitions(spec)
    target = spec.target if isinstance(spec.target, str) else spec.target.column
    moving, split, groups = target in ("damping", "dynamic"), spec.data.split, spec.data.groups
    every = "groups" if split.leave_one_group_out else "levels" if split.leaves_out else "data"
    return ScoresSlice(
        target=spec.validation.as_ or target,
        seen_as=spec.validation.as_,
        against=spec.validation.against,
        simple=spec.validation.simple,
        static=spec.needs.static if moving else None,
        lengths=spec.muscle.lengths,
        normaliser=spec.validation.normaliser,
        cycles_of=split.hold_out.of if split.hold_out is not None else None,
        folds=model_choices(spec) if split.leaves_out else None,
        groups=groups.of if groups is not None else None,
        without_groups=split.leave_one_group_out,
        structure_seen=every if split.structure_seen else "",
        robust=None if spec.fit.loss == "squares" else spec.fit,
    )


def score(part: ScoresSlice, workspace: Workspace) -> None:
    """Fit the competitors to the same training data, predict every sample, and score; outputs one
    by one.
    """
    from mapmore_cli.storage.artefacts import write_validation
    from mapmore_cli.storage.run_record import write_scores

    dataset, model = workspace.files.dataset(), workspace.files.model()
    found = [
        _scored(replace(part, target=one.target) if dataset.also else part, workspace, one, own)
        for one, own in zip(dataset.each, model.each, strict=True)
    ]
    validation = replace(found[0], others=tuple(found[1:]))
    write_validation(workspace.out / VALIDATION, validation)
    write_scores(workspace.out, validation.table, model.name)


def _scored(part: ScoresSlice, workspace: Workspace, measured: Dataset, model: Model) -> Validation:
    from mapmore_cli.domain.results import Validation
    from mapmore_cli.fitting.competitors import Contest
    from mapmore_cli.fitting.left_out import trained_on, was_searched
    from mapmore_cli.modelling.forecast import forecast_each
    from mapmore_cli.modelling.kinds import parameters
    from mapmore_cli.modelling.validation.metrics import divisor, on_common_rows, score_rows
    from mapmore_cli.modelling.validation.outliers import outliers
    from mapmore_cli.modelling.validation.residuals import alarms
    from mapmore_cli.modelling.validation.shown import for_report
    from mapmore_cli.reporting.sections import shown_by
    from mapmore_cli.reporting.tables import rival_minima

    dataset = measured if part.seen_as is None else scored_as(part.seen_as, measured, model)
    static_run = workspace.needed[part.static] if part.static is not None else None
    contest = Contest(
        dataset, model, workspace.needed, static_run, part.lengths, workspace.spec_dir
    )
    rivals = _fit_rivals(contest, part, workspace.progress, workspace.warn)
    own = forecast_each(model, dataset.curves, dataset.target)
    if model.left_out is not None and part.seen_as is None:
        own = tuple(
            _with_interval(model, curve, said)
            for curve, said in zip(dataset.curves, own, strict=True)
        )
    forecasts = {OWN: own, **{one.name: one.forecasts for one in rivals}}
    formulas = {name: fit for one in rivals for name, fit in one.formulas.items()}
    for name, fit in formulas.items():
        for told in rival_minima(name, fit):
            workspace.warn(told)
    for name, every in forecasts.items():
        for curve, said in zip(dataset.curves, every, strict=True):
            for row in said.diverged:
                workspace.warn(_diverged(name, curve, row, dataset))
    failed = {one.name for one in rivals if one.failed}
    judged = [(dataset, {name: said for name, said in forecasts.items() if name not in failed})]
    if part.folds is not None:
        judged.append(_left_out(part.folds, contest, part, workspace, measured.target))
    scale = divisor(judged[-1][0], part.normaliser)
    scores = [
        row
        for rows_of, every in judged
        for name, said in on_common_rows(every).items()
        for row in score_rows(
            name,
            part.target,
            said,
            rows_of,
            scale,
            group=part.groups,
            free=parameters(model) if name == OWN else 0,
        )
    ]
    if part.folds is None:
        saw = {one.name for one in rivals if one.run is not None and trained_on(one.run, dataset)}
        scores = [
            replace(row, split="seen") if row.model in saw and row.split == "validate" else row
            for row in scores
        ]
    scores += _repeatability_scores(part, model, dataset, scale)
    fits = {one.name: one.own_fit for one in rivals if one.own_fit and shown_by(one.own_fit)}
    predictions = {name: tuple(one.values for one in every) for name, every in forecasts.items()}
    units = {part.target: dataset.unit(dataset.target)}
    loud = alarms(model, dataset, predictions[OWN], scores)
    if part.structure_seen and not (part.folds and was_searched(workspace.run_dir)):
        chosen = f"{STRUCTURE_SEEN}{part.structure_seen}: errors on new ones are likely larger"
        loud = (chosen, *loud)
    far = outliers(dataset, own, part.robust) if part.robust is not None else ()
    if far:
        worst = f"the farthest is {far[0].file}:{far[0].place}"
        workspace.warn(f"{len(far)} training samples far from the fit are listed; {worst}")
    validation = Validation(predictions, formulas, tuple(scores), units, fits, loud, outliers=far)
    return for_report(validation, model, dataset)


def _with_interval(model: Model, curve: Curve, said: Forecast) -> Forecast:
    """Add the half widths of the intervals to what a model says of the held-out samples of a
    curve.
    """
    from mapmore_cli.modelling.kinds import outside_range
    from mapmore_cli.modelling.validation.intervals import INTERVAL, half_widths_of

    def half(columns: Columns) -> Array:
        widths = half_widths_of(model, columns, INTERVAL)
        return np.where(outside_range(model, columns), np.nan, widths)

    def known(values: Array, where: BoolArray) -> Array:
        return np.where(where, values, np.nan)

    widths = row_by_row(half, curve.columns)
    return replace(said, half=by_blocks(known, widths, curve.held_out))


def _diverged(name: str, curve: Curve, row: int, dataset: Dataset) -> str:
    """Say where a free run left all bounds: its scores are empty."""
    log = next(number for number, rows in enumerate(curve.logs) if row in rows)
    at = f"sample {int(np.searchsorted(curve.logs[log], row))}"
    if "time" in curve.columns:
        at += f" ({curve.columns['time'][row]:g} {dataset.unit('time')})"
    return (
        f"{name}: its free run diverges on {curve.recordings[log]} at {at}; it has no scores there"
    )


def scored_as(name: str, dataset: Dataset, model: Model) -> Dataset:
    """Return the dataset with an input of the model as what is measured and scored; SpecError where
    the model has no such input.
    """
    inputs = [quantity.name for quantity in model.inputs]
    if name not in inputs:
        raise SpecError(
            f"validate.as: the model of {model.output.name} cannot be inverted for `{name}`",
            f"the model is a function of {', '.join(inputs)}: name one of these, or put "
            f"`{name}` into the dictionary",
        )
    return replace(dataset, target=name)


def _fit_rivals(contest: Contest, part: ScoresSlice, progress: Progress, warn: Warn) -> list[Rival]:
    """Every competitor, fitted to the training samples of the contest."""
    named = {one if isinstance(one, str) else one.label for one in part.against}
    wanted = [*part.against, *(contest.simple_beside(named) if part.simple else ())]
    rivals = []
    for competitor in wanted:
        rivals.append(contest.rival(competitor))
        progress("competitors", len(rivals), len(wanted))
    for one in rivals:
        if one.failed:
            reasons = "; ".join(note for fit in one.formulas.values() for note in fit.notes)
            warn(f"{one.name}: the fit failed, its rows are left out: {reasons}")
    return rivals


def _left_out(
    choices: ModelChoices, contest: Contest, part: ScoresSlice, workspace: Workspace, fitted_to: str
) -> tuple[Dataset, dict[str, Forecasts]]:
    """Return the dataset with all samples held out, and what models of the other levels say of
    them.
    """
    from mapmore_cli.fitting.left_out import left_out

    def compare(fold: Contest) -> tuple[dict[str, Forecasts], list[str]]:
        warnings: list[str] = []
        rivals = _fit_rivals(fold, part, lambda _what, _done, _total: None, warnings.append)
        return {one.name: one.forecasts for one in rivals if not one.failed}, warnings

    group = part.groups if part.without_groups else None
    whole, said, warnings = left_out(choices, contest, compare, workspace, fitted_to, group)
    for warning in warnings:
        workspace.warn(warning)
    return whole, said


def _repeatability_scores(
    part: ScoresSlice, model: Model, dataset: Dataset, scale: Normaliser
) -> Iterator[Score]:
    """Rows of the repeatability: of held-out cycles, or where measurements at one level, coordinate
    and direction were repeated.
    """
    from mapmore_cli.domain.results import Forecast
    from mapmore_cli.domain.scores import REPEATABILITY
    from mapmore_cli.modelling.validation.metrics import score_rows
    from mapmore_cli.modelling.validation.repeatability import repeated_cycles, repeats

    data = (dataset.curves, dataset.target)
    if part.cycles_of is not None:
        others = repeated_cycles(*data, part.cycles_of, dataset.logs)
    else:
        known = [quantity.name for quantity in (model.output, *model.inputs)]
        along = [name for name in known if name not in (dataset.target, dataset.level)]
        others = repeats(*data, along, dataset.logs)
    if others is not None:
        said = [Forecast(values, np.isfinite(values)) for values in others]
        yield from score_rows(REPEATABILITY, part.target, said, dataset, scale, partial=True)


def required_limits(
    require: Mapping[str, float | dict[str, float]], scores: Sequence[Score]
) -> tuple[Limit, ...]:
    """Return the `validate.require` limits with what the run's own model has.

    They hold on the pooled validation rows, or on the training rows where nothing is held out; for
    every output, or for those that they name.
    """
    rows = deciding(score for score in scores if score.model == OWN)
    return tuple(
        Limit(
            metric,
            f"{row.model} ({row.target})" if len(rows) > 1 else row.model,
            row.split,
            float(getattr(row, metric)),
            limit[row.target] if isinstance(limit, dict) else limit,
        )
        for row in rows
        for metric, limit in require.items()
        if not isinstance(limit, dict) or row.target in limit
    )


def needs(spec: ExperimentSpec) -> list[Need]:
    """Return the runs that this one is compared with, its own variations among them, and the static
    run that composites are fitted to.
    """
    static = scores_slice(spec).static
    competitors = [c for c in spec.validation.against if isinstance(c, Competitor)]
    runs = dict.fromkeys(c.run for c in competitors if c.run not in (None, static))
    return [
        *([Need(static)] if static is not None else []),
        *(Need(str(path), compared=True) for path in runs),
        *(Need(c.label, as_overrides(c.set)) for c in competitors if c.set is not None),
    ]


def frozen_models(spec: ExperimentSpec, folder: Path) -> list[Path]:
    """Return the frozen models that this one is compared with.

    Raises SpecError where there is no such file.
    """
    frozen = [c for c in spec.validation.against if isinstance(c, Competitor) and c.is_file]
    paths = [folder / str(competitor.model) for competitor in frozen]
    for competitor, path in zip(frozen, paths, strict=True):
        if not path.is_file():
            raise SpecError(
                f"validate.against: there is no model {competitor.model}",
                "freeze one with `mapmore freeze RUN --tag TAG`; paths start at the folder of "
                "the spec",
            )
    return paths


STAGE = Stage(
    name="validate",
    revision=13,
    outputs=(VALIDATION, "scores.csv", "scores.json"),
    reads=scores_slice,
    run=score,
    sources=frozen_models,
    needs=needs,
)
