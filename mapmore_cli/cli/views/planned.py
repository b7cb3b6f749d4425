"""View of a plan: what to measure next."""

from __future__ import annotations

from typing import Any

from mapmore_cli.cli.views.fitted import View
from mapmore_cli.domain.plan import Candidate, Plan
from mapmore_cli.reporting.table import Cell, Column, Table


def of_plan(plan: Plan) -> View:
    """Return a row for every candidate, the best first, and the forecast where one was asked for."""
    document: dict[str, Any] = {
        "name": plan.name,
        "target": plan.target.name,
        "units": {name: quantity.unit for name, quantity in {plan.target.name: plan.target, **plan.quantities}.items()},
        "next": [_document(candidate) for candidate in plan.candidates],
        "widest": plan.widest,
        "until": None,
        "notes": plan.notes,
    }
    lines = []
    if plan.until is not None:
        found = plan.until
        document["until"] = {"wanted": found.wanted, "widest": found.widest, "more": found.more, "least": found.least}
        lines.append(_forecast(plan))
    return View(document, (plan_table(plan),), tuple(lines))


def plan_table(plan: Plan) -> Table:
    """Return the candidates in order, with half widths before and after."""
    unit, costs = plan.target.unit, {candidate.cost for candidate in plan.candidates} != {1.0}
    error = "expected error" if plan.candidates[0].kind == "point" else "left-out error"
    columns = [Column("rank"), *(Column(name, quantity.unit, ".4g") for name, quantity in plan.quantities.items()), Column("what")]
    columns += [Column("half width", unit, ".3g"), Column("after", unit, ".3g"), Column(error, unit, ".3g")]
    columns += [Column("cost", "", ".3g")] if costs else []
    rows: list[tuple[Cell, ...]] = []
    for number, one in enumerate(plan.candidates, 1):
        numbers = (one.half_width, one.after, one.error, *([one.cost] if costs else []))
        rows.append((number, *(one.at[name] for name in plan.quantities), one.kind, *numbers))
    return Table("plan", f"What to measure next for {plan.name}, the best first", tuple(columns), tuple(rows), plan.notes)


def _document(candidate: Candidate) -> dict[str, Any]:
    numbers = {"half_width": candidate.half_width, "after": candidate.after, "error": candidate.error, "cost": candidate.cost}
    return {**candidate.at, "kind": candidate.kind, **numbers}


def _forecast(plan: Plan) -> str:
    """Return the forecast in words."""
    assert plan.until is not None
    found, unit = plan.until, plan.target.unit
    wanted = f"a half width of {found.wanted:.3g} {unit} ({100 * found.wanted / plan.largest:.2g} %)"
    if found.more == 0:
        return f"{wanted} is reached: the widest is {found.widest:.3g} {unit}"
    if found.more is None:
        return f"{wanted} is likely out of reach: more measurements bring {found.widest:.3g} to {found.least:.3g} {unit}"
    return f"{wanted}: likely {found.more} more (the widest is {found.widest:.3g} {unit} now)"
