"""`mapmore compare`: has this muscle changed?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli.console import ARCHIVE, RUNS, Archive, AsJson, Runs, print_view
from mapmore_cli.domain.errors import DataError, LimitMissed, UsageError

FIGURES = ("svg", "pdf", "png", "pgf")


def compare(
    models: Annotated[
        list[str], typer.Argument(metavar="BEFORE AFTER...", help="Runs, tags (2026-spring, NAME@TAG) or model files.", show_default=False)
    ],
    margin: Annotated[float, typer.Option("--margin", metavar="SHARE", min=0.0, help="Relative change that is of no interest.")] = 0.01,
    fail_on: Annotated[
        str | None,
        typer.Option("--fail-on", metavar="WHEN", help="Exit 6 where the muscle `changed`, or where force did by more than 0.03."),
    ] = None,
    figure: Annotated[
        Path | None, typer.Option("--figure", metavar="FILE", help="Draw the drift over all models (.svg .pdf .png .pgf).")
    ] = None,
    archive: Archive = ARCHIVE,
    runs: Runs = RUNS,
    as_json: AsJson = False,
) -> None:
    """Say whether a muscle has changed.

    The first model is compared with each of the others, which come in the order of time.
    """
    from mapmore_cli.cli.views.compared import of_comparisons
    from mapmore_cli.modelling.validation import comparison
    from mapmore_cli.storage.artefacts import read_model
    from mapmore_cli.study.campaigns.archive import find_model, write_drift

    if len(models) < 2:
        raise UsageError("compare needs two models", "name the earlier one first, as `mapmore compare 2025-autumn my-run`")
    limit = _limit(fail_on)
    if figure is not None and figure.suffix.removeprefix(".") not in FIGURES:
        raise UsageError(f"{figure}: the drift is drawn as .{', .'.join(FIGURES)}", "choose one of these")
    found = [read_model(find_model(text, runs, archive)) for text in models]
    try:
        results = [comparison.compare(found[0], later, margin) for later in found[1:]]
    except ValueError as fault:
        raise DataError(
            f"{models[0]}, {models[-1]}: {fault}", "compare models of the same quantities that have curves in common"
        ) from fault
    if figure is not None:
        write_drift(figure, models, found)
    print_view(of_comparisons(models, results), as_json)
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
