"""Implement `mapmore batch`: many runs at once, with one table of their scores."""

from __future__ import annotations

import os
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Exit, Option

from mapmore_cli.cli.annotations import annotate
from mapmore_cli.cli.console import (
    NONE,
    RUNS,
    AsJson,
    Force,
    Junit,
    NoCheck,
    Overrides,
    Quiet,
    Rehash,
    Runs,
    Summary,
    View,
    error_document,
    exit_code,
    message,
    print_view,
    write_ci_files,
)
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import LimitMissed, RunWarning, UsageError, error_text

if TYPE_CHECKING:
    from mapmore_cli.pipeline.jobs import Finished

    Result = Finished | BaseException


def batch(
    configs: Annotated[
        list[Path],
        Argument(metavar="CONFIG...", help="Experiment specs or campaigns (YAML)."),
    ],
    runs: Runs = RUNS,
    jobs: Annotated[
        int, Option("--jobs", "-j", metavar="N", min=1, help="Runs at a time.")
    ] = os.cpu_count() or 1,
    cluster: Annotated[
        str | None,
        Option(
            "--cluster",
            metavar="ADDRESS",
            help="Address of the Dask scheduler of a cluster, for example tcp://host:8786.",
        ),
    ] = None,
    cluster_file: Annotated[
        Path | None,
        Option(
            "--cluster-file",
            metavar="FILE",
            help="The Dask scheduler of a cluster, given by the file that it wrote.",
        ),
    ] = None,
    overrides: Overrides = NONE,
    no_pages: Annotated[
        bool,
        Option(
            "--no-pages",
            help=(
                "Do not write the pages of the runs. The same command without this option "
                "writes them later."
            ),
        ),
    ] = False,
    force: Force = False,
    rehash: Rehash = False,
    no_check: NoCheck = False,
    junit: Junit = None,
    summary: Summary = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Run several specs, or the runs of campaigns, at the same time.

    A failed run does not stop the others; the exit code is the highest exit code of all runs. Each
    campaign gets its own page.
    """
    from mapmore_cli.annexes.campaigns import workers
    from mapmore_cli.annexes.campaigns.cluster import run_on_cluster
    from mapmore_cli.annexes.campaigns.page import run_names, scores_of, write_page
    from mapmore_cli.annexes.campaigns.sealed import known_by_seal, run_and_seal
    from mapmore_cli.annexes.campaigns.tables import campaign_tables
    from mapmore_cli.cli.views import page_lines
    from mapmore_cli.pipeline.jobs import Job, note_sources
    from mapmore_cli.pipeline.runner import Options
    from mapmore_cli.pipeline.runs_page import write_runs_page
    from mapmore_cli.storage.inputs import note_read
    from mapmore_cli.storage.run_folder import refuse_foreign
    from mapmore_cli.storage.run_record import CAMPAIGN_RECORD
    from mapmore_cli.study.campaign import expanded

    if cluster is not None and cluster_file is not None:
        raise UsageError("--cluster and --cluster-file exclude each other", "leave out one of them")
    campaigns, entries = expanded(configs, overrides)
    note_read([] if cluster_file is None else [cluster_file])
    options = Options(force, rehash, not no_check)
    until = "validate" if no_pages else "report"
    todo = {
        number: Job(
            entry.config, runs, entry.overrides, replace(options, campaign=entry.campaign), until
        )
        for number, entry in enumerate(entries)
    }
    sealed = {
        number: known
        for number, entry in enumerate(entries)
        if (known := known_by_seal(todo[number], entry.called)) is not None
    }
    if any(path is not None and path.exists() for path in (junit, summary)):
        for number, job in todo.items():
            note_sources(job, sealed.get(number))
    results: dict[int, Result] = {**sealed}
    names = run_names(entries, campaigns, {number: entries[number].called for number in results})
    # if the page of a campaign cannot be written, the campaign is refused before its runs begin
    for campaign in campaigns:
        refuse_foreign(runs / campaign.campaign.campaign, CAMPAIGN_RECORD)
    waiting = {number: job for number, job in todo.items() if number not in results}
    scheduler = cluster or cluster_file
    with Reporter(quiet) as reporter, workers.stoppable():

        def tell(number: int, message: str) -> None:
            reporter.warn(RunWarning.of(names[number], message))

        outcomes = (
            workers.in_processes(run_and_seal, waiting, jobs, tell)
            if scheduler is None or not waiting
            else run_on_cluster(waiting, scheduler, runs, tell, reporter.say)
        )
        with closing(outcomes):
            for count, (number, result) in enumerate(results.items(), 1):
                _tell(reporter, names[number], result, f"{count} of {len(todo)}")
            for number, result in outcomes:
                results[number] = (
                    result
                    if isinstance(result, BaseException)
                    else replace(result, run_dir=runs / result.name)
                )
                _tell(reporter, names[number], result, f"{len(results)} of {len(todo)}")
        ordered = {name: results[number] for number, name in enumerate(names)}
        pages = [
            write_page(
                campaign.campaign,
                {names[number]: results[number] for number in campaign.jobs},
                runs,
                reporter.warn,
            )
            for campaign in campaigns
        ]
        done = [result for result in results.values() if not isinstance(result, BaseException)]
        write_runs_page(runs, done, reporter.warn)
    in_campaigns = {names[number] for campaign in campaigns for number in campaign.jobs}
    alone = {name: result for name, result in ordered.items() if name not in in_campaigns}
    tables = [table for _, of_page in pages for table in of_page]
    if alone:
        tables += campaign_tables(scores_of(alone))
    finished = [run for run in ordered.values() if not isinstance(run, BaseException)]
    lines = [line for run in finished if not no_pages for line in page_lines(run.run_dir)]
    lines += [f"campaign page: {path}" for path, _ in pages]
    lines += [line for name, result in ordered.items() for line in _ends(name, result)]
    documents = [
        _run_document(entry.config, name, ordered[name])
        for entry, name in zip(entries, names, strict=True)
    ]
    print_view(View({"runs": documents}, tuple(tables), tuple(lines)), as_json)
    write_ci_files(junit, summary, ordered, tables)
    if code := max(map(_code, ordered.values())):
        raise Exit(code)


def _tell(reporter: Reporter, name: str, result: Result, count: str) -> None:
    if isinstance(result, BaseException):
        reporter.complain(f"{name}: {message(result)}")
        annotate("error", error_text(result))
        return
    for warning in result.warnings:
        reporter.warn(RunWarning.of(name, warning))
    is_new = "done" in result.stages.values()
    reporter.say(f"{name}: {'done' if is_new else 'up to date'} ({count})")
    for limit in result.missed:
        reporter.complain(f"{name}: {message(LimitMissed(limit))}")


def _ends(name: str, result: Result) -> list[str]:
    """Return a line for each output that says how a run ended."""
    from mapmore_cli.domain.scores import OWN
    from mapmore_cli.reporting.score_tables import short_verdict

    if isinstance(result, BaseException):
        first, *_ = message(result).splitlines()
        return [f"{name}: failed: {first}"]
    return [f"{name}: {short_verdict(output, OWN)}" for output in result.table.each]


def _code(result: Result) -> int:
    if isinstance(result, BaseException):
        return exit_code(result)
    return LimitMissed.exit_code if result.missed else 0


def _run_document(config: Path, name: str, result: Result) -> dict[str, Any]:
    from mapmore_cli.cli.views import of_scores

    head: dict[str, Any] = {"config": str(config), "name": name, "exit_code": _code(result)}
    if isinstance(result, BaseException):
        return {**head, "error": error_document(result)}
    run = {
        "run_dir": str(result.run_dir),
        "stages": result.stages,
        "missed": result.missed,
        "warnings": result.warnings,
    }
    return {**head, **run, **of_scores(result.table).document}
