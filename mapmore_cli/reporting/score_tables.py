"""Scores as tables: what a run ends with, also where nothing had to be done."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from mapmore_cli.domain.scores import REPEATABILITY, Published, Score
from mapmore_cli.reporting.table import Cell, Column, Table

FLOOR_NOTE = (
    f"{REPEATABILITY}: no model, but how far a sample lies from the mean of the other recordings at its level, place and direction, "
    "where there are others; where cycles are held out, from the last training cycle: at the same moment where the input repeats "
    "itself in time, else at the same place of the same stroke. It is about the least that can be asked for."
)
FREE_RUN_NOTE = (
    "All figures are of the free run, in which a model with delayed outputs is given its own. RRSE: root relative squared error, the RMSE "
    "over the standard deviation of the measured values; one step: with the measured past instead, which says little about a simulation."
)


def score_table(scores: Sequence[Score], units: Mapping[str, str], published: Published | None = None, failed: Sequence[str] = ()) -> Table:
    """Pooled scores, the held-out data first, every model in the order given.

    `units` has the unit of every target. A publication's numbers stand beside the validation rows, which alone are comparable. Models in
    `failed` have no scores; they get a row that says so.
    """
    pooled = sorted((s for s in scores if s.curve == "all"), key=lambda s: s.split != "validate")
    unit = units.get(pooled[0].target, "") if pooled else ""
    free_running = _run_free(pooled)
    columns = [Column("model"), Column("data"), *_metric_columns(unit, free_running)]
    rows = [_score_cells(s, free_running) for s in pooled] + [(name, "failed", *[None] * (len(columns) - 2)) for name in failed]
    notes = [full_scale(pooled, unit)] if pooled else []
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
        notes.append(f"Published numbers ({published.source}) are of held-out data, and nothing is held out here to hold them against.")
    title = f"Scores (target: {pooled[0].target}), all curves pooled" if pooled else "Scores"
    return Table("scores", title, tuple(columns), tuple(rows), tuple(notes))


def _published_columns(published: Published, unit: str) -> Iterator[tuple[Column, dict[str, Cell]]]:
    """The columns of a publication's numbers, with their cells by model."""
    if published.nrmse:
        yield Column("published NRMSE", "%", ".3g"), {model: 100 * value for model, value in published.nrmse.items()}
    models = [*published.rmse, *published.rmse_at_least]
    if models:
        yield Column("published RMSE", unit, ".3g"), {model: published.shown_rmse(model) for model in models}


def full_scale(pooled: Sequence[Score], unit: str) -> str:
    """What errors are divided by, in a sentence; by split where that differs, as in files of older versions."""
    found = dict.fromkeys((s.split, f"FS = {s.normaliser_name} = {s.normaliser:.4g} {unit}".rstrip()) for s in pooled)
    scales = dict.fromkeys(scale for _, scale in found)
    if len(scales) == 1:
        return f"NRMSE: RMSE / FS, for all rows {next(iter(scales))}."
    return f"NRMSE: RMSE / FS, {', '.join(f'{scale} for {split}' for split, scale in found)}."


def curve_scores_table(scores: Sequence[Score], units: Mapping[str, str]) -> Table:
    """Scores of every curve by itself, the models beside each other."""
    order = {curve: place for place, curve in enumerate(dict.fromkeys(s.curve for s in scores))}
    single = sorted((s for s in scores if s.curve != "all"), key=lambda s: (s.split != "validate", order[s.curve]))
    unit = units.get(single[0].target, "") if single else ""
    free_running = _run_free(single)
    columns = (Column("curve"), Column("model"), Column("data"), *_metric_columns(unit, free_running))
    return Table("curve_scores", "Scores by curve", columns, tuple((s.curve, *_score_cells(s, free_running)) for s in single))


def _run_free(scores: Sequence[Score]) -> bool:
    """Whether any model feeds its own output back, so that the measured past would have told it more."""
    return any(math.isfinite(s.rrse_one_step) and s.rrse_one_step != s.rrse for s in scores)


def _metric_columns(unit: str, free_running: bool) -> tuple[Column, ...]:
    one_step = (Column("RRSE, free run", "", ".5f"), Column("RRSE, one step", "", ".5f")) if free_running else ()
    return (
        Column("samples"),
        Column("RMSE", unit),
        Column("NRMSE", "%", ".2f"),
        Column("max error", unit),
        Column("max error", "% FS", ".2f"),
        Column("R²", "", ".4f"),
        *one_step,
    )


def _score_cells(score: Score, free_running: bool) -> tuple[Cell, ...]:
    errors = (score.rmse, 100 * score.nrmse, score.max_abs_error, 100 * score.max_abs_error_fs)
    one_step = (score.rrse, score.rrse_one_step) if free_running else ()
    return (score.model, score.split, score.n, *errors, score.r2, *one_step)
