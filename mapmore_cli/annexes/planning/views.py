"""Show the results of `tune` and `plan` as tables and as JSON."""

from __future__ import annotations

import shlex

from mapmore_cli.annexes.planning.results import Plan, Tuning, Until
from mapmore_cli.cli.compared import search_document
from mapmore_cli.cli.console import Document, View, members
from mapmore_cli.domain.results import Search
from mapmore_cli.reporting.score_tables import search_table
from mapmore_cli.reporting.table import Cell, Cells, Column, Columns, Table, cells_of
from mapmore_cli.study.yaml_dumper import as_overrides


def of_tuning(tuning: Tuning) -> View:
    """Return a table with a row for every combination of settings, and the recommended settings.
    The best and the recommended combination are marked in the table.
    """
    keys = ("set=settings", "parameters", "error", "above_best=excess", "standard_error=spread")
    errors = {
        "left-out NRMSE [%] .3f": "error",
        "above the best [%] .1f": "excess",
        "standard error [%] .1f": "spread",
    }
    documents, rows, lines = list[Document](), list[Cells](), list[str]()
    for trial in tuning.trials:
        failure = trial.failure or None
        documents.append({**members(trial, *keys, "folds=errors"), "failure": failure})
        settings = {key: _cell(value) for key, value in trial.settings.items()}
        marks = {"best": tuning.best, "simplest": tuning.chosen}
        mark = ", ".join(word for word, marked in marks.items() if trial is marked)
        if failure:
            mark = "failed"
            words = ", ".join(f"{key}={cell}" for key, cell in settings.items())
            lines.append(f"failed: {words}: {failure}")
        cells = (trial.parameters or None, *cells_of(trial, errors), mark)
        rows.append((*settings.values(), *cells))
    is_best = tuning.chosen is tuning.best
    words = "the best itself" if is_best else "within one standard error of the best"
    chosen = as_overrides(tuning.chosen.settings)
    use = " ".join(f"--set {shlex.quote(setting)}" for setting in chosen)
    document = {
        **members(tuning, "name", "left_out", "full_scale"),
        "trials": documents,
        "best": tuning.best.settings,
        "chosen": tuning.chosen.settings,
        "set": chosen,
    }
    notes = (
        f"Left out in turn: {tuning.left_out}. The NRMSE is the geometric mean over the folds of "
        f"RMSE / FS, with FS = {tuning.full_scale}. "
        "The column above the best is the mean of the logarithms of the ratios to the best.",
        "The simplest combination has the fewest parameters among those whose error exceeds the "
        "best by no more than the standard error of this difference, which counts as at least "
        "2 % and at most 20 %.",
        "Held-out data were not used.",
    )
    columns: Columns = (*map(Column, tuning.trials[0].settings), "parameters", *errors, "")
    title = f"Settings of {tuning.name}, tried on training data"
    table = Table.of("tuning", title, columns, rows, *notes)
    return View(document, (table,), (*lines, f"simplest ({words}): {use}"))


def _cell(value: object) -> Cell:
    return value if isinstance(value, str | float) or type(value) is int else str(value)


def of_search(search: Search, spec: str) -> View:
    """Return every structure that was tried, and the path of the spec with the chosen one."""
    words = "the best itself" if search.chosen == search.best else "as good as the best"
    lines = (*search.notes, f"found: {search.found.words} ({words})", f"spec: {spec}")
    return View({**search_document(search), "spec": spec}, (search_table(search),), lines)


def of_plan(plan: Plan) -> View:
    """Return a row for every candidate, the best first, and the forecast if one was requested."""
    unit, quantities = plan.target.unit, plan.quantities
    costs = {candidate.cost for candidate in plan.candidates} != {1.0}
    columns: list[Column | str] = ["rank"]
    columns += [Column(name, quantity.unit, ".4g") for name, quantity in quantities.items()]
    columns.append("what")
    if levels := plan.candidates[0].kind == "between":
        columns.append(f"gap [{next(iter(quantities.values())).unit}] .4g")
    else:
        columns += [
            f"{heading} [{unit}] .3g" for heading in ("half width", "after", "expected error")
        ]
    columns += ["cost .3g"] if costs else []
    documents, rows = list[Document](), list[Cells]()
    for number, candidate in enumerate(plan.candidates, 1):
        keys = ("kind", "gap", "half_width", "after", "error", "cost")
        documents.append({**candidate.at, **members(candidate, *keys)})
        sizes = (
            (candidate.gap,) if levels else (candidate.half_width, candidate.after, candidate.error)
        )
        cost = (candidate.cost,) if costs else ()
        rows.append((number, *map(candidate.at.get, quantities), candidate.kind, *sizes, *cost))
    document = {
        **members(plan, "name", "widest", "until", "notes"),
        "target": plan.target.name,
        "units": {plan.target.name: unit}
        | {name: quantity.unit for name, quantity in quantities.items()},
        "next": documents,
    }
    title = f"What to measure next for {plan.name}, the best first"
    table = Table.of("plan", title, columns, rows, *plan.notes)
    return View(document, (table,), () if plan.until is None else (_forecast(plan, plan.until),))


def _forecast(plan: Plan, until: Until) -> str:
    """Return the forecast in words."""
    unit = plan.target.unit
    wanted = (
        f"a half width of {until.wanted:.3g} {unit} ({100 * until.wanted / plan.largest:.2g} %)"
    )
    if until.more == 0:
        return f"{wanted} is reached: the widest is {until.widest:.3g} {unit}"
    if until.more is None:
        return (
            f"{wanted} is probably out of reach: more measurements reduce the widest from "
            f"{until.widest:.3g} to {until.least:.3g} {unit}"
        )
    return (
        f"{wanted} probably needs {until.more} more measurements (the widest is now "
        f"{until.widest:.3g} {unit})"
    )
