"""Implement `mapmore init`: a first spec for recordings that nobody has described yet."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Option

from mapmore_cli.cli.console import STANDARD, Quiet, output_option
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import UsageError, WriteError
from mapmore_cli.storage.outputs import refuse_foreign_file, write_chosen, write_text

if TYPE_CHECKING:
    from mapmore_cli.annexes.drafting.draft import Draft
    from mapmore_cli.annexes.drafting.questions import Question


def init(
    path: Annotated[Path, Argument(metavar="PATH", help="A recording, or a folder of recordings.")],
    output: Annotated[
        Path | None,
        output_option(
            "Where to write the spec. Default: NAME.yaml in the current folder; - for "
            "standard output."
        ),
    ] = None,
    name: Annotated[str | None, Option(metavar="NAME", help="Name of the study.")] = None,
    length: Annotated[
        str | None,
        Option(
            metavar="LENGTH",
            help="Length of the muscle, for example 88mm, to convert a displacement to strain.",
        ),
    ] = None,
    columns: Annotated[
        str | None,
        Option(
            metavar="LIST",
            help=(
                "What the columns are, in their order (`_` leaves one out), for example "
                '"time:ms,_,pressure:bar,force:N".'
            ),
        ),
    ] = None,
    target: Annotated[
        str | None,
        Option(
            metavar="LIST",
            help="The column to predict. Several, with commas between, become one study each.",
        ),
    ] = None,
    inputs: Annotated[
        str | None,
        Option(
            metavar="LIST",
            help="The columns that are inputs of the model. Default: all columns that change.",
        ),
    ] = None,
    hold: Annotated[
        str | None,
        Option(
            metavar="NAME",
            help="The quantity that was held constant, for example strain:%, or none.",
        ),
    ] = None,
    validate: Annotated[
        str | None,
        Option(
            metavar="NAME",
            help="What is held out for validation: an input (its inner values), `recordings`, or "
            "`last` (the end of each recording).",
        ),
    ] = None,
    recordings: Annotated[
        str | None,
        Option(
            metavar="NAME",
            help="The column whose value separates the recordings, for example trial.",
        ),
    ] = None,
    sample_time: Annotated[
        str | None,
        Option(
            metavar="TIME",
            help="Time between samples, for example 10ms, if no column is the clock.",
        ),
    ] = None,
    no_clock: Annotated[bool, Option("--no-clock", help="No column is the clock.")] = False,
    group: Annotated[
        str | None,
        Option(
            metavar="NAME",
            help=(
                "The column that distinguishes groups, or a word for what the names of the files "
                "distinguish, for example specimen. Each group is scored separately."
            ),
        ),
    ] = None,
    like: Annotated[
        Literal["m1", "m2"] | None,
        Option(help="Write the settings of a paper; `run` then does not search for a structure."),
    ] = None,
    yes: Annotated[
        bool,
        Option(
            "--yes",
            "-y",
            help="Ask no questions (as with -q); mark uncertain entries of the spec with CHECK.",
        ),
    ] = False,
    force: Annotated[bool, Option("--force", help="Replace specs that exist.")] = False,
    quiet: Quiet = False,
) -> None:
    """Start a spec from recordings, without fitting a model.

    The meaning of the columns is taken from titles, units, the options --columns, --target and
    --inputs, and your answers. `mapmore run` then searches the structure of the model. Files of
    each layout become a study.
    """
    from mapmore_cli.annexes.drafting.answers import answers_of
    from mapmore_cli.annexes.drafting.outputs import as_files
    from mapmore_cli.annexes.drafting.start import start

    _check_name(name)
    answers = answers_of(
        columns=columns,
        target=target,
        inputs=inputs,
        hold=hold,
        validate=validate,
        group=group,
        recordings=recordings,
        sample_time=sample_time,
        no_clock=no_clock,
        length=length,
        like=like,
    )
    if output == STANDARD and len(answers.target) > 1:
        raise UsageError(
            f"-o -: {len(answers.target)} specs cannot be written as one text",
            "name a file with -o",
        )
    if output is not None:
        _refuse([output], force)
    folder = Path() if output is None or output == STANDARD else output.parent
    asking = ask if sys.stdin.isatty() and sys.stderr.isatty() and not (yes or quiet) else None
    with Reporter(quiet) as reporter:
        drafted = start(path, folder, name, output is not None, answers, asking, reporter.say)
        for remark in drafted.remarks:
            reporter.say(f"left out: {remark}")
        for draft in drafted.drafts:
            if (doubt := draft.open.get(("target",))) is not None:
                reporter.say(f"{draft.name}: {doubt.why}")
            for tip in draft.tips:
                reporter.say(f"{draft.name}: {tip}")
        if output == STANDARD:
            print(drafted.drafts[0].text(), end="")
        else:
            _write(as_files(drafted.drafts, output), force, reporter)


def _refuse(files: Iterable[Path], force: bool) -> None:
    """Raise WriteError if some files exist already. With `force`, raise it only if one of them is
    neither a YAML file nor written by mapmore, for example a recording.
    """
    existing = [path for path in files if path.exists()]
    if force:
        for path in existing:
            if path.suffix not in (".yaml", ".yml"):
                refuse_foreign_file(path)
    elif existing:
        raise WriteError(
            f"{', '.join(map(str, existing))}: already exists",
            "use --force to replace it, or -o to write elsewhere",
        )


def _write(files: Mapping[Path, tuple[str, Draft]], force: bool, reporter: Reporter) -> None:
    """Write the files that do not exist yet, or all with `force`, and print the paths of the specs.
    Raises WriteError at the end if some existed already.
    """
    from mapmore_cli.annexes.drafting.page import draft_page
    from mapmore_cli.study.schema import write_schema_beside

    if force:
        _refuse(files, force)
    free = {path: file for path, file in files.items() if force or not path.exists()}
    existing = files.keys() - free.keys()
    for path, (text, draft) in free.items():
        if draft.raw and not path.name.startswith("_"):
            page = path.with_suffix(".html")
            write_chosen(page.parent, {page.name: draft_page(draft).encode()})
            reporter.say(f"To look at its columns: {page}")
        write_text(path, text)
        print(path)
    first = next(iter(files))
    if schema := write_schema_beside(first):
        reporter.say(f"An editor completes the keys of the spec with this file: {schema}")
    _refuse(sorted(existing), force)
    reporter.say(f"Next: mapmore {'batch' if files[first][1].of else 'check'} {first}")


def ask(question: Question) -> str:
    """Ask a question until the answer is valid, and return this answer. At the end of the input,
    return an empty text.
    """
    from rich.console import Console
    from rich.markup import escape

    from mapmore_cli.annexes.drafting.questions import BACK

    terminal = Console(stderr=True, highlight=False)
    terminal.print(f"\n[bold]{escape(question.text)}[/bold]")
    width = max((len(option.number) for option in question.options), default=0)
    for option in question.options:
        terminal.print(
            f"  {escape(option.number):>{width}}  [bold]{escape(option.text)}[/bold]"
            + (f"\n  {'':>{width}}  {option.course}" if option.course else "")
        )
    while True:
        terminal.print(f"[dim]{escape(question.form)}[/dim] > ", end="")
        try:
            reply = input()
        except EOFError:
            return ""
        try:
            if reply.strip() != BACK:
                question.take(reply.strip())
        except UsageError as fault:
            terminal.print(f"[red]{escape(fault.message)}[/red]: {escape(fault.remedy or '')}")
            continue
        return reply


def _check_name(name: str | None) -> None:
    from pydantic import TypeAdapter, ValidationError

    from mapmore_cli.domain.declared import Name

    try:
        TypeAdapter(Name | None).validate_python(name)
    except ValidationError as fault:
        raise UsageError(
            f"--name: {name!r} is not a valid name for a study",
            "use letters, digits, `.`, `_` and `-`, for example bench-2",
        ) from fault
