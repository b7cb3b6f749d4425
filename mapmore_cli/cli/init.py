"""`mapmore init`: a first spec for recordings that nobody has described yet."""

from __future__ import annotations

import math
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mapmore_cli.cli.console import Quiet
from mapmore_cli.domain.errors import UsageError, WriteError

if TYPE_CHECKING:
    from mapmore_cli.study.drafting.answers import Ask
    from mapmore_cli.study.drafting.draft import Draft

STDOUT = Path("-")


def init(
    path: Annotated[Path, typer.Argument(metavar="PATH", help="A recording, or a folder of recordings.", show_default=False)],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Where to write; NAME.yaml here by default, - for stdout.", show_default=False),
    ] = None,
    name: Annotated[str | None, typer.Option("--name", metavar="NAME", help="Name of the study.", show_default=False)] = None,
    length: Annotated[
        str | None,
        typer.Option("--length", metavar="LENGTH", help="Of the muscle, as 88mm: makes a strain of a displacement.", show_default=False),
    ] = None,
    columns: Annotated[
        str | None,
        typer.Option("--columns", metavar="LIST", help='What the columns are, as "time:ms,_,pressure:bar,force:N".', show_default=False),
    ] = None,
    target: Annotated[str | None, typer.Option("--target", metavar="NAME", help="The quantity to predict.", show_default=False)] = None,
    hold: Annotated[str | None, typer.Option("--hold", metavar="NAME", help="What was held, or none.", show_default=False)] = None,
    group: Annotated[
        str | None,
        typer.Option("--group", metavar="NAME", help="What names tell apart, as specimen: one study of groups.", show_default=False),
    ] = None,
    budget: Annotated[str, typer.Option("--budget", metavar="TIME", help="Computing time for the search of each model, as 60s.")] = "20s",
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Ask nothing: guess, and mark what is not sure.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace specs that exist.")] = False,
    quiet: Quiet = False,
) -> None:
    """Start a spec from recordings.

    Columns, units, levels and load cycles are guessed, and every guess says why; the structure of the model is searched on training
    data. A folder with recordings of several studies gives a spec for each; with -o, one for the largest.
    """
    from mapmore_cli.cli.progress import Reporter
    from mapmore_cli.study.drafting.answers import Answers, read_columns
    from mapmore_cli.study.drafting.proof import proven
    from mapmore_cli.study.drafting.start import start

    if name is not None:
        _check_name(name)
    answers = Answers(
        {} if columns is None else read_columns(columns),
        target,
        hold,
        _group(group),
        None if length is None else _given("--length", length, "m", "88mm"),
    )
    seconds = _given("--budget", budget, "s", "60s")
    folder = Path() if output is None or output == STDOUT else output.parent
    with Reporter(quiet) as reporter:
        search = partial(proven, budget=seconds, progress=reporter.progress)
        found = start(path, folder, name, output is not None, answers, _asking(yes or quiet), search)
        for remark in found.remarks:
            reporter.say(f"left out: {remark}")
    if output == STDOUT:
        print(found.drafts[0].text(), end="")
        return
    specs = {output or Path(f"{draft.name}.yaml"): draft for draft in found.drafts}
    for path, draft in specs.items():
        if draft.raw and (force or not path.exists()):
            _write_page(path.with_suffix(".html"), draft, quiet)
    _write({path: draft.text() for path, draft in specs.items()}, force)
    if not quiet:
        print(f"Next: mapmore check {next(iter(specs))}", file=sys.stderr)


def _write_page(path: Path, draft: Draft, quiet: bool) -> None:
    """Write the page of a draft's guesses, and say where it is."""
    from mapmore_cli.storage.atomic import write_text
    from mapmore_cli.study.drafting.draft import guesses_page

    write_text(path, guesses_page(draft))
    if not quiet:
        print(f"To check its guesses by eye: {path}", file=sys.stderr)


def _group(name: str | None) -> str | None:
    """Return what names tell apart, as it was said on the line."""
    if name is not None and not (name.isascii() and name.isidentifier()):
        raise UsageError(f"--group: {name!r} is no name of a quantity", "say what the names of files tell apart, as specimen, or none")
    return name


def _asking(silent: bool) -> Ask | None:
    """Return who answers: the person at the terminal, where there is one."""
    if silent or not (sys.stdin.isatty() and sys.stderr.isatty()):
        return None
    from mapmore_cli.cli.asking import ask

    return ask


def _given(option: str, text: str, unit: str, example: str) -> float:
    """Return a positive quantity that was said on the line."""
    from mapmore_cli.domain.errors import SpecError
    from mapmore_cli.spec.units import parse_quantity

    try:
        value = parse_quantity(text, unit)
    except SpecError as fault:
        raise UsageError(f"{option}: {fault.message}", fault.remedy or f"write it as {example}") from fault
    if not 0 < value < math.inf:
        raise UsageError(f"{option}: {text} is not positive", f"write it as {example}")
    return value


def _check_name(name: str) -> None:
    from pydantic import TypeAdapter, ValidationError

    from mapmore_cli.spec.fields import Name

    try:
        TypeAdapter(Name).validate_python(name)
    except ValidationError as fault:
        raise UsageError(f"--name: {name!r} is no name for a study", "use letters, digits, `.`, `_` and `-`, as bench-2") from fault


def _write(texts: dict[Path, str], force: bool) -> None:
    """Write every file that does not exist yet, or all with `force`, and print their paths; then refuse where one was there."""
    from mapmore_cli.storage.atomic import write_text

    taken = [path for path in texts if path.exists() and not force]
    for path, text in texts.items():
        if path not in taken:
            write_text(path, text)
            print(path)
    if taken:
        told = ", ".join(map(str, taken))
        raise WriteError(f"{told}: exists already", "say --force to replace it, or -o to write elsewhere; others were written")
