"""Implement `mapmore check`, which tests whether a spec is valid and whether its data suit it."""

from __future__ import annotations

import sys
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
    from mapmore_cli.pipeline.inspection import inspect
    from mapmore_cli.study.campaign import expanded
    from mapmore_cli.study.loader import LoadedSpec, confirmed, load

    config, overrides = spec_of(config, overrides, runs)
    if confirm and load(config).spec.unconfirmed:
        write_own(config, confirmed(config.read_text(encoding="utf-8")))
    campaigns, entries = expanded([config], overrides)
    with Reporter(quiet) as reporter:

        def inspected(loaded: LoadedSpec, before: Inspection | None = None) -> Inspection:
            inspection = inspect(
                loaded, runs / loaded.spec.name, reporter.progress, reporter.warn, before
            )
            for issue in inspection.issues:
                annotate(LEVELS[issue.severity], issue.text)
            return inspection

        if not campaigns:
            loaded = load(entries[0].config, entries[0].overrides)
            inspection = inspected(loaded)
            print_view(
                of_inspection(inspection, loaded.spec.unconfirmed).under(
                    {"name": loaded.spec.name}
                ),
                as_json,
            )
            # with `--json`, the issues are a part of the printed document
            if inspection.verdict is not None:
                print(message(inspection.verdict), file=sys.stderr)
                raise Exit(exit_code(inspection.verdict))
            return
        results: dict[str, Inspection | MapmoreError] = {}
        before: Inspection | None = None
        for number, entry in enumerate(entries):
            reporter.progress("runs", number, len(entries))
            try:
                results[entry.called] = before = inspected(
                    load(entry.config, entry.overrides), before
                )
            except MapmoreError as fault:
                results[entry.called] = fault
    print_view(of_campaign(results).under({"campaign": campaigns[0].campaign.campaign}), as_json)
    verdicts = [
        result if isinstance(result, MapmoreError) else result.verdict
        for result in results.values()
    ]
    if code := max((exit_code(verdict) for verdict in verdicts if verdict is not None), default=0):
        raise Exit(code)
