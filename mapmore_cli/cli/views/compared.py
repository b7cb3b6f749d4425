"""Views of scores, and of comparisons: has a muscle changed?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from mapmore_cli.cli.views.fitted import View
from mapmore_cli.domain.results import Search, Tried, Validation
from mapmore_cli.domain.scores import Published, ScoreTable, Trial, Tuning
from mapmore_cli.reporting.score_tables import changes_table, curve_scores_table, drift_table, score_table, search_table
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.spec.layers import as_overrides

if TYPE_CHECKING:
    from mapmore_cli.modelling.validation.comparison import Comparison


def of_scores(table: ScoreTable, published: Published | None = None) -> View:
    """Return the score rows of every curve in the document; the pooled ones in the table, beside what a publication reports."""
    from mapmore_cli.storage.run_record import score_row

    rows = [score_row(score) for score in table.scores]
    return View({"scores": rows, "units": table.units}, (score_table(table.scores, table.units, published, table.failed),))


def of_validation(validation: Validation) -> View:
    """Return the scores pooled and by curve, and the formulas that were fitted as competitors."""
    from mapmore_cli.reporting.tables import rival_minima

    pooled = of_scores(validation.table)
    formulas = {name: asdict(formula) for name, formula in validation.formulas.items()}
    unit = next(iter(validation.units.values()), "")
    lines = tuple(told for name, formula in validation.formulas.items() for told in rival_minima(name, formula, unit))
    tables = (*pooled.tables, curve_scores_table(validation.scores, validation.units))
    loud = tuple(f"warning: {warning}" for warning in validation.warnings)
    return View({**pooled.document, "formulas": formulas, "warnings": validation.warnings}, tables, (*loud, *lines))


ONE_CURVE = 2 / 3
"""Weight of one curve from which on the statement is about that curve above all."""


def of_comparisons(names: Sequence[str], results: Sequence[Comparison]) -> View:
    """Return the last model against the first, curve by curve; every model where there are more than two. The document has every term."""
    last = results[-1]
    document = {"before": names[0], "after": names[-1], **_document(last)}
    if len(results) > 1:
        document["campaigns"] = [{"after": name, **_ends(one)} for name, one in zip(names[1:], results, strict=True)]
    tables = [changes_table(last), *([drift_table(names, results)] if len(results) > 1 else [])]
    return View(document, tuple(tables), (verdict(names[0], names[-1], last), *cautions(last)))


def verdict(before: str, after: str, found: Comparison) -> str:
    """One of three answers, with its numbers and where the change is largest."""
    low, high = found.interval
    margin = f"{100 * found.margin:g} %"
    size = f"force is {found.ratio:.4f} times that of {before} (95 % interval {low:.4f} to {high:.4f}, {len(found.curves)} curves)"
    if found.answer == "changed":
        largest = found.by_effect[0]
        place = ", ".join(f"{name} {value:.4g}" for name, value in largest.place.items())
        where = f"The largest effect is at {largest.curve}: {largest.largest:+.3g} {found.unit} at {place}"
        return f"{after} has changed: {size}. {where}."
    if found.answer == "same":
        low, high = found.narrow
        return f"{after} is the same within {margin}: {size}; two one-sided tests show it (90 % interval {low:.4f} to {high:.4f})."
    least = (
        f"a change of less than {100 * found.resolution:.2g} % cannot be told from none"
        if found.resolution < 1
        else "the curves tell nothing"
    )
    return f"The data cannot tell whether {after} has changed by more than {margin}: {size}; {least}."


def cautions(found: Comparison) -> list[str]:
    """Return what the reader has to know of the interval."""
    heaviest = max(found.curves, key=lambda curve: curve.weight)
    notes = []
    if heaviest.weight > ONE_CURVE:
        notes.append(
            f"{100 * heaviest.weight:.0f} % of the weight is on one curve, {heaviest.curve}: the statement is about that one above all."
        )
    if any(curve.interpolated for curve in found.curves):
        notes.append("The levels of the two differ: one of them is interpolated between its curves.")
    return notes


def _ends(found: Comparison) -> dict[str, Any]:
    return {
        "answer": found.answer,
        "changed": found.changed,
        "ratio": found.ratio,
        "interval": found.interval,
        "interval_90": found.narrow,
        "resolution": found.resolution,
        "p": found.p,
        "p_permutation": found.p_permutation,
    }


def _document(found: Comparison) -> dict[str, Any]:
    terms = [{**asdict(term), "moved": term.moved} for term in found.terms]
    return {**_ends(found), "margin": found.margin, "unit": found.unit, "curves": [asdict(curve) for curve in found.curves], "terms": terms}


def of_tuning(tuning: Tuning) -> View:
    """Return a row for every combination, and the settings to use."""
    document = {
        "name": tuning.name,
        "left_out": tuning.left_out,
        "full_scale": tuning.full_scale,
        "trials": [_tuning_document(trial) for trial in tuning.trials],
        "best": tuning.best.settings,
        "chosen": tuning.chosen.settings,
        "set": as_overrides(tuning.chosen.settings),
    }
    words = "the best itself" if tuning.chosen is tuning.best else "within one standard error of the best"
    use = " ".join(f"--set {_quoted(setting)}" for setting in as_overrides(tuning.chosen.settings))
    failed = [f"failed: {_words(trial)}: {trial.failure}" for trial in tuning.trials if trial.failure]
    return View(document, (tuning_table(tuning),), (*failed, f"simplest ({words}): {use}"))


def tuning_table(tuning: Tuning) -> Table:
    """Return settings, size and left-out error of every combination; the best and the chosen one are marked."""
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


def _tuning_document(trial: Trial) -> dict[str, Any]:
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


def of_search(search: Search, spec: str) -> View:
    """Every structure that was tried, and where the spec with the one that was taken lies."""
    words = "the best itself" if search.chosen == search.best else "within one standard error of the best"
    lines = (*search.notes, f"found: {search.found.words} ({words})", f"spec: {spec}")
    return View({**document_of(search), "spec": spec}, (search_table(search),), lines)


def document_of(search: Search) -> dict[str, Any]:
    """Return the search as JSON has it."""
    return {
        "target": search.target,
        "left_out": search.left_out,
        "parts_left_out": search.parts,
        "scale": search.scale,
        "found": search.found.words,
        "sections": dict(search.found.sections),
        "tried": [_search_document(one) for one in search.tried],
        "cut": search.cut,
        "black_boxes": search.black_boxes,
        "notes": list(search.notes),
    }


def _search_document(one: Tried) -> dict[str, Any]:
    return {
        "family": one.family,
        "structure": one.words,
        "sections": one.sections,
        "parameters": one.parameters,
        "error": one.error,
        "standard_error": one.spread,
        "above_best": one.excess,
        "parts_error": one.parts,
        "seconds": one.seconds,
        "failure": one.failure or None,
    }
