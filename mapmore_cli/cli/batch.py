"""`mapmore batch`: many runs at once, and one table of their scores."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mapmore_cli.cli.exits import exit_code, message
from mapmore_cli.cli.options import NO_OVERRIDES, RUNS, AsJson, Force, Overrides, Quiet, Rehash, Runs
from mapmore_cli.domain.errors import LimitMissed, SpecError, UsageError

if TYPE_CHECKING:
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.cli.views.view import View
    from mapmore_cli.reporting.tables import Table
    from mapmore_cli.spec.campaign import Entry
    from mapmore_cli.stages.campaigns.batch import Finished


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(batch)


def batch(
    configs: Annotated[list[Path], typer.Argument(metavar="CONFIG...", help="Experiment specs or campaigns (YAML).", show_default=False)],
    runs: Runs = RUNS,
    jobs: Annotated[int, typer.Option("--jobs", "-j", metavar="N", min=1, help="Runs at a time.")] = os.cpu_count() or 1,
    overrides: Overrides = NO_OVERRIDES,
    force: Force = False,
    rehash: Rehash = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Run several specs, or the runs of campaigns, at a time.

    One that fails does not stop the rest; the exit code is the highest of all. A campaign gets a page of its own.
    """
    from mapmore_cli.cli.campaigns import expanded, write_page
    from mapmore_cli.cli.console import print_view
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.cli.views.view import View
    from mapmore_cli.stages.campaigns.batch import Job, run_all

    campaigns, entries = expanded(configs, overrides)
    _refuse_repeated_names(entries)
    todo = [Job(entry.config, runs, entry.overrides, force, rehash) for entry in entries]
    results: dict[int, Finished | BaseException] = {}
    with Reporter(quiet) as reporter:
        for number, result in run_all(todo, jobs):
            results[number] = result
            _tell(reporter, entries[number].config, result, f"{len(results)} of {len(todo)}")
    ordered = [(entry.config, results[number]) for number, entry in enumerate(entries)]
    view = _joint(ordered)
    pages = [write_page(campaign, [results[number] for number in campaign.jobs], runs) for campaign in campaigns]
    if pages:
        taken = {number for campaign in campaigns for number in campaign.jobs}
        alone = [result for number, result in results.items() if number not in taken and not isinstance(result, BaseException)]
        tables = (*(table for page in pages for table in page.tables), *((_joint_table(alone),) if alone else ()))
        view = View(view.document, tables, (*view.lines, *(line for page in pages for line in page.lines)))
    print_view(view, as_json)
    if code := max(_code(result) for _, result in ordered):
        raise typer.Exit(code)


def _refuse_repeated_names(entries: Sequence[Entry]) -> None:
    """Two runs of one name would write the same folder."""
    from mapmore_cli.spec.loader import load

    names: dict[str, Path] = {}
    for entry in entries:
        try:
            name = load(entry.config, entry.overrides).spec.name
        except SpecError:
            continue  # its own run will say so
        if name in names:
            raise UsageError(f"{names[name]} and {entry.config} have the same name, '{name}'", "give each spec a `name` of its own")
        names[name] = entry.config


def _tell(reporter: Reporter, config: Path, result: Finished | BaseException, count: str) -> None:
    if isinstance(result, BaseException):
        reporter.complain(f"{config}: {message(result)}")
        return
    for warning in result.warnings:
        reporter.warn(f"{result.name}: {warning}")
    reporter.say(f"{result.name}: done ({count})")
    for limit in result.missed:
        reporter.complain(f"{result.name}: {message(LimitMissed(limit))}")


def _code(result: Finished | BaseException) -> int:
    if isinstance(result, BaseException):
        return exit_code(result)
    return LimitMissed.exit_code if result.missed else 0


def _joint(results: Sequence[tuple[Path, Finished | BaseException]]) -> View:
    """One document for all runs; one table of their pooled scores, and where the pages are."""
    from mapmore_cli.cli.views.files import page_lines
    from mapmore_cli.cli.views.view import View

    finished = [result for _, result in results if not isinstance(result, BaseException)]
    pages = tuple(line for run in finished for line in page_lines(run.run_dir))
    return View({"runs": [_document(config, result) for config, result in results]}, (_joint_table(finished),), pages)


def _document(config: Path, result: Finished | BaseException) -> dict[str, Any]:
    from mapmore_cli.cli.views.scored import of_scores

    head: dict[str, Any] = {"config": str(config), "exit_code": _code(result)}
    if isinstance(result, BaseException):
        return {**head, "error": message(result)}
    run = {"name": result.name, "run_dir": str(result.run_dir), "stages": result.stages, "missed": result.missed}
    return {**head, **run, **of_scores(result.validation).document}


def _joint_table(finished: Sequence[Finished]) -> Table:
    from mapmore_cli.reporting.tables import Column, Table

    columns = (Column("run"), Column("model"), Column("data"), Column("NRMSE", "%", ".2f"), Column("published NRMSE", "%", ".3g"))
    rows = tuple((run.name, *cells) for run in finished for cells in _pooled(run))
    return Table("batch", "NRMSE of every run, all curves pooled", columns, rows)


def _pooled(run: Finished) -> list[tuple[str, str, float, float | None]]:
    """Model, split, NRMSE and published NRMSE in per cent; the latter beside the held-out rows, where there are any."""
    scores = sorted((s for s in run.validation.scores if s.curve == "all"), key=lambda s: s.split != "validate")
    published = run.published.nrmse if run.published else {}
    return [
        (s.model, s.split, 100 * s.nrmse, 100 * published[s.model] if s.split == scores[0].split and s.model in published else None)
        for s in scores
    ]
