"""Implement `mapmore tune`, which finds the best setting or structure, and `mapmore plan`, which
finds the next measurement. Both judge models on training data that their fits left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from mapmore_cli.cli.console import (
    NONE,
    RUNS,
    TABLE_FILES,
    AsJson,
    Overrides,
    Quiet,
    Runs,
    SpecOrRun,
    output_option,
    print_view,
    refuse_endings,
    spec_of,
    write_figure,
)
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import SpecError, UsageError
from mapmore_cli.storage.outputs import write_text

if TYPE_CHECKING:
    from mapmore_cli.annexes.planning.results import Plan, Tuning
    from mapmore_cli.reporting.table import Table

Outputs = Annotated[
    list[Path],
    output_option(
        "Also write the figure (.svg .pdf .png .pgf) or the table (.csv .tex). Repeatable."
    ),
]


def tune(
    config: SpecOrRun,
    over: Annotated[
        list[str],
        Option(
            "--over",
            metavar="KEY=V1,V2,...",
            help="A setting with the values to try, for example fit.max_terms=2,4,8. Repeatable.",
        ),
    ] = NONE,
    budget: Annotated[
        str | None,
        Option(
            "--budget",
            metavar="TIME",
            help="Computing time of each process of a search (without --over), for example 60s.",
        ),
    ] = None,
    output: Outputs = NONE,
    runs: Runs = RUNS,
    overrides: Overrides = NONE,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Compare settings, or structures, on left-out training data.

    With --over, the best setting is reported. Without it, the structure of the model is searched.
    Every combination is fitted several times, each time without one level (or block) of the
    training data, on which its error is then measured. Held-out data are not used. The recommended
    combination is the simplest that is as good as the best.
    """
    from mapmore_cli.annexes.planning import tuning, views
    from mapmore_cli.study.loader import load

    refuse_endings(output)
    if over and budget is not None:
        raise UsageError(
            "--budget limits a search, but --over tries a given list of values",
            "give one of the two",
        )
    if not over:
        refuse_endings(output, TABLE_FILES, "a search has no figure")
    wanted, compared = _values_of(over), None
    with Reporter(quiet) as reporter:
        loaded = load(*spec_of(config, overrides, runs))
        if over:
            compared = tuning.tune(loaded, wanted, runs, **reporter.listeners)
            view = views.of_tuning(compared)
        else:
            search, spec = tuning.searched(loaded, runs, budget, **reporter.listeners)
            view = views.of_search(search, str(spec))
    write_results(output, view.tables[0], compared)
    print_view(view, as_json)


def plan(
    config: SpecOrRun,
    points: Annotated[
        int | None,
        Option(
            "--points",
            metavar="N",
            min=1,
            max=100,
            help="Choose N points of the map, also if there are levels. Default without levels: 5.",
        ),
    ] = None,
    until: Annotated[
        str | None,
        Option(
            "--until",
            metavar="SIZE",
            help=(
                "For points: also estimate how many more of them make the interval as narrow as "
                "this half width, for example 2%."
            ),
        ),
    ] = None,
    cost: Annotated[
        str | None,
        Option(
            "--cost",
            metavar="NAME=PRICE,...",
            help="For points: cost of a change of each quantity, for example pressure=1,strain=20.",
        ),
    ] = None,
    output: Outputs = NONE,
    runs: Runs = RUNS,
    overrides: Overrides = NONE,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Say what to measure next to make the model more accurate.

    If the study has levels, the next level lies in the middle of the widest gap. Without levels, or
    with --points, several models form a committee, and points are placed where these disagree and
    data are far away. Held-out values are not used. Per cent are relative to the largest |target|.
    """
    from mapmore_cli.annexes.planning import planning
    from mapmore_cli.annexes.planning.views import of_plan
    from mapmore_cli.study.loader import load

    refuse_endings(output)
    prices = _prices_of(cost)
    with Reporter(quiet) as reporter:
        result = planning.plan(
            load(*spec_of(config, overrides, runs)),
            runs,
            points=points,
            until=until,
            prices=prices,
            **reporter.listeners,
        )
    view = of_plan(result)
    write_results(output, view.tables[0], result)
    print_view(view, as_json)


def _values_of(over: Sequence[str]) -> dict[str, list[Any]]:
    """Return the values of every setting from texts such as `fit.max_terms=2,4,8`. Values are read
    as YAML. Raises UsageError if a text has another form, or if a setting has no value.
    """
    from mapmore_cli.study.diagnostics import Mistake
    from mapmore_cli.study.tree import SourceText, written
    from mapmore_cli.study.yaml_loader import parse

    example = "write, for example, `--over fit.max_terms=2,4,8`"
    values_of: dict[str, list[Any]] = {}
    for text in over:
        key, _, listed = text.partition("=")
        problems: list[Mistake] = []
        try:
            values = written(
                parse(SourceText(f"--over {text}", Path(), f"[{listed}]", numbered=False), problems)
            )
        except SpecError as fault:
            raise UsageError(f"--over {text}: {fault.message}", example) from fault
        if (
            problems
            or not all(key.strip().split("."))
            or not values
            or not isinstance(values, list)
        ):
            raise UsageError(f"--over {text}: not of the form KEY=V1,V2,...", example)
        if key.strip() in values_of:
            raise UsageError(
                f"--over {key.strip()} is given twice",
                "give all its values at once, separated by commas",
            )
        values_of[key.strip()] = values
    return values_of


def _prices_of(text: str | None) -> dict[str, float]:
    """Return the price of each quantity from a text such as `pressure=1,strain=20`. Raises
    UsageError for an invalid price.
    """
    prices: dict[str, float] = {}
    for part in text.split(",") if text else []:
        name, _, price = (piece.strip() for piece in part.partition("="))
        try:
            prices[name] = float(price)
        except ValueError:
            prices[name] = float("nan")
        if not 0 < prices[name] < float("inf"):
            raise UsageError(
                f"--cost {part.strip()}: is not of the form QUANTITY=PRICE",
                "write, for example, `--cost pressure=1,strain=20`",
            )
    return prices


def write_results(paths: Sequence[Path], table: Table, result: Tuning | Plan | None) -> None:
    """Write a result to each of the files: as a figure if the file has the suffix of a figure,
    otherwise as a table.
    """
    from mapmore_cli.reporting.table import to_csv, to_latex

    for path in paths:
        if result is None or path.suffix.removeprefix(".") in TABLE_FILES:
            write_text(path, (to_csv if path.suffix == ".csv" else to_latex)(table))
        else:
            from mapmore_cli.annexes.planning.drawing import drawing_of

            write_figure(path, drawing_of(result))
