"""A first spec for recordings that nobody has described yet: `mapmore init`."""

from __future__ import annotations

import math
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mapmore_cli.cli import console
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import SpecError, UsageError, WriteError
from mapmore_cli.storage.atomic import write_text

if TYPE_CHECKING:
    from mapmore_cli.annexes.drafting.answers import Question


def init(
    path: Annotated[
        Path, typer.Argument(metavar="PATH", help="A recording, or a folder of recordings.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Where to write; NAME.yaml here by default, - for stdout.",
        ),
    ] = None,
    name: Annotated[str | None, typer.Option(metavar="NAME", help="Name of the study.")] = None,
    length: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH", help="Of the muscle, as 88mm: makes a strain of a displacement."
        ),
    ] = None,
    columns: Annotated[
        str | None,
        typer.Option(
            metavar="LIST", help='What the columns are, as "time:ms,_,pressure:bar,force:N".'
        ),
    ] = None,
    target: Annotated[
        str | None, typer.Option(metavar="NAME", help="The quantity to predict.")
    ] = None,
    hold: Annotated[
        str | None, typer.Option(metavar="NAME", help="What was held, as strain:%, or none.")
    ] = None,
    group: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="What names tell apart, as specimen: one study of groups."
        ),
    ] = None,
    budget: Annotated[
        str,
        typer.Option(metavar="TIME", help="Computing time for the search of each model, as 60s."),
    ] = "20s",
    yes: Annotated[
        bool, typer.Option("--yes", "-y", help="Ask nothing: mark what is not sure.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace specs that exist.")] = False,
    quiet: console.Quiet = False,
) -> None:
    """Start a spec from recordings.

    Titles and units say what columns are, or --columns; the structure of the model is searched on
    training data. A folder with recordings of several studies gives a spec for each; with -o, one
    for the largest.
    """
    from mapmore_cli.annexes.drafting.answers import Answers, read_columns, read_hold
    from mapmore_cli.annexes.drafting.draft import draft_page
    from mapmore_cli.annexes.drafting.proof import proven
    from mapmore_cli.annexes.drafting.start import start

    _check_name(name)
    if group is not None and not (group.isascii() and group.isidentifier()):
        raise UsageError(
            f"--group: {group!r} is no name of a quantity",
            "say what the names of files tell apart, as specimen, or none",
        )
    answers = Answers(
        {} if columns is None else read_columns(columns),
        target,
        None if hold is None else read_hold(hold),
        group,
        None if length is None else _given("--length", length, "m", "88mm"),
    )
    seconds = _given("--budget", budget, "s", "60s")
    folder = Path() if output is None or output == console.STANDARD else output.parent
    asking = ask if sys.stdin.isatty() and sys.stderr.isatty() and not (yes or quiet) else None
    with Reporter(quiet) as reporter:
        search = partial(proven, budget=seconds, progress=reporter.progress)
        found = start(path, folder, name, output is not None, answers, asking, search)
        for remark in found.remarks:
            reporter.say(f"left out: {remark}")
        if output == console.STANDARD:
            print(found.drafts[0].text(), end="")
            return
        specs = {output or Path(f"{draft.name}.yaml"): draft for draft in found.drafts}
        for path, draft in specs.items():
            if draft.raw and (force or not path.exists()):
                write_text(path.with_suffix(".html"), draft_page(draft))
                reporter.say(f"To look at its columns: {path.with_suffix('.html')}")
        _write({path: draft.text() for path, draft in specs.items()}, force)
        reporter.say(f"Next: mapmore check {next(iter(specs))}")


def ask(question: Question) -> str:
    """Print a question with its options, and return the first answer that can be; at the end of
    input, none.
    """
    from rich.console import Console
    from rich.markup import escape

    terminal = Console(stderr=True, highlight=False)
    terminal.print(f"\n[bold]{escape(question.text)}[/bold]")
    for number, option in enumerate(question.options, start=1):
        terminal.print(f"  {number} [bold]{escape(option.text)}[/bold]  {option.course}")
        if option.why:
            terminal.print(f"    [dim]{escape(option.why)}[/dim]")
    while True:
        terminal.print(f"[dim]{escape(question.form)}[/dim] > ", end="")
        try:
            reply = input()
        except EOFError:
            return ""
        try:
            question.check(reply)
        except UsageError as fault:
            terminal.print(f"[red]{escape(fault.message)}[/red]: {escape(fault.remedy or '')}")
            continue
        return reply


def _given(option: str, text: str, unit: str, example: str) -> float:
    """Return a positive quantity that was said on the line."""
    from mapmore_cli.spec.units import parse_quantity

    try:
        value = parse_quantity(text, unit)
    except SpecError as fault:
        raise UsageError(
            f"{option}: {fault.message}", fault.remedy or f"write it as {example}"
        ) from fault
    if not 0 < value < math.inf:
        raise UsageError(f"{option}: {text} is not positive", f"write it as {example}")
    return value


def _check_name(name: str | None) -> None:
    from pydantic import TypeAdapter, ValidationError

    from mapmore_cli.domain.declared import Name

    try:
        TypeAdapter(Name | None).validate_python(name)
    except ValidationError as fault:
        raise UsageError(
            f"--name: {name!r} is no name for a study",
            "use letters, digits, `.`, `_` and `-`, as bench-2",
        ) from fault


def _write(texts: dict[Path, str], force: bool) -> None:
    """Write every file that does not exist yet, or all with `force`, and print their paths; then
    refuse where one was there.
    """
    taken = [path for path in texts if path.exists() and not force]
    for path, text in texts.items():
        if path not in taken:
            write_text(path, text)
            print(path)
    if taken:
        told = ", ".join(map(str, taken))
        raise WriteError(
            f"{told}: exists already",
            "say --force to replace it, or -o to write elsewhere; others were written",
        )
