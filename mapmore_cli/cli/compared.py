"""Views of what was compared or tried, and of what `mapmore check` and `mapmore plan` found."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from mapmore_cli.cli.console import View, picked
from mapmore_cli.cli.views import of_dataset
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.results import Plan, Search
from mapmore_cli.domain.scores import Tuning
from mapmore_cli.reporting.score_tables import changes_table, drift_table, search_table
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.spec.yaml_loader import as_overrides

if TYPE_CHECKING:
    from mapmore_cli.checking.findings import Issue
    from mapmore_cli.modelling.validation.comparison import Comparison
    from mapmore_cli.pipeline.inspection import Inspection


ONE_CURVE = 2 / 3
"""Weight of one curve from which on the statement is about that curve above all."""


def of_comparisons(names: Sequence[str], results: Sequence[Comparison]) -> View:
    """Return the last model against the first, curve by curve; every model where there are more
    than two. The document has every term.
    """
    last = results[-1]
    terms = [{**asdict(term), "moved": term.moved} for term in last.terms]
    document = {
        "before": names[0],
        "after": names[-1],
        **_ends(last),
        **picked(last, "margin", "unit"),
    }
    document |= {"curves": [asdict(curve) for curve in last.curves], "terms": terms}
    if len(results) > 1:
        document["campaigns"] = [
            {"after": name, **_ends(one)} for name, one in zip(names[1:], results, strict=True)
        ]
    tables = [changes_table(last), *([drift_table(names, results)] if len(results) > 1 else [])]
    return View(document, tuple(tables), (_verdict(names[0], names[-1], last), *_cautions(last)))


def _verdict(before: str, after: str, found: Comparison) -> str:
    """One of three answers, with its numbers and where the change is largest."""
    low, high = found.interval
    margin = f"{100 * found.margin:g} %"
    size = (
        f"force is {found.ratio:.4f} times that of {before} (95 % interval {low:.4f} to "
        f"{high:.4f}, {len(found.curves)} curves)"
    )
    if found.answer == "changed":
        largest = found.by_effect[0]
        place = ", ".join(f"{name} {value:.4g}" for name, value in largest.place.items())
        where = (
            f"The largest effect is at {largest.curve}: {largest.largest:+.3g} {found.unit} "
            f"at {place}"
        )
        return f"{after} has changed: {size}. {where}."
    if found.answer == "same":
        low, high = found.narrow
        return (
            f"{after} is the same within {margin}: {size}; two one-sided tests show it (90 % "
            f"interval {low:.4f} to {high:.4f})."
        )
    least = "the curves tell nothing"
    if found.resolution < 1:
        least = f"a change of less than {100 * found.resolution:.2g} % cannot be told from none"
    return (
        f"The data cannot tell whether {after} has changed by more than {margin}: {size}; {least}."
    )


def _cautions(found: Comparison) -> list[str]:
    """Return what the reader has to know of the interval."""
    heaviest = max(found.curves, key=lambda curve: curve.weight)
    notes = []
    if heaviest.weight > ONE_CURVE:
        share = f"{100 * heaviest.weight:.0f} % of the weight"
        notes.append(
            f"{share} is on one curve, {heaviest.curve}: the statement is about that one above all."
        )
    if any(curve.interpolated for curve in found.curves):
        notes.append(
            "The levels of the two differ: one of them is interpolated between its curves."
        )
    return notes


def _ends(found: Comparison) -> dict[str, Any]:
    return picked(
        found,
        "answer",
        "changed",
        "ratio",
        "interval",
        "interval_90=narrow",
        "resolution",
        "p",
        "p_permutation",
    )


def of_tuning(tuning: Tuning) -> View:
    """Return a row for every combination, with the best and the chosen one marked, and the settings
    to use.
    """
    keys = (
        "set=settings",
        "parameters",
        "error",
        "above_best=excess",
        "standard_error=spread",
        "folds=errors",
    )
    trials = [{**picked(trial, *keys), "failure": trial.failure or None} for trial in tuning.trials]
    best, chosen = tuning.best.settings, tuning.chosen.settings
    document = {
        **picked(tuning, "name", "left_out", "full_scale"),
        "trials": trials,
        "best": best,
        "chosen": chosen,
    }
    words = (
        "the best itself"
        if tuning.chosen is tuning.best
        else "within one standard error of the best"
    )
    use = " ".join(f"--set {shlex.quote(setting)}" for setting in as_overrides(chosen))
    failed = [
        "failed: "
        f"{', '.join(f'{key}={_cell(value)}' for key, value in one.settings.items())}: "
        f"{one.failure}"
        for one in tuning.trials
        if one.failure
    ]
    lines = (*failed, f"simplest ({words}): {use}")
    return View({**document, "set": as_overrides(chosen)}, (_tuning_table(tuning),), lines)


def _tuning_table(tuning: Tuning) -> Table:
    keys = list(tuning.trials[0].settings)
    errors = (
        Column("left-out NRMSE", "%", ".3f"),
        Column("above the best", "%", ".1f"),
        Column("standard error", "%", ".1f"),
    )
    rows: list[tuple[Cell, ...]] = []
    for trial in tuning.trials:
        settings = (_cell(trial.settings[key]) for key in keys)
        found = (100 * trial.error, 100 * trial.excess, 100 * trial.spread)
        marks = [
            word
            for word, one in (("best", tuning.best), ("simplest", tuning.chosen))
            if one is trial
        ]
        rows.append(
            (
                *settings,
                trial.parameters or None,
                *found,
                "failed" if trial.failure else ", ".join(marks),
            )
        )
    notes = (
        f"Left out in turn: {tuning.left_out}. NRMSE: geometric mean over the folds of RMSE / "
        f"FS, FS = {tuning.full_scale}. "
        "Above the best: mean of the logarithms of the ratios.",
        "Simplest: the fewest parameters of those whose error is above the best by no more "
        "than the standard error of that difference, "
        "2 to 20 %.",
        "Held-out data were not used.",
    )
    columns = (*map(Column, keys), Column("parameters"), *errors, Column(""))
    return Table(
        "tuning", f"Settings of {tuning.name}, tried on training data", columns, tuple(rows), notes
    )


def _cell(value: Any) -> Cell:
    return (
        value
        if isinstance(value, str | int | float) and not isinstance(value, bool)
        else str(value)
    )


def of_search(search: Search, spec: str) -> View:
    """Every structure that was tried, and where the spec with the one that was taken lies."""
    words = "the best itself" if search.chosen == search.best else "as good as the best"
    lines = (*search.notes, f"found: {search.found.words} ({words})", f"spec: {spec}")
    return View({**search_document(search), "spec": spec}, (search_table(search),), lines)


def search_document(search: Search) -> dict[str, Any]:
    """Return the search as JSON has it."""
    keys = (
        "family",
        "structure=words",
        "sections",
        "parameters",
        "error",
        "standard_error=spread",
        "above_best=excess",
    )
    tried = [
        {**picked(one, *keys, "parts_error=parts", "seconds"), "failure": one.failure or None}
        for one in search.tried
    ]
    return {
        **picked(search, "target", "left_out", "parts_left_out=parts", "scale"),
        **picked(search.found, "found=words", "sections"),
        "tried": tried,
        **picked(search, "cut", "notes"),
    }


def of_inspection(inspection: Inspection, unconfirmed: Sequence[str] = ()) -> View:
    """Return the curves if any, then the issues with their remedies, the worst first, and guesses
    that nobody has confirmed.
    """
    found = View({}) if inspection.dataset is None else of_dataset(inspection.dataset)
    issues = [asdict(issue) for issue in inspection.issues]
    questions = [f"not confirmed: {question}" for question in unconfirmed]
    lines = _lines(inspection.issues) if inspection.issues or not questions else ()
    document = {**found.document, "issues": issues, "unconfirmed": list(unconfirmed)}
    return View(document, found.tables, (*found.lines, *lines, *questions))


def of_campaign(results: Mapping[str, Inspection | MapmoreError]) -> View:
    """Return the issues of every run, or why it could not be looked at."""
    document: dict[str, Any] = {}
    lines: list[str] = []
    for run, result in results.items():
        if isinstance(result, MapmoreError):
            document[run] = {"error": str(result)}
            lines += [f"{run}:", f"error: {result}"]
        else:
            document[run] = {"issues": [asdict(issue) for issue in result.issues]}
            lines += [f"{run}:", *_lines(result.issues)] if result.issues else [f"{run}: no issues"]
    return View({"runs": document}, (), tuple(lines))


def _lines(issues: Sequence[Issue]) -> tuple[str, ...]:
    if not issues:
        return ("No issues.",)
    blocks = [
        (f"{issue.severity}: {issue.place}: {issue.message} [{issue.id}]", f"  {issue.remedy}")
        for issue in issues
    ]
    return tuple(line for block in blocks for line in block)


def of_plan(plan: Plan) -> View:
    """Return a row for every candidate, the best first, and the forecast where one was asked
    for.
    """
    document: dict[str, Any] = {
        "name": plan.name,
        "target": plan.target.name,
        "units": {
            name: quantity.unit
            for name, quantity in {plan.target.name: plan.target, **plan.quantities}.items()
        },
        "next": [
            {**one.at, **picked(one, "kind", "gap", "half_width", "after", "error", "cost")}
            for one in plan.candidates
        ],
        "widest": plan.widest,
        "until": None,
        "notes": plan.notes,
    }
    lines = []
    if plan.until is not None:
        document["until"] = asdict(plan.until)
        lines.append(_forecast(plan))
    return View(document, (_plan_table(plan),), tuple(lines))


def _plan_table(plan: Plan) -> Table:
    unit, costs = plan.target.unit, {candidate.cost for candidate in plan.candidates} != {1.0}
    columns = [
        Column("rank"),
        *(Column(name, quantity.unit, ".4g") for name, quantity in plan.quantities.items()),
        Column("what"),
    ]
    if levels := plan.candidates[0].kind == "between":
        columns.append(Column("gap", next(iter(plan.quantities.values())).unit, ".4g"))
    else:
        columns += [Column(what, unit, ".3g") for what in ("half width", "after", "expected error")]
    columns += [Column("cost", "", ".3g")] if costs else []
    rows: list[tuple[Cell, ...]] = []
    for number, one in enumerate(plan.candidates, 1):
        sizes = (one.gap,) if levels else (one.half_width, one.after, one.error)
        numbers = (*sizes, *([one.cost] if costs else []))
        rows.append((number, *(one.at[name] for name in plan.quantities), one.kind, *numbers))
    return Table(
        "plan",
        f"What to measure next for {plan.name}, the best first",
        tuple(columns),
        tuple(rows),
        plan.notes,
    )


def _forecast(plan: Plan) -> str:
    """Return the forecast in words."""
    assert plan.until is not None
    found, unit = plan.until, plan.target.unit
    wanted = (
        f"a half width of {found.wanted:.3g} {unit} ({100 * found.wanted / plan.largest:.2g} %)"
    )
    if found.more == 0:
        return f"{wanted} is reached: the widest is {found.widest:.3g} {unit}"
    if found.more is None:
        return (
            f"{wanted} is likely out of reach: more measurements bring {found.widest:.3g} to "
            f"{found.least:.3g} {unit}"
        )
    return f"{wanted}: likely {found.more} more (the widest is {found.widest:.3g} {unit} now)"
