"""`mapmore compare`: has this muscle changed? `mapmore paper`: published tables and figures beside those of our runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli import console
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import DataError, LimitMissed, UsageError
from mapmore_cli.storage.atomic import refusals_told, write_text


def compare(
    models: Annotated[list[str], typer.Argument(metavar="BEFORE AFTER...", help="Runs, tags (2026-spring, NAME@TAG) or model files.")],
    margin: Annotated[float, typer.Option("--margin", metavar="SHARE", min=0.0, help="Relative change that is of no interest.")] = 0.01,
    fail_on: Annotated[
        str | None,
        typer.Option("--fail-on", metavar="WHEN", help="Exit 6 where the muscle `changed`, or where force did by more than 0.03."),
    ] = None,
    figure: Annotated[
        Path | None, typer.Option("--figure", metavar="FILE", help="Draw the drift over all models (.svg .pdf .png .pgf).")
    ] = None,
    archive: console.Archive = console.ARCHIVE,
    runs: console.Runs = console.RUNS,
    as_json: console.AsJson = False,
) -> None:
    """Say whether a muscle has changed.

    The first model is compared with each of the others, which come in the order of time.
    """
    from mapmore_cli.cli.views.compared import of_comparisons
    from mapmore_cli.modelling.validation import comparison
    from mapmore_cli.storage.artefacts import read_model
    from mapmore_cli.study.campaigns.archive import find_model

    if len(models) < 2:
        raise UsageError("compare needs two models", "name the earlier one first, as `mapmore compare 2025-autumn my-run`")
    limit = _limit(fail_on)
    console.refuse_endings([figure] if figure else [], console.FIGURE_FILES, "no figure of the drift ends so")
    found = [read_model(find_model(text, runs, archive)) for text in models]
    try:
        results = [comparison.compare(found[0], later, margin) for later in found[1:]]
    except ValueError as fault:
        remedy = "compare models of the same quantities that have curves in common"
        raise DataError(f"{models[0]}, {models[-1]}: {fault}", remedy) from fault
    if figure is not None:
        from mapmore_cli.reporting.figures.campaign import drift_drawing

        console.write_figure(figure, drift_drawing(models, comparison.reference_points(found), found[0].output))
    console.print_view(of_comparisons(models, results), as_json)
    last = results[-1]
    if last.changed if limit is None and fail_on else limit is not None and abs(last.ratio - 1) > limit:
        raise LimitMissed(f"{models[-1]}: force is {last.ratio:.4g} times that of {models[0]}", "see the tables; --fail-on sets the limit")


def _limit(fail_on: str | None) -> float | None:
    """Return the relative change that is too large; None where none is given, or the word `changed` decides."""
    if fail_on in (None, "changed"):
        return None
    try:
        limit = float(fail_on or "")
    except ValueError:
        limit = -1.0
    if not 0 <= limit < float("inf"):
        raise UsageError(f"--fail-on {fail_on}: is neither `changed` nor a relative change", "write `--fail-on 0.03` for three per cent")
    return limit


def paper(
    configs: Annotated[list[Path], typer.Argument(metavar="CONFIG...", help="Papers (YAML).")],
    runs: console.Runs = console.RUNS,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="The page; DIR/paper.html of the runs by default.")
    ] = None,
    as_json: console.AsJson = False,
    quiet: console.Quiet = False,
) -> None:
    """Put published tables and figures beside ours.

    Brings the runs of each paper up to date, judges by the rules of the file, and writes one page.
    The exit code is the highest of the runs.
    """
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
    view = console.View({**document(found), "page": str(target)}, (overview(found), verdicts_table(found)), (f"page: {target}",))
    console.print_view(view, as_json)
    if code := max(code for _, code in ended):
        raise typer.Exit(code)
