"""Implement `mapmore batch`: many runs at once, with one table of their scores."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import chain
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
    from mapmore_cli.pipeline.jobs import Finished, Job
    from mapmore_cli.reporting.table import Table
    from mapmore_cli.study.campaign import Entry

    Result = Finished | BaseException

Configs = Annotated[
    list[Path], Argument(metavar="CONFIG...", help="Experiment specs or campaigns (YAML).")
]
PROCESSORS = os.cpu_count() or 1
Jobs = Annotated[
    int,
    Option(
        *("--jobs", "-j"),
        metavar="N",
        min=1,
        show_default="number of processors",
        help="Runs at a time.",
    ),
]
Cluster = Annotated[
    str | None,
    Option(
        "--cluster",
        metavar="ADDRESS",
        help="Address of the Dask scheduler of a cluster, for example tcp://host:8786.",
    ),
]
ClusterFile = Annotated[
    Path | None,
    Option(
        "--cluster-file",
        metavar="FILE",
        help="The Dask scheduler of a cluster, given by the file that it wrote.",
    ),
]
NoPages = Annotated[
    bool,
    Option(
        "--no-pages",
        help=(
            "Do not write the pages of the runs. The same command without this option writes them "
            "later."
        ),
    ),
]


def batch(
    configs: Configs,
    runs: Runs = RUNS,
    jobs: Jobs = PROCESSORS,
    cluster: Cluster = None,
    cluster_file: ClusterFile = None,
    overrides: Overrides = NONE,
    no_pages: NoPages = False,
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
    from mapmore_cli.annexes.campaigns.page import run_names, write_page
    from mapmore_cli.annexes.campaigns.sealed import known_by_seal
    from mapmore_cli.annexes.campaigns.workers import stoppable
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
    todo = [
        Job(entry.config, runs, entry.overrides, replace(options, campaign=entry.campaign), until)
        for entry in entries
    ]
    known = map(known_by_seal, todo, [entry.called for entry in entries])
    sealed = {number: result for number, result in enumerate(known) if result is not None}
    if any(path is not None and path.exists() for path in (junit, summary)):
        for number, job in enumerate(todo):
            note_sources(job, sealed.get(number))
    names = run_names(entries, campaigns, {number: entries[number].called for number in sealed})
    # if the page of a campaign cannot be written, the campaign is refused before its runs begin
    for campaign in campaigns:
        refuse_foreign(runs / campaign.campaign.campaign, CAMPAIGN_RECORD)
    with Reporter(quiet) as reporter, stoppable():
        results = _results(todo, sealed, names, jobs, cluster or cluster_file, reporter)
        pages = [
            write_page(
                campaign.campaign,
                {names[number]: results[number] for number in campaign.jobs},
                runs,
                reporter.warn,
            )
            for campaign in campaigns
        ]
        finished = [result for result in results if not isinstance(result, BaseException)]
        write_runs_page(runs, finished, reporter.warn)
    ended = dict(zip(names, results, strict=True))
    view = _view(entries, names, ended, pages, no_pages)
    print_view(view, as_json)
    write_ci_files(junit, summary, ended, view.tables)
    if code := max(map(_code, results)):
        raise Exit(code)


def _view(
    entries: Sequence[Entry],
    names: Sequence[str],
    ended: Mapping[str, Result],
    pages: Sequence[tuple[Path, Sequence[Table]]],
    no_pages: bool,
) -> View:
    """Return the output of the command: lines that say how each run ended, the tables on the
    `pages` of the campaigns, and tables of the runs that belong to no campaign. With `no_pages`,
    the paths of the pages of runs are left out.
    """
    from mapmore_cli.annexes.campaigns.page import scores_of
    from mapmore_cli.annexes.campaigns.tables import campaign_tables
    from mapmore_cli.cli.views import page_lines

    places = list(zip(entries, names, strict=True))
    alone = {name: ended[name] for entry, name in places if entry.campaign is None}
    tables = [table for _, of_page in pages for table in of_page]
    if alone:
        tables += campaign_tables(scores_of(alone))
    finished = [run for run in ended.values() if not isinstance(run, BaseException)]
    lines = [line for run in finished if not no_pages for line in page_lines(run.run_dir)]
    lines += [f"campaign page: {path}" for path, _ in pages]
    lines += [line for name, result in ended.items() for line in _ends(name, result)]
    documents = [_run_document(entry.config, name, ended[name]) for entry, name in places]
    return View({"runs": documents}, tuple(tables), tuple(lines))


def _results(
    todo: Sequence[Job],
    sealed: Mapping[int, Finished],
    names: Sequence[str],
    jobs: int,
    scheduler: str | Path | None,
    reporter: Reporter,
) -> list[Result]:
    """Do the jobs that have no result in `sealed`, and return the results of all jobs, in the order
    of `todo`. The `reporter` prints how each run ended. Without a `scheduler`, the jobs are done by
    processes of this machine, `jobs` at a time.
    """
    from mapmore_cli.annexes.campaigns.cluster import run_on_cluster
    from mapmore_cli.annexes.campaigns.sealed import run_and_seal
    from mapmore_cli.annexes.campaigns.workers import in_processes

    def tell(number: int, message: str) -> None:
        reporter.warn(RunWarning.of(names[number], message))

    waiting = {number: job for number, job in enumerate(todo) if number not in sealed}
    outcomes = (
        in_processes(run_and_seal, waiting, jobs, tell)
        if scheduler is None or not waiting
        else run_on_cluster(waiting, scheduler, todo[0].runs, tell, reporter.say)
    )
    results: dict[int, Result] = {}
    with closing(outcomes):
        for number, result in chain(sealed.items(), outcomes):
            results[number] = (
                result
                if isinstance(result, BaseException)
                else replace(result, run_dir=todo[number].runs / result.name)
            )
            _tell(reporter, names[number], result, f"{len(results)} of {len(todo)}")
    return [results[number] for number in range(len(todo))]


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
    """Return the lines that say how a run ended: one line for each output, or the error if the run
    failed.
    """
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
