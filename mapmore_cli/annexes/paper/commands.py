"""Published tables and figures beside ours: `mapmore paper`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Exit, Option

from mapmore_cli.cli.console import RUNS, AsJson, Quiet, Runs, View, picked, print_view
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.storage.atomic import refusals_told, write_text

if TYPE_CHECKING:
    from mapmore_cli.annexes.paper.paper import Told


def paper(
    configs: Annotated[list[Path], Argument(metavar="CONFIG...", help="Papers (YAML).")],
    runs: Runs = RUNS,
    out: Annotated[
        Path | None,
        Option(
            "--out", "-o", metavar="FILE", help="The page; DIR/paper.html of the runs by default."
        ),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Put published tables and figures beside ours.

    Brings the runs of each paper up to date, judges by the rules of the file, and writes one page.
    The exit code is the highest of the runs.
    """
    from mapmore_cli.annexes.paper.paper import (
        compare_paper,
        counts,
        overview,
        page,
        verdicts_table,
    )
    from mapmore_cli.study.paper import load_paper

    loaded = [load_paper(config) for config in configs]
    with Reporter(quiet) as reporter:
        ended = [compare_paper(one, runs, reporter.complain) for one in loaded]
    compared = [result for result, _ in ended]
    target = out or runs / "paper.html"
    with refusals_told(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        write_text(target, page(compared, target))
    documents = [
        {
            "paper": one.loaded.spec.paper,
            "counts": {
                kind: {"agree": agree, "compared": every}
                for kind, (agree, every) in counts(one.compared).items()
            },
            "items": [
                {
                    **picked(result.item, "id", "status", "place"),
                    "verdicts": result.verdicts,
                    "because": [_told(reason) for reason in result.reasons],
                    "failed": result.failed or None,
                }
                for result in one.results
            ],
            "claims": [
                {**_told(claim), **picked(claim.shown, "of", "place")} for claim in one.claims
            ],
        }
        for one in compared
    ]
    tables = (overview(compared), verdicts_table(compared))
    print_view(
        View({"papers": documents, "page": str(target)}, tables, (f"page: {target}",)),
        as_json,
    )
    if code := max(code for _, code in ended):
        raise Exit(code)


def _told(one: Told) -> dict[str, str]:
    return {"says": one.shown.says, "verdict": one.verdict, "numbers": one.numbers}
