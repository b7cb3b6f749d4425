"""`ingest`, `segment`, `fit`, `fuse`, `validate`, `report`, and `run`, which is all of them:
make-like commands over one spec.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mapmore_cli.cli import console
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import LimitMissed

if TYPE_CHECKING:
    from mapmore_cli.pipeline.runner import Options
    from mapmore_cli.spec.loader import LoadedSpec


def _stage_command(stage: str, summary: str) -> Callable[..., None]:
    """Return the function of the command that ends with a stage."""

    def command(
        config: console.Config,
        runs: console.Runs = console.RUNS,
        overrides: console.Overrides = console.NONE,
        force: console.Force = False,
        rehash: console.Rehash = False,
        no_check: console.NoCheck = False,
        explain: console.Explain = False,
        as_json: console.AsJson = False,
        quiet: console.Quiet = False,
        verbose: console.Verbose = False,
    ) -> None:
        from mapmore_cli.pipeline.runner import Options
        from mapmore_cli.spec.loader import load

        loaded, reporter = load(config, overrides), Reporter(quiet, verbose)
        if explain:
            _explain(loaded, runs, stage, reporter, as_json, Options(force, rehash))
        else:
            options = Options(force, rehash, not no_check)
            _bring_up_to_date(loaded, runs, stage, reporter, as_json, options)

    command.__doc__ = f"{summary} Brings the stages before it up to date first."
    return command


ingest = _stage_command("ingest", "Read the recordings and sort them into curves.")
segment = _stage_command("segment", "Cut the training curves into segments.")
fit = _stage_command("fit", "Select the terms of every segment.")
fuse = _stage_command("fuse", "Join the segments into one model that stands alone.")
validate = _stage_command("validate", "Score the model and its competitors.")
_report = _stage_command("report", "")


def report(
    config: console.Config,
    figures: Annotated[
        str | None,
        typer.Option(
            "--figures",
            metavar="NAMES",
            help="Draw these alone, as fit,error; or all, or none. Default: `report.figures`.",
        ),
    ] = None,
    runs: console.Runs = console.RUNS,
    overrides: console.Overrides = console.NONE,
    force: console.Force = False,
    rehash: console.Rehash = False,
    no_check: console.NoCheck = False,
    explain: console.Explain = False,
    as_json: console.AsJson = False,
    quiet: console.Quiet = False,
    verbose: console.Verbose = False,
) -> None:
    """Write the page, its figures and tables. Brings the stages before it up to date first."""
    from mapmore_cli.domain.scores import FIGURES

    if figures is not None:
        names = {"all": ", ".join(FIGURES), "none": ""}.get(figures, figures)
        overrides = [*overrides, f"report.figures=[{names}]"]
    _report(config, runs, overrides, force, rehash, no_check, explain, as_json, quiet, verbose)


def run(
    config: console.Config,
    runs: console.Runs = console.RUNS,
    overrides: console.Overrides = console.NONE,
    force: console.Force = False,
    rehash: console.Rehash = False,
    no_check: console.NoCheck = False,
    explain: console.Explain = False,
    print_spec: Annotated[
        bool,
        typer.Option(
            "--print-spec", help="Print the spec with its defaults filled in; do nothing."
        ),
    ] = False,
    junit: console.Junit = None,
    summary: console.Summary = None,
    as_json: console.AsJson = False,
    quiet: console.Quiet = False,
    verbose: console.Verbose = False,
) -> None:
    """Run all stages; print scores and the page's path."""
    from mapmore_cli.pipeline.runner import Options
    from mapmore_cli.spec.loader import load

    loaded, reporter = load(config, overrides), Reporter(quiet, verbose)
    if print_spec:
        print(loaded.resolved, end="")
    elif explain:
        _explain(loaded, runs, "report", reporter, as_json, Options(force, rehash))
    else:
        try:
            options = Options(force, rehash, not no_check)
            _bring_up_to_date(loaded, runs, "run", reporter, as_json, options, junit, summary)
        except LimitMissed:  # which the files tell already
            raise
        except Exception as error:
            console.write_ci_files(junit, summary, {loaded.spec.name: error})
            raise


def _explain(
    loaded: LoadedSpec,
    runs: Path,
    until: str,
    reporter: Reporter,
    as_json: bool,
    options: Options,
) -> None:
    """Print which stages would run, and why; null in the document is a stage that is up to date."""
    from mapmore_cli.pipeline.runner import explain
    from mapmore_cli.reporting.table import Column, Table

    with reporter:
        reasons = explain(loaded, runs, until, options=options, warn=reporter.warn)
    rows = tuple((stage, reason or "up-to-date") for stage, reason in reasons)
    table = Table("stages", loaded.spec.name, (Column("stage"), Column("would run because")), rows)
    console.print_view(
        console.View({"name": loaded.spec.name, "stages": dict(reasons)}, (table,)), as_json
    )


def _bring_up_to_date(
    loaded: LoadedSpec,
    runs: Path,
    command: str,
    reporter: Reporter,
    as_json: bool,
    options: Options,
    junit: Path | None = None,
    summary: Path | None = None,
) -> None:
    """Do what is stale, print what the command is for, and then fail where the spec's limits are
    missed.
    """
    from mapmore_cli.cli.compared import search_document
    from mapmore_cli.cli.views import of_scores, of_stage, page_lines, verdict_lines
    from mapmore_cli.pipeline.jobs import Finished
    from mapmore_cli.pipeline.runner import bring_up_to_date
    from mapmore_cli.storage.run_folder import RunFiles

    started, warnings = time.perf_counter(), list[str]()
    until = "report" if command == "run" else command
    questions = loaded.spec.unconfirmed

    with reporter:

        def warn(message: str) -> None:
            warnings.append(message)
            reporter.warn(message)

        listeners = reporter.listeners
        listeners["warn"] = warn
        outcome = bring_up_to_date(loaded, runs, until, options=options, **listeners)
        if questions:
            guesses = (
                "1 guess of the spec is"
                if len(questions) == 1
                else f"{len(questions)} guesses of the spec are"
            )
            warn(
                f"{guesses} not confirmed: see `mapmore check {loaded.path}`, and `--confirm` "
                "there where all are right"
            )
        finished = (
            Finished.of(loaded, outcome, warnings, started)
            if command in ("validate", "run")
            else None
        )
        for message in () if finished is None else finished.table.warnings:
            reporter.warn(message)
    head: dict[str, Any] = {
        "name": outcome.name,
        "run_dir": str(outcome.run_dir),
        "stages": outcome.stages,
    }
    if "search" in outcome.stages and (search := RunFiles(outcome.run_dir).search()):
        head["search"] = search_document(search)
    if finished is None:
        console.print_view(of_stage(command, outcome.run_dir).under(head), as_json)
        return
    scores = of_scores(finished.table, finished.published)
    told = {"missed": finished.missed, "warnings": finished.warnings, "unconfirmed": questions}
    done = outcome.run_dir
    lines = (*verdict_lines(done), *page_lines(done)) if command == "run" else ()
    console.print_view(
        console.View({**head, **scores.document, **told}, scores.tables, lines), as_json
    )
    console.write_ci_files(junit, summary, {finished.name: finished}, scores.tables)
    if finished.missed:
        raise LimitMissed(
            "; ".join(finished.missed), "the results are complete; see validate.require in the spec"
        )
