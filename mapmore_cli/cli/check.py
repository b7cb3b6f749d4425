"""Implement `mapmore check`, which tests whether a spec is valid and whether its data are
suitable.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Exit, Option

from mapmore_cli.cli.annotations import Kind, annotate
from mapmore_cli.cli.console import (
    NONE,
    RUNS,
    AsJson,
    Overrides,
    Quiet,
    Runs,
    exit_code,
    message,
    print_view,
    spec_of,
)
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.storage.atomic import write_own

if TYPE_CHECKING:
    from mapmore_cli.pipeline.inspection import Inspection
    from mapmore_cli.study.campaign import Entry
    from mapmore_cli.study.loader import LoadedSpec

LEVELS: dict[str, Kind] = {"error": "error", "warning": "warning", "hint": "notice"}
"""The kind of annotation for each severity of an issue."""


def check(
    config: Annotated[
        Path,
        Argument(metavar="CONFIG", help="Experiment spec or campaign (YAML), or name of a run."),
    ],
    overrides: Overrides = NONE,
    confirm: Annotated[
        bool,
        Option("--confirm", help="Confirm everything that is marked CHECK, and remove the marks."),
    ] = False,
    runs: Runs = RUNS,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Check a spec and its data, or a campaign, before a run."""
    from mapmore_cli.cli.compared import of_campaign, of_inspection
    from mapmore_cli.study.campaign import expanded
    from mapmore_cli.study.loader import confirmed, load

    config, overrides = spec_of(config, overrides, runs)
    if confirm and load(config).spec.unconfirmed:
        write_own(config, confirmed(config.read_text(encoding="utf-8")))
    campaigns, entries = expanded([config], overrides)
    with Reporter(quiet) as reporter:
        if not campaigns:
            loaded = load(config, overrides)
            inspection = _inspected(loaded, runs, reporter)
            view = of_inspection(inspection, loaded.spec.unconfirmed)
            print_view(view.under({"name": loaded.spec.name}), as_json)
            # the error is not raised: with `--json`, it would be printed as a second document
            if inspection.verdict is not None:
                print(message(inspection.verdict), file=sys.stderr)
                raise Exit(exit_code(inspection.verdict))
            return
        results = _inspections(entries, runs, reporter)
    print_view(of_campaign(results).under({"campaign": campaigns[0].campaign.campaign}), as_json)
    codes = [
        exit_code(fault)
        for result in results.values()
        if (fault := result if isinstance(result, MapmoreError) else result.verdict) is not None
    ]
    if codes:
        raise Exit(max(codes))


def _inspected(
    loaded: LoadedSpec, runs: Path, reporter: Reporter, before: Inspection | None = None
) -> Inspection:
    """Inspect a spec and its data, and print the issues as annotations for GitHub Actions. If the
    inspection `before` has read the same files in the same way, its data are used again.
    """
    from mapmore_cli.pipeline.inspection import inspect

    run_dir = runs / loaded.spec.name
    inspection = inspect(loaded, run_dir, reporter.progress, reporter.warn, before)
    for issue in inspection.issues:
        annotate(LEVELS[issue.severity], issue.text)
    return inspection


def _inspections(
    entries: Sequence[Entry], runs: Path, reporter: Reporter
) -> dict[str, Inspection | MapmoreError]:
    """Inspect every run of a campaign. Return the inspection of each run by its name, or the error
    that made the inspection impossible.
    """
    from mapmore_cli.study.loader import load

    results: dict[str, Inspection | MapmoreError] = {}
    before: Inspection | None = None
    for number, entry in enumerate(entries):
        reporter.progress("runs", number, len(entries))
        try:
            loaded = load(entry.config, entry.overrides)
            results[entry.called] = before = _inspected(loaded, runs, reporter, before)
        except MapmoreError as fault:
            results[entry.called] = fault
    return results
