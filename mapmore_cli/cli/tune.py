"""`mapmore tune`: which of some settings, or which structure at all, by training data that were left out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mapmore_cli.cli.console import NO_OVERRIDES, RUNS, AsJson, Config, Overrides, Quiet, Runs, print_view
from mapmore_cli.cli.outputs import TABLES, Outputs, refuse_unknown, write_result, write_table
from mapmore_cli.domain.errors import SpecError, UsageError

if TYPE_CHECKING:
    from mapmore_cli.reporting.figures.drawing import Drawing


def tune(
    config: Config,
    over: Annotated[
        list[str] | None,
        typer.Option("--over", metavar="KEY=V1,V2,...", help="A setting with the values to try, as fit.max_terms=2,4,8. Repeatable."),
    ] = None,
    budget: Annotated[
        str | None, typer.Option("--budget", metavar="TIME", help="Time of a search, which is without --over; 60s.", show_default=False)
    ] = None,
    output: Outputs = None,
    runs: Runs = RUNS,
    overrides: Overrides = NO_OVERRIDES,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Try settings, or structures, on left-out training data.

    With --over the best setting is named; without, the structure of the model is searched.

    Every combination is fitted without a level (or a block) of the training data and judged on it; held-out data are not used.
    The one that is named is the simplest that is as good as the best.
    """
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.cli.views.compared import of_tuning, tuning_table
    from mapmore_cli.spec.loader import load
    from mapmore_cli.study import tuning

    refuse_unknown(output or [])
    if not over:
        _search(config, output or [], runs, overrides, budget, as_json, quiet)
        return
    if budget is not None:
        raise UsageError("--budget is the time of a search, and --over tries what it names", "give one of both")
    wanted = values_of(over)
    with Reporter(quiet) as reporter:
        found = tuning.tune(load(config, overrides), wanted, runs, progress=reporter.progress, warn=reporter.warn, on_stage=reporter.stage)

    def drawing() -> Drawing:
        from mapmore_cli.reporting.figures.commands import tuning_drawing

        return tuning_drawing(found)

    for path in output or []:
        write_result(path, lambda: tuning_table(found), drawing)
    print_view(of_tuning(found), as_json)


def _search(
    config: Path, output: Sequence[Path], runs: Path, overrides: Sequence[str], budget: str | None, as_json: bool, quiet: bool
) -> None:
    """Search the structure, and print what was tried."""
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.cli.views.compared import of_search
    from mapmore_cli.reporting.score_tables import search_table
    from mapmore_cli.spec.loader import load
    from mapmore_cli.study.tuning import searched

    if wrong := next((path for path in output if path.suffix.removeprefix(".") not in TABLES), None):
        raise UsageError(f"{wrong}: a search has no figure", f"choose .{' or .'.join(TABLES)}")
    with Reporter(quiet) as reporter:
        found, spec = searched(
            load(config, overrides), runs, budget, progress=reporter.progress, warn=reporter.warn, on_stage=reporter.stage
        )
    for path in output:
        write_table(path, search_table(found))
    print_view(of_search(found, str(spec)), as_json)


def values_of(over: Sequence[str]) -> dict[str, list[Any]]:
    """Return the values of every setting: `fit.max_terms=2,4,8`, each of them YAML.

    Raises
    ------
    UsageError
        Where one has another form, or no value.
    """
    from mapmore_cli.spec.diagnostics import Mistake
    from mapmore_cli.spec.tree import SourceText, plain
    from mapmore_cli.spec.yaml_loader import parse

    found: dict[str, list[Any]] = {}
    for text in over:
        key, _, listed = text.partition("=")
        problems: list[Mistake] = []
        try:
            values = plain(parse(SourceText(f"--over {text}", Path(), f"[{listed}]", numbered=False), problems))
        except SpecError as fault:
            raise UsageError(f"--over {text}: {fault.message}", "write, for example, `--over fit.max_terms=2,4,8`") from fault
        if problems or not all(key.strip().split(".")) or not values or not isinstance(values, list):
            raise UsageError(f"--over {text}: not of the form KEY=V1,V2,...", "write, for example, `--over fit.max_terms=2,4,8`")
        if key.strip() in found:
            raise UsageError(f"--over {key.strip()} is given twice", "name all its values at once, with commas between")
        found[key.strip()] = values
    return found
