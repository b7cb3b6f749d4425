"""View of settings that were tried out."""

from __future__ import annotations

from typing import Any

from mapmore_cli.cli.views.view import View
from mapmore_cli.domain.tuning import Trial, Tuning
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.spec.layers import as_overrides


def of_tuning(tuning: Tuning) -> View:
    """A row for every combination, and the settings to use."""
    document = {
        "name": tuning.name,
        "left_out": tuning.left_out,
        "full_scale": tuning.full_scale,
        "trials": [_document(trial) for trial in tuning.trials],
        "best": tuning.best.settings,
        "chosen": tuning.chosen.settings,
        "set": as_overrides(tuning.chosen.settings),
    }
    words = "the best itself" if tuning.chosen is tuning.best else "within one standard error of the best"
    use = " ".join(f"--set {_quoted(setting)}" for setting in as_overrides(tuning.chosen.settings))
    failed = [f"failed: {_words(trial)}: {trial.failure}" for trial in tuning.trials if trial.failure]
    return View(document, (tuning_table(tuning),), (*failed, f"simplest ({words}): {use}"))


def tuning_table(tuning: Tuning) -> Table:
    """Settings, size and left-out error of every combination; the best and the chosen one are marked."""
    keys = list(tuning.trials[0].settings)
    errors = (Column("left-out NRMSE", "%", ".3f"), Column("above the best", "%", ".3f"), Column("standard error", "%", ".3f"))
    rows: list[tuple[Cell, ...]] = []
    for trial in tuning.trials:
        settings = (_cell(trial.settings[key]) for key in keys)
        found = (100 * trial.error, 100 * trial.excess, 100 * trial.spread)
        rows.append((*settings, trial.parameters or None, *found, _mark(trial, tuning)))
    notes = (
        f"Left out in turn: {tuning.left_out}. NRMSE: mean over the folds of RMSE / FS, FS = {tuning.full_scale}.",
        "Simplest: the fewest parameters of those that err above the best by no more than the standard error of that difference.",
        "Held-out data were not used.",
    )
    columns = (*map(Column, keys), Column("parameters"), *errors, Column(""))
    return Table("tuning", f"Settings of {tuning.name}, tried on training data", columns, tuple(rows), notes)


def _document(trial: Trial) -> dict[str, Any]:
    return {
        "set": trial.settings,
        "parameters": trial.parameters,
        "error": trial.error,
        "above_best": trial.excess,
        "standard_error": trial.spread,
        "folds": trial.errors,
        "failure": trial.failure or None,
    }


def _mark(trial: Trial, tuning: Tuning) -> str:
    marks = [word for word, one in (("best", tuning.best), ("simplest", tuning.chosen)) if one is trial]
    return "failed" if trial.failure else ", ".join(marks)


def _words(trial: Trial) -> str:
    return ", ".join(f"{key}={_cell(value)}" for key, value in trial.settings.items())


def _cell(value: Any) -> Cell:
    return value if isinstance(value, str | int | float) and not isinstance(value, bool) else str(value)


def _quoted(text: str) -> str:
    import shlex

    return shlex.quote(text)
