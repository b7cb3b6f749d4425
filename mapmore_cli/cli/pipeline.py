"""Implement `ingest`, `segment`, `fit`, `fuse`, `validate`, `report`, and `run`, which runs all of
these stages. Like `make`, the commands repeat only stages that are not up to date.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from mapmore_cli.cli.console import (
    NONE,
    RUNS,
    AsJson,
    Config,
    Document,
    Explain,
    Force,
    Junit,
    NoCheck,
    Overrides,
    Quiet,
    Rehash,
    Runs,
    Summary,
    Verbose,
    View,
    print_view,
    write_ci_files,
)
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import LimitMissed

if TYPE_CHECKING:
    from mapmore_cli.pipeline.jobs import Finished
    from mapmore_cli.pipeline.runner import RunOutcome


def _bring_up_to_date(
    command: str,
    config: Path,
    runs: Path,
    overrides: list[str],
    options: tuple[bool, bool, bool],
    explain: bool,
    reporter: Reporter,
    as_json: bool,
    junit: Path | None = None,
    summary: Path | None = None,
) -> None:
    """Run the stages that are not up to date, up to the stage of a command, and print the result of
    the command.
    """
    from mapmore_cli.pipeline import runner
    from mapmore_cli.pipeline.jobs import Finished
    from mapmore_cli.pipeline.runs_page import write_runs_page
    from mapmore_cli.study.loader import load

    loaded = load(config, overrides)
    name, until = loaded.spec.name, "report" if command == "run" else command
    force, rehash, no_check = options
    how = runner.Options(force, rehash, not no_check)
    if explain:
        with reporter:
            reasons = runner.explain(loaded, runs, until, options=how, warn=reporter.warn)
        print_view(_of_reasons(name, dict(reasons)), as_json)
        return
    started, warnings, finished = time.perf_counter(), list[str](), None
    try:
        with reporter:

            def warn(message: str) -> None:
                warnings.append(message)
                reporter.warn(message)

            listeners = reporter.listeners
            listeners["warn"] = warn
            outcome = runner.bring_up_to_date(loaded, runs, until, options=how, **listeners)
            if loaded.spec.unconfirmed:
                from mapmore_cli.reporting.alerts import unconfirmed_sentence

                warn(unconfirmed_sentence(len(loaded.spec.unconfirmed)))
            if command in ("validate", "run"):
                finished = Finished.of(loaded, outcome, warnings, started)
                for alert in finished.alerts:
                    reporter.warn(alert.sentence)
                write_runs_page(runs, [finished], warn)
    except Exception as error:
        write_ci_files(junit, summary, {name: error})
        raise
    view = _of_outcome(outcome, command, finished, loaded.spec.unconfirmed)
    print_view(view, as_json)
    if finished is not None:
        write_ci_files(junit, summary, {name: finished}, view.tables)
        if finished.missed:
            raise LimitMissed(
                "; ".join(finished.missed),
                "the results are complete; the limits are set by validate.require in the spec",
            )


def _of_reasons(name: str, reasons: dict[str, str | None]) -> View:
    """Return the view of `--explain`: the stages that would run, and the reasons. In the document,
    null means that a stage is up to date.
    """
    from mapmore_cli.reporting.table import Table

    rows = tuple((stage, reason or "up to date") for stage, reason in reasons.items())
    table = Table.of("stages", name, ("stage", "would run because"), rows)
    return View({"name": name, "stages": reasons}, (table,))


def _of_outcome(
    outcome: RunOutcome, command: str, finished: Finished | None, questions: tuple[str, ...]
) -> View:
    """Return the view that a command prints: the scores for `validate` and `run`, otherwise the
    result of the stage of the command.
    """
    from mapmore_cli.cli.compared import search_document
    from mapmore_cli.cli.views import of_scores, of_stage, page_lines, verdict_lines
    from mapmore_cli.storage.run_folder import RunFiles

    done = outcome.run_dir
    head: Document = {"name": outcome.name, "run_dir": str(done), "stages": outcome.stages}
    if "search" in outcome.stages and (search := RunFiles(done).search()):
        head["search"] = search_document(search)
    if finished is None:
        return of_stage(command, done).under(head)
    scores = of_scores(finished.table, finished.published)
    remarks = {
        "missed": finished.missed,
        "warnings": finished.warnings,
        "unconfirmed": questions,
        "alerts": finished.alerts,
    }
    lines = (*verdict_lines(done), *page_lines(done)) if command == "run" else ()
    return View({**head, **scores.document, **remarks}, scores.tables, lines)


# Commands

Figures = Annotated[
    str | None,
    Option(
        "--figures",
        metavar="NAMES",
        help=(
            "Draw only these figures, for example fit,error, or `all`: as for print, and also as "
            "SVG files. `none` draws none. Default: `report.figures`, in the formats of "
            "`report.formats`."
        ),
    ),
]
PrintSpec = Annotated[
    bool, Option("--print-spec", help="Print the spec with all default values; run nothing.")
]


def _with_figures(overrides: list[str], figures: str | None) -> list[str]:
    """Return the overrides of the spec. If the option --figures is given, also set the key
    `report.figures` and, if any figures are requested, the key `report.formats`.
    """
    from mapmore_cli.reporting.order import FIGURES

    if figures is None:
        return overrides
    names = {"all": ", ".join(FIGURES), "none": ""}.get(figures, figures)
    files = ["report.formats=[html, csv, svg]"] if names else []
    return [*overrides, f"report.figures=[{names}]", *files]


def _stage(name: str, about: str) -> Callable[..., None]:
    """Return the command of one stage. It runs this stage and all earlier stages that are not up to
    date. `about` is the help text of the command.
    """

    def bring(
        config: Config,
        figures: Figures = None,
        runs: Runs = RUNS,
        overrides: Overrides = NONE,
        force: Force = False,
        rehash: Rehash = False,
        no_check: NoCheck = False,
        explain: Explain = False,
        as_json: AsJson = False,
        quiet: Quiet = False,
        verbose: Verbose = False,
    ) -> None:
        how, overrides = (force, rehash, no_check), _with_figures(overrides, figures)
        _bring_up_to_date(
            name, config, runs, overrides, how, explain, Reporter(quiet, verbose), as_json
        )

    bring.__doc__ = about
    return bring


BEFORE = "Brings the stages before it up to date first."

ingest = _stage("ingest", "Read the recordings and sort them into curves.")
segment = _stage("segment", f"Cut the training curves into segments. {BEFORE}")
fit = _stage("fit", f"Select the terms of every segment. {BEFORE}")
fuse = _stage("fuse", f"Join the segments into one model that stands alone. {BEFORE}")
validate = _stage("validate", f"Score the model and its competitors. {BEFORE}")


report = _stage("report", f"Write the page, its figures and tables. {BEFORE}")


def run(
    config: Config,
    figures: Figures = None,
    runs: Runs = RUNS,
    overrides: Overrides = NONE,
    force: Force = False,
    rehash: Rehash = False,
    no_check: NoCheck = False,
    explain: Explain = False,
    print_spec: PrintSpec = False,
    junit: Junit = None,
    summary: Summary = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Run all stages; print the scores and the path of the page."""
    overrides = _with_figures(overrides, figures)
    if print_spec:
        from mapmore_cli.study.loader import load

        print(load(config, overrides).resolved, end="")
        return
    how, reporter = (force, rehash, no_check), Reporter(quiet, verbose)
    _bring_up_to_date(
        "run", config, runs, overrides, how, explain, reporter, as_json, junit, summary
    )
