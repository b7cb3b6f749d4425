"""`mapmore plan`: what to measure next."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from mapmore_cli.cli.console import NO_OVERRIDES, RUNS, AsJson, Config, Overrides, Quiet, Runs
from mapmore_cli.cli.outputs import Outputs, refuse_unknown, write_result
from mapmore_cli.cli.views.fitted import View
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.plan import Candidate, Plan
from mapmore_cli.reporting.table import Cell, Column, Table

if TYPE_CHECKING:
    from mapmore_cli.reporting.figures.drawing import Drawing


def plan(
    config: Config,
    points: Annotated[
        int | None,
        typer.Option("--points", metavar="N", min=1, max=100, help="Choose N points of the map in place of a level.", show_default=False),
    ] = None,
    until: Annotated[
        str | None,
        typer.Option(
            "--until", metavar="SIZE", help="Also say how many more are likely needed for that half width, as 2%.", show_default=False
        ),
    ] = None,
    cost: Annotated[
        str | None,
        typer.Option("--cost", metavar="NAME=PRICE,...", help="What a change costs, as pressure=1,strain=20.", show_default=False),
    ] = None,
    output: Outputs = None,
    runs: Runs = RUNS,
    overrides: Overrides = NO_OVERRIDES,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Say what to measure next, where the model is least sure.

    With levels, the model is made without each inner one; the next lies in the middle of the gap that is expected to err most. Without
    levels, or with --points, several models stand in a committee, and points go where these disagree and data are far. Held-out data are
    not used. Per cent are of the largest |target|.
    """
    from mapmore_cli.cli.console import print_view
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.spec.loader import load
    from mapmore_cli.study import planning

    refuse_unknown(output or [])
    prices = prices_of(cost)
    with Reporter(quiet) as reporter:
        found = planning.plan(
            load(config, overrides),
            runs,
            points=points,
            until=until,
            prices=prices,
            progress=reporter.progress,
            warn=reporter.warn,
            on_stage=reporter.stage,
        )

    def drawing() -> Drawing:
        from mapmore_cli.reporting.figures.plan import plan_drawing

        return plan_drawing(found)

    for path in output or []:
        write_result(path, lambda: plan_table(found), drawing)
    print_view(of_plan(found), as_json)


def prices_of(text: str | None) -> dict[str, float]:
    """Return the price of each quantity, `pressure=1,strain=20`; raises UsageError for what is none."""
    found: dict[str, float] = {}
    for part in text.split(",") if text else []:
        name, _, price = part.partition("=")
        try:
            found[name.strip()] = float(price)
        except ValueError:
            found[name.strip()] = -1.0
        if not 0 < found[name.strip()] < float("inf"):
            raise UsageError(f"--cost {part.strip()}: is no price", "write, for example, `--cost pressure=1,strain=20`")
    return found


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
