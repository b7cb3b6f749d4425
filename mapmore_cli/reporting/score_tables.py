"""Scores as tables: what a run ends with, also where nothing had to be done."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.results import Search, Tried
from mapmore_cli.domain.scores import REPEATABILITY, Published, Score, deciding
from mapmore_cli.modelling.validation.comparison import Comparison
from mapmore_cli.reporting.table import MODEL, Cell, Column, Columns, Table, title_of

FLOOR_NOTE = (
    f"{REPEATABILITY}: no model, but how far a sample lies from the mean of the other "
    "recordings at its level, place and direction, "
    "where there are others; where cycles are held out, from the last training cycle: at the "
    "same moment where the input repeats "
    "itself in time, else at the same place of the same stroke. It is about the least that "
    "can be asked for."
)
FAR_NOTE = (
    "The target lies far from zero, so that every model has a small NRMSE. By range: RMSE "
    "over the range of the measured values, "
    "which `validate: {normaliser: range}` makes the full scale."
)
FREE_RUN_NOTE = (
    "All figures are of the free run, in which a model with delayed outputs is given its own. "
    "RRSE: root relative squared error, the RMSE "
    "over the standard deviation of the measured values; one step: with the measured past "
    "instead, which says little about a simulation."
)


def score_table(
    scores: Sequence[Score],
    units: Mapping[str, str],
    published: Published | None = None,
    failed: Sequence[str] = (),
) -> Table:
    """Pooled scores, the held-out data first, every model in the order given.

    `units` has the unit of every target. A publication's numbers stand beside the validation rows,
    which alone are comparable. Models in `failed` have no scores; they get a row that says so.
    """
    pooled = sorted((s for s in scores if s.curve == "all"), key=lambda s: s.split != "validate")
    unit = units.get(pooled[0].target, "") if pooled else ""
    free_running, far = _run_free(pooled), any(s.far for s in pooled)
    columns: list[Column | str] = [MODEL, "data", *_metric_columns(unit, free_running, far)]
    rows = [_score_cells(s, free_running, far) for s in pooled] + [
        (name, "failed", *[None] * (len(columns) - 2)) for name in failed
    ]
    notes = [full_scale(pooled, unit)] if pooled else []
    if far:
        notes.append(FAR_NOTE)
    if any(s.model == REPEATABILITY for s in pooled):
        notes.append(FLOOR_NOTE)
    if free_running:
        notes.append(FREE_RUN_NOTE)
    if published is not None and pooled and pooled[0].split == "validate":
        for column, of in _published_columns(published, unit):
            columns.append(column)
            rows = [(*row, of.get(str(row[0])) if row[1] != "train" else None) for row in rows]
        notes.append(f"Published: {published.source}.")
    elif published is not None:
        notes.append(
            f"Published numbers ({published.source}) are of held-out data, and nothing is "
            "held out here to hold them against."
        )
    title = f"Scores (target: {pooled[0].target}), all curves pooled" if pooled else "Scores"
    return Table.of("scores", title, columns, rows, *notes)


def _published_columns(published: Published, unit: str) -> Iterator[tuple[str, dict[str, Cell]]]:
    """Yield the columns of a publication's numbers, with their cells by model."""
    if published.nrmse:
        yield (
            "published NRMSE [%] .3g",
            {model: 100 * value for model, value in published.nrmse.items()},
        )
    if models := [*published.rmse, *published.rmse_at_least]:
        yield (
            f"published RMSE [{unit}] .3g",
            {model: published.shown_rmse(model) for model in models},
        )


def full_scale(pooled: Sequence[Score], unit: str) -> str:
    """Return what errors are divided by, in a sentence; by split where that differs, as in files of
    older versions.
    """
    found = dict.fromkeys(
        (s.split, f"FS = {s.normaliser_name} = {s.normaliser:.4g} {unit}".rstrip()) for s in pooled
    )
    scales = dict.fromkeys(scale for _, scale in found)
    if len(scales) == 1:
        return f"NRMSE: RMSE / FS, for all rows {next(iter(scales))}."
    return f"NRMSE: RMSE / FS, {', '.join(f'{scale} for {split}' for split, scale in found)}."


def curve_scores_table(scores: Sequence[Score], units: Mapping[str, str]) -> Table:
    """Scores of every curve by itself, the models beside each other."""
    order = {curve: place for place, curve in enumerate(dict.fromkeys(s.curve for s in scores))}
    single = sorted(
        (s for s in scores if s.curve != "all"),
        key=lambda s: (s.split != "validate", order[s.curve]),
    )
    unit = units.get(single[0].target, "") if single else ""
    shown = _run_free(single), any(s.far for s in single)
    columns: Columns = ("curve", MODEL, "data", *_metric_columns(unit, *shown))
    return Table.of(
        "curve_scores",
        "Scores by curve",
        columns,
        ((s.curve, *_score_cells(s, *shown)) for s in single),
    )


def _run_free(scores: Sequence[Score]) -> bool:
    """Whether any model feeds its own output back, so that the measured past would have told it
    more.
    """
    return any(math.isfinite(s.rrse_one_step) and s.rrse_one_step != s.rrse for s in scores)


def _metric_columns(unit: str, free_running: bool, far: bool) -> tuple[str, ...]:
    errors = (
        f"RMSE [{unit}]",
        "NRMSE [%] .2f",
        *(["by range [%] .2f"] if far else []),
        f"max error [{unit}]",
    )
    one_step = ("RRSE, free run .5f", "RRSE, one step .5f") if free_running else ()
    return ("samples", *errors, "max error [% FS] .2f", "R² .4f", *one_step)


def _score_cells(score: Score, free_running: bool, far: bool) -> tuple[Cell, ...]:
    by_range = [100 * score.nrmse_range] if far else []
    errors = (
        score.rmse,
        100 * score.nrmse,
        *by_range,
        score.max_abs_error,
        100 * score.max_abs_error_fs,
    )
    one_step = (score.rrse, score.rrse_one_step) if free_running else ()
    return (score.model, score.split, score.n, *errors, score.r2, *one_step)


EQUAL_WITHIN = 0.01
"""Relative difference of two errors below which neither model is called better."""


def verdict(scores: Sequence[Score], own: str, target: Quantity, failed: Sequence[str] = ()) -> str:
    """Compare the pooled error of the model `own` with the best of the others, on held-out data
    where there are any.

    `failed` names the competitors that have no scores, because their fit failed.
    """
    compared = deciding(scores)
    ours = next((s for s in compared if s.model == own), None)
    if ours is None or not math.isfinite(ours.nrmse):
        return f"{own} gave no prediction."
    where = {
        "validate": "on the held-out data",
        "train": (
            "on its own training data (nothing was held out, so this says little about new data)"
        ),
    }[ours.split]
    unit = "" if target.unit in ("", "1") else f" {target.unit}"
    by_range = (
        f", {_percent(ours.nrmse_range)} of the range: the target lies far from zero"
        if ours.far
        else ""
    )
    errors = f"an NRMSE of {_percent(ours.nrmse)} (RMSE {ours.rmse:.3g}{unit}{by_range})"
    first = f"{own} predicts {target.name} with {errors} {where}"
    others = [s for s in compared if s.model not in (own, REPEATABILITY)]
    return f"{first}; {_comparison(ours, others, failed)}{_floor(compared)}."


def _comparison(ours: Score, others: Sequence[Score], failed: Sequence[str]) -> str:
    usable = [s for s in others if math.isfinite(s.nrmse)]
    if not usable:
        return (
            "no competitor gave a prediction to compare with"
            if others or failed
            else "it was compared with no other model"
        )
    best = min(usable, key=lambda s: s.nrmse)
    claim = f"the best competitor ({title_of(best.model)}) reaches {_percent(best.nrmse)}"
    if ours.rmse == best.rmse:
        return f"{claim}: an exact tie"
    if abs(ours.rmse - best.rmse) <= EQUAL_WITHIN * max(ours.rmse, best.rmse):
        return f"{claim}: no difference to speak of"
    ratio = f" ({ours.rmse / best.rmse:.3g} times the RMSE)" if best.rmse > 0 else ""
    return f"{claim}: {ours.model} is {'better' if ours.rmse < best.rmse else 'worse'}{ratio}"


def _floor(compared: Sequence[Score]) -> str:
    """Return what repeated measurements differ by, where there are any."""
    return "".join(
        f"; repeated measurements differ by {_percent(s.nrmse)}"
        for s in compared
        if s.model == REPEATABILITY
    )


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.3g} %"


def changes_table(found: Comparison) -> Table:
    """Every curve that both models have, by the size of the change: the factor between them, its
    weight, and the difference.
    """
    differences = (f"{which} difference [{found.unit}] .3g" for which in ("mean", "RMS", "largest"))
    columns = ("curve", "ratio .4f", "weight [%] .1f", *differences, "at")
    rows: list[tuple[Cell, ...]] = []
    for curve in found.by_effect:
        place = ", ".join(f"{name} {value:.4g}" for name, value in curve.place.items())
        rows.append(
            (
                curve.curve,
                curve.ratio,
                100 * curve.weight,
                curve.difference,
                curve.rms,
                curve.largest,
                place,
            )
        )
    rows.append(("all", found.ratio, 100.0, *[None] * 4))
    low, high = found.interval
    permuted = (
        ""
        if found.p_permutation is None
        else f"; permutation of the curves' signs p = {found.p_permutation:.2g}"
    )
    note = (
        f"Ratio of all curves: 95 % interval {low:.4f} to {high:.4f} (Student's t, "
        f"{len(found.curves) - 1} degrees of freedom; the unit is "
        f"the curve), p = {found.p:.2g}{permuted}. Weight: share of the sum of squares of the "
        "earlier output."
    )
    return Table.of("changes", f"{found.after} against {found.before}", columns, rows, note)


def drift_table(names: Sequence[str], results: Sequence[Comparison]) -> Table:
    """Every later model against the first."""
    rows = (
        (name, one.ratio, *one.interval, one.answer)
        for name, one in zip(names[1:], results, strict=True)
    )
    return Table.of(
        "drift",
        f"Every model against {names[0]}",
        (MODEL, "ratio .4f", "from .4f", "to .4f", "answer"),
        rows,
    )


def search_table(search: Search) -> Table:
    """Return a row for every structure, the least error first; the best and the one that was taken
    are marked.
    """
    columns = (
        *(
            "structure",
            "left-out error [%] .3f",
            "levels left out [%] .3f",
            "above the best [%] .1f",
            "standard error [%] .1f",
        ),
        *("parameters", "seconds .2f", ""),
    )
    order = sorted(
        enumerate(search.tried), key=lambda pair: (bool(pair[1].failure), pair[1].excess)
    )
    notes = (
        f"Left out in turn: {search.left_out}. Errors: RMSE / FS, FS = range of the training "
        f"samples = {search.scale:.4g}. "
        "Above the best: mean of the logarithm of the ratio over all folds (in recordings the "
        "median), and the standard error of the mean.",
        *((f"Levels left out: the same for {search.parts}.",) if search.parts else ()),
        f"Taken: {search.rule}. Held-out data were not used.",
        *search.notes,
    )
    rows = (_row(number, one, search) for number, one in order)
    return Table.of("search", "Structures that were tried on training data", columns, rows, *notes)


def _row(number: int, one: Tried, search: Search) -> tuple[Cell, ...]:
    marks = [
        word for word, place in (("best", search.best), ("taken", search.chosen)) if place == number
    ]
    if one.family == "black box":
        marks = ["to compare with"]
    told = f"failed: {one.failure}" if one.failure else ", ".join(marks)
    return (
        one.words,
        100 * one.error,
        100 * one.parts,
        100 * one.excess,
        100 * one.spread,
        one.parameters or None,
        one.seconds,
        told,
    )
