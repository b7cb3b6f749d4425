"""Implement `mapmore compare` (has this muscle changed?) and `mapmore freeze` (keep a model for
later comparisons).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from mapmore_cli.cli.console import (
    ARCHIVE,
    FIGURE_FILES,
    RUNS,
    Archive,
    AsJson,
    Quiet,
    Runs,
    View,
    folder_of,
    output_option,
    print_view,
    refuse_endings,
    write_figure,
)
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import LimitMissed, UsageError

if TYPE_CHECKING:
    from mapmore_cli.modelling.validation.comparison import Comparison


def compare(
    models: Annotated[
        list[str],
        Argument(
            metavar="BEFORE AFTER...",
            help="Runs, campaigns, tags (2026-spring, NAME@TAG) or model files.",
        ),
    ],
    margin: Annotated[
        float,
        Option("--margin", metavar="SHARE", min=0.0, help="Smallest relative change that matters."),
    ] = 0.01,
    other_settings: Annotated[
        bool,
        Option(
            "--allow-other-settings",
            help="Compare although the models were made with different settings.",
        ),
    ] = False,
    fail_on: Annotated[
        str | None,
        Option(
            "--fail-on",
            metavar="WHEN",
            help=(
                "Exit with code 6 if the comparison with the last model says `changed`; or, with a "
                "number such as 0.03, if the output differs by more than this fraction."
            ),
        ),
    ] = None,
    figure: Annotated[
        Path | None,
        output_option("Draw the drift over all models (.svg .pdf .png .pgf).", "--figure"),
    ] = None,
    archive: Archive = ARCHIVE,
    runs: Runs = RUNS,
    as_json: AsJson = False,
) -> None:
    """Say whether a muscle has changed.

    The first model is compared with each of the others, which must be in the order of time. Two
    campaigns are compared run by run. Models with different settings are refused, because the
    settings could be the cause of a difference. If both models were built from the same recordings,
    a difference comes from the settings, and not from the muscle.
    """
    from mapmore_cli.cli.compared import of_campaigns
    from mapmore_cli.pipeline.archive import find_campaign, find_model

    if len(models) < 2:
        raise UsageError(
            "compare needs two models",
            "name the earlier one first, for example `mapmore compare 2025-autumn my-run`",
        )
    limit, only_in = _limit(fail_on), dict[str, str]()
    refuse_endings(
        [figure] if figure else [],
        FIGURE_FILES,
        "a figure of the drift cannot have this file ending",
    )
    campaigns = [find_campaign(text, runs, archive) for text in models]
    models_of_runs = [known for known in campaigns if known is not None]
    if models_of_runs:
        if figure is not None:
            raise UsageError(
                f"--figure {figure}: the drift of campaigns cannot be drawn",
                "leave out --figure, or name a run of each campaign",
            )
        results, only_in = _of_campaigns(models, models_of_runs, margin, other_settings)
        view = of_campaigns(models, results, only_in=only_in)
    else:
        paths = [find_model(text, runs, archive) for text in models]
        results, view = _of_models(models, paths, margin, other_settings)
        if figure is not None:
            _draw(models, paths, figure)
    print_view(view, as_json)
    if fail_on and only_in:
        raise LimitMissed(
            f"{', '.join(only_in)}: only one of the campaigns contains this run, and `--fail-on "
            f"{fail_on}` allows no run that is not compared",
            "run both campaigns with the same runs, or compare single runs",
        )
    for name, result in results.items() if fail_on else ():
        if result.changed if limit is None else result.moved(limit):
            raise LimitMissed(
                f"{name}: the predicted {result.output} is {result.ratio:.4g} times that of "
                f"{models[0]}, and `--fail-on {fail_on}` does not allow this change",
                "look in the tables which curves changed; if the change is acceptable, "
                + (
                    "write the largest relative change that you accept, as in `--fail-on 0.03`"
                    if limit is None
                    else "give --fail-on a larger number"
                ),
            )


def _of_campaigns(
    names: Sequence[str],
    campaigns: Sequence[Mapping[str, Path]],
    margin: float,
    other_settings: bool,
) -> tuple[dict[str, Comparison], dict[str, str]]:
    """Compare two campaigns run by run. `campaigns` holds the model file of each run, for each of
    the `names` that is a campaign. Return the comparison of each run that both campaigns contain.
    For each run that only one campaign contains, return the name of this campaign.

    Raises UsageError unless there are two names of campaigns with at least one common run.
    """
    from mapmore_cli.pipeline.archive import compared

    if len(names) != 2 or len(campaigns) != 2:
        raise UsageError(
            f"{', '.join(names)}: a campaign can be compared with one other campaign only",
            "name two campaigns, for example `mapmore compare muscles@spring muscles`",
        )
    before, after = campaigns
    results = {
        run: compared(model, after[run], margin, other_settings)
        for run, model in before.items()
        if run in after
    }
    if not results:
        raise UsageError(
            f"{' and '.join(names)} have no run in common",
            "name two campaigns with runs of the same names, or one run of each campaign",
        )
    only_in = dict.fromkeys(before.keys() - after.keys(), names[0])
    only_in |= dict.fromkeys(after.keys() - before.keys(), names[1])
    return results, dict(sorted(only_in.items()))


def _of_models(
    names: Sequence[str], paths: Sequence[Path], margin: float, other_settings: bool
) -> tuple[dict[str, Comparison], View]:
    """Compare the first model with each later model. Return two results. The first is a dictionary
    that holds the comparison with the last model under the name of this model. The second is the
    view that the command prints.

    If the models have several outputs, the dictionary holds a comparison for each output, under the
    name of the output. Raises UsageError for more than two models with several outputs.
    """
    from mapmore_cli.cli.compared import of_campaigns, of_comparisons
    from mapmore_cli.pipeline.archive import compared
    from mapmore_cli.storage.artefacts import read_model

    outputs = [output.name for output in read_model(paths[0]).outputs]
    if len(outputs) == 1:
        later = [compared(paths[0], path, margin, other_settings) for path in paths[1:]]
        return {names[-1]: later[-1]}, of_comparisons(names, later)
    if len(paths) > 2:
        raise UsageError(
            f"{', '.join(names)}: models of several outputs are compared two at a time",
            f"name two, for example `mapmore compare {names[0]} {names[-1]}`",
        )
    results = {name: compared(paths[0], paths[1], margin, other_settings, name) for name in outputs}
    return results, of_campaigns(names, results, "outputs")


def _draw(names: Sequence[str], models: Sequence[Path], figure: Path) -> None:
    """Draw how the outputs at reference points change from model to model, and write the figure to
    a file.
    """
    from mapmore_cli.modelling.validation.comparison import reference_points
    from mapmore_cli.reporting.figures.commands import drift_drawing
    from mapmore_cli.storage.artefacts import read_model

    read = [read_model(model) for model in models]
    write_figure(figure, drift_drawing(names, reference_points(read), read[0].output))


def _limit(fail_on: str | None) -> float | None:
    """Return the limit that the option --fail-on gives: the command fails if the relative change is
    larger. Return None without this option, or if it is `changed`. Raises UsageError for any other
    text that is not a number of at least zero.
    """
    if fail_on in (None, "changed"):
        return None
    try:
        limit = float(fail_on or "")
    except ValueError:
        limit = math.nan
    if not 0 <= limit < math.inf:
        raise UsageError(
            f"--fail-on {fail_on}: is neither `changed` nor a relative change",
            "write, for example, `--fail-on 0.03` for three per cent",
        )
    return limit


def freeze(
    run: Annotated[
        Path, Argument(metavar="RUN", help="A run or a campaign: its folder, or its name.")
    ],
    tag: Annotated[
        str,
        Option(
            "--tag",
            metavar="TAG",
            help="Name for this state of the run or campaign, for example 2026-spring.",
        ),
    ],
    archive: Archive = ARCHIVE,
    runs: Runs = RUNS,
    quiet: Quiet = False,
) -> None:
    """Keep the models of a run or a campaign under a tag.

    The scores, the spec and the hashes are copied too, to ARCHIVE/NAME@TAG, where no later run
    writes.
    """
    from mapmore_cli.pipeline import archive as frozen

    folder = folder_of(run, runs)
    with Reporter(quiet) as reporter:
        members = frozen.runs_of(folder)
        campaign = "" if members is None else folder.name
        for name in members or [folder.name]:
            place = frozen.freeze(folder.parent / name, tag, archive, campaign)
            print(place)
            spec, settings = frozen.made_from(place)
            reporter.say(f"{place.name}: made from {PurePosixPath(spec).name or 'no known spec'}")
            if settings:
                reporter.warn(
                    f"{place.name}: the spec alone makes a different model, because this one was "
                    f"made with --set {' --set '.join(settings)}; write "
                    "these settings into the spec, so that the model can be made again"
                )
