"""`ingest`, `segment`, `fit`, `fuse`, `validate`, `report`, and `run`, which is all of them:
make-like commands over one spec.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from inspect import Signature, signature
from typing import TYPE_CHECKING, Annotated, Any

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
    config: Config,
    command: str,
    *,
    figures: Annotated[
        str | None,
        Option(
            "--figures",
            metavar="NAMES",
            help="Draw these alone, as fit,error; or all, or none. Default: `report.figures`.",
        ),
    ] = None,
    runs: Runs = RUNS,
    overrides: Overrides = NONE,
    force: Force = False,
    rehash: Rehash = False,
    no_check: NoCheck = False,
    explain: Explain = False,
    print_spec: Annotated[
        bool,
        Option("--print-spec", help="Print the spec with its defaults filled in; do nothing."),
    ] = False,
    junit: Junit = None,
    summary: Summary = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Do what is stale up to the stage of a command, and print what the command is for."""
    from mapmore_cli.pipeline import runner
    from mapmore_cli.pipeline.jobs import Finished
    from mapmore_cli.reporting.order import FIGURES
    from mapmore_cli.study.loader import load

    if figures is not None:
        names = {"all": ", ".join(FIGURES), "none": ""}.get(figures, figures)
        overrides = [*overrides, f"report.figures=[{names}]"]
    loaded, reporter = load(config, overrides), Reporter(quiet, verbose)
    name, until = loaded.spec.name, "report" if command == "run" else command
    options = runner.Options(force, rehash, not no_check)
    if print_spec:
        print(loaded.resolved, end="")
        return
    if explain:
        with reporter:
            reasons = runner.explain(loaded, runs, until, options=options, warn=reporter.warn)
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
            outcome = runner.bring_up_to_date(loaded, runs, until, options=options, **listeners)
            if count := len(loaded.spec.unconfirmed):
                guesses = "guess of the spec is" if count == 1 else "guesses of the spec are"
                warn(
                    f"{count} {guesses} not confirmed: see `mapmore check {loaded.path}`, and "
                    "`--confirm` there where all are right"
                )
            if command in ("validate", "run"):
                finished = Finished.of(loaded, outcome, warnings, started)
                for message in finished.table.warnings:
                    reporter.warn(message)
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
                "the results are complete; see validate.require in the spec",
            )


def _of_reasons(name: str, reasons: dict[str, str | None]) -> View:
    """Return which stages would run, and why; null in the document is one that is up to date."""
    from mapmore_cli.reporting.table import Table

    rows = tuple((stage, reason or "up-to-date") for stage, reason in reasons.items())
    table = Table.of("stages", name, ("stage", "would run because"), rows)
    return View({"name": name, "stages": reasons}, (table,))


def _of_outcome(
    outcome: RunOutcome, command: str, finished: Finished | None, questions: tuple[str, ...]
) -> View:
    """Return the scores of a run that came to its end, else what its last stage found."""
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
    told = {"missed": finished.missed, "warnings": finished.warnings, "unconfirmed": questions}
    lines = (*verdict_lines(done), *page_lines(done)) if command == "run" else ()
    return View({**head, **scores.document, **told}, scores.tables, lines)


# The commands
# --------------------------------------------------------------------------------------------------

ALONE = ("command", "figures", "print_spec", "junit", "summary")
"""What a command takes of `_bring_up_to_date` only where it says so."""


def _command(name: str, summary: str, *own: str) -> Callable[..., None]:
    """Return the function of a command with what all take, and `own` options."""
    whole = signature(_bring_up_to_date, eval_str=True).parameters
    taken = [one for key, one in whole.items() if key not in ALONE or key in own]

    def command(**told: Any) -> None:
        _bring_up_to_date(command=name, **told)

    command.__doc__ = summary
    command.__signature__ = Signature(taken)  # type: ignore[attr-defined]
    command.__annotations__ = {one.name: one.annotation for one in taken}
    return command


BEFORE = "Brings the stages before it up to date first."
ingest = _command("ingest", f"Read the recordings and sort them into curves. {BEFORE}")
segment = _command("segment", f"Cut the training curves into segments. {BEFORE}")
fit = _command("fit", f"Select the terms of every segment. {BEFORE}")
fuse = _command("fuse", f"Join the segments into one model that stands alone. {BEFORE}")
validate = _command("validate", f"Score the model and its competitors. {BEFORE}")
report = _command("report", f"Write the page, its figures and tables. {BEFORE}", "figures")
run = _command(
    "run", "Run all stages; print scores and the page's path.", "print_spec", "junit", "summary"
)
