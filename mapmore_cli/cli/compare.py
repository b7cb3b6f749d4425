"""`mapmore compare`: has this muscle changed? `mapmore freeze`: keep a model to compare with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mapmore_cli.cli import console
from mapmore_cli.domain.errors import DataError, LimitMissed, UsageError


def compare(
    models: Annotated[
        list[str],
        typer.Argument(
            metavar="BEFORE AFTER...", help="Runs, tags (2026-spring, NAME@TAG) or model files."
        ),
    ],
    margin: Annotated[
        float,
        typer.Option(
            "--margin", metavar="SHARE", min=0.0, help="Relative change that is of no interest."
        ),
    ] = 0.01,
    fail_on: Annotated[
        str | None,
        typer.Option(
            "--fail-on",
            metavar="WHEN",
            help="Exit 6 where the muscle `changed`, or where force did by more than 0.03.",
        ),
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(
            "--figure", metavar="FILE", help="Draw the drift over all models (.svg .pdf .png .pgf)."
        ),
    ] = None,
    archive: console.Archive = console.ARCHIVE,
    runs: console.Runs = console.RUNS,
    as_json: console.AsJson = False,
) -> None:
    """Say whether a muscle has changed.

    The first model is compared with each of the others, which come in the order of time.
    """
    from mapmore_cli.cli.compared import of_comparisons
    from mapmore_cli.modelling.validation import comparison
    from mapmore_cli.pipeline.archive import find_model
    from mapmore_cli.storage.artefacts import read_model

    if len(models) < 2:
        raise UsageError(
            "compare needs two models",
            "name the earlier one first, as `mapmore compare 2025-autumn my-run`",
        )
    limit = _limit(fail_on)
    console.refuse_endings(
        [figure] if figure else [], console.FIGURE_FILES, "no figure of the drift ends so"
    )
    found = [read_model(find_model(text, runs, archive)) for text in models]
    try:
        results = [comparison.compare(found[0], later, margin) for later in found[1:]]
    except ValueError as fault:
        remedy = "compare models of the same quantities that have curves in common"
        raise DataError(f"{models[0]}, {models[-1]}: {fault}", remedy) from fault
    if figure is not None:
        from mapmore_cli.reporting.figures.commands import drift_drawing

        console.write_figure(
            figure, drift_drawing(models, comparison.reference_points(found), found[0].output)
        )
    console.print_view(of_comparisons(models, results), as_json)
    last = results[-1]
    if (
        last.changed
        if limit is None and fail_on
        else limit is not None and abs(last.ratio - 1) > limit
    ):
        raise LimitMissed(
            f"{models[-1]}: force is {last.ratio:.4g} times that of {models[0]}",
            "see the tables; --fail-on sets the limit",
        )


def _limit(fail_on: str | None) -> float | None:
    """Return the relative change that is too large; None where none is given, or the word `changed`
    decides.
    """
    if fail_on in (None, "changed"):
        return None
    try:
        limit = float(fail_on or "")
    except ValueError:
        limit = -1.0
    if not 0 <= limit < float("inf"):
        raise UsageError(
            f"--fail-on {fail_on}: is neither `changed` nor a relative change",
            "write `--fail-on 0.03` for three per cent",
        )
    return limit


def freeze(
    run: console.RunOrName,
    tag: Annotated[
        str,
        typer.Option("--tag", metavar="TAG", help="What this campaign is called, as 2026-spring."),
    ],
    archive: console.Archive = console.ARCHIVE,
    runs: console.Runs = console.RUNS,
) -> None:
    """Keep the model of a run under a tag.

    Its scores, spec and hashes go with it, to ARCHIVE/NAME@TAG, where no later run writes.
    """
    from mapmore_cli.pipeline import archive as frozen

    print(frozen.freeze(run if run.is_dir() else runs / run, tag, archive))
