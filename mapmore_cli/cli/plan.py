"""`mapmore plan`: what to measure next."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from mapmore_cli.cli.console import NO_OVERRIDES, RUNS, AsJson, Config, Overrides, Quiet, Runs, print_view
from mapmore_cli.cli.outputs import Outputs, refuse_unknown, write_result
from mapmore_cli.domain.errors import UsageError

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
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.cli.views.measured import of_plan, plan_table
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
        from mapmore_cli.reporting.figures.commands import plan_drawing

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
