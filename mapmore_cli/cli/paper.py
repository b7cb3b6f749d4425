"""`mapmore paper`: published tables and figures beside those of our runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli.console import RUNS, AsJson, Quiet, Runs, print_view
from mapmore_cli.cli.views.fitted import View
from mapmore_cli.storage.atomic import refusals_told, write_text


def paper(
    configs: Annotated[list[Path], typer.Argument(metavar="CONFIG...", help="Papers (YAML).", show_default=False)],
    runs: Runs = RUNS,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="The page; DIR/paper.html of the runs by default.")
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Put published tables and figures beside ours.

    Brings the runs of each paper up to date, judges by the rules of the file, and writes one page.
    The exit code is the highest of the runs.
    """
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.spec.paper import load_paper
    from mapmore_cli.study.paper.page import compare_paper, document, overview, page, verdicts_table

    loaded = [load_paper(config) for config in configs]
    with Reporter(quiet) as reporter:
        ended = [compare_paper(one, runs, reporter.complain) for one in loaded]
    found = [result for result, _ in ended]
    target = out or runs / "paper.html"
    with refusals_told(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        write_text(target, page(found))
    print_view(View({**document(found), "page": str(target)}, (overview(found), verdicts_table(found)), (f"page: {target}",)), as_json)
    if code := max(code for _, code in ended):
        raise typer.Exit(code)
