"""Provide what commands share: results on stdout as tables or as one JSON document, files, errors
with their exit codes, and options.
"""

from __future__ import annotations

import errno
import json
import math
import os
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, fields, is_dataclass
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

from typer import Argument, Option

from mapmore_cli.cli.annotations import annotate
from mapmore_cli.domain import plugins
from mapmore_cli.domain.errors import (
    LimitMissed,
    MapmoreError,
    Stopped,
    UsageError,
    WriteError,
    error_text,
    explained,
)
from mapmore_cli.domain.foreign import printable

if TYPE_CHECKING:
    from mapmore_cli.pipeline.jobs import Finished
    from mapmore_cli.reporting.figures.drawing import Drawing
    from mapmore_cli.reporting.table import Table

# Options
# --------------------------------------------------------------------------------------------------


def refuse_outputs(named: Path | list[Path] | None) -> Path | list[Path] | None:
    """Refuse the outputs that an option names, before the command computes, if they cannot be
    written (`storage.outputs.refuse_early`).
    """
    from mapmore_cli.storage.outputs import refuse_early

    for path in named if isinstance(named, list) else [named]:
        if path is not None and path != STANDARD:
            refuse_early(path)
    return named


def output_option(help: str, *names: str) -> Any:
    """Return the option for a file that a command writes, `--output` if it has no other name. A
    file that cannot be written is refused before the command computes.
    """
    names = names or ("--output", "-o")
    return Option(*names, metavar="FILE", callback=refuse_outputs, help=help)


Config = Annotated[Path, Argument(metavar="CONFIG", help="The experiment spec (YAML).")]
SpecOrRun = Annotated[
    Path, Argument(metavar="CONFIG", help="The experiment spec (YAML), or the name of a run.")
]
ModelFile = Annotated[Path, Argument(metavar="MODEL", help="A model.h5.")]
RunOrName = Annotated[Path, Argument(metavar="RUN", help="A run folder, or the name of a run.")]
Runs = Annotated[Path, Option("--runs", metavar="DIR", help="Folder of the runs.")]
Archive = Annotated[Path, Option("--archive", metavar="DIR", help="Folder of the frozen models.")]
Overrides = Annotated[
    list[str],
    Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace one value of the spec, for example fit.max_terms=2. Repeatable.",
    ),
]
Force = Annotated[bool, Option("--force", help="Redo the stages even if they are up to date.")]
Rehash = Annotated[
    bool, Option("--rehash", help="Read every recording again to see whether it changed.")
]
NoCheck = Annotated[
    bool, Option("--no-check", help="Continue although `mapmore check` finds errors.")
]
Explain = Annotated[
    bool, Option("--explain", help="Show which stages would run, and why; run nothing.")
]
AsJson = Annotated[bool, Option("--json", help="Print one JSON document instead of tables.")]
Unverified = Annotated[
    bool,
    Option(
        "--unverified",
        help="Read a file although its values differ from those that were written (checksum).",
    ),
]
Quiet = Annotated[bool, Option("--quiet", "-q", help="No progress and no warnings on stderr.")]
Verbose = Annotated[bool, Option("--verbose", "-v", help="Also show how long each step took.")]
Junit = Annotated[
    Path | None, output_option("Also write the outcome of each run, as JUnit XML.", "--junit")
]
Summary = Annotated[
    Path | None,
    output_option("Also write a summary with the tables of scores (Markdown).", "--summary"),
]
OutputOrStdout = Annotated[Path, output_option("Where to write; - is stdout.")]

RUNS, ARCHIVE, STANDARD = Path("runs"), Path("archive"), Path("-")
"""Defaults of `Runs`, of `Archive`, and of files that may be stdin or stdout."""

NONE: list[Any] = []
"""Default of options that can be repeated. Typer makes a new list of the given values."""

# Results


Document = dict[str, Any]
"""Contents of a JSON document."""


@dataclass(frozen=True)
class View:
    """A result as the contents of one JSON document, as tables, and as closing lines for people."""

    document: Mapping[str, Any]
    tables: tuple[Table, ...] = ()
    lines: tuple[str, ...] = ()

    def under(self, head: Mapping[str, Any]) -> View:
        """Return the same view with `head` at the beginning of its document."""
        return View({**head, **self.document}, self.tables, self.lines)


def members(of: object, *names: str) -> Document:
    """Return attributes of an object by their names. `key=attribute` returns an attribute under the
    name `key`.
    """
    return {(parts := name.split("="))[0]: getattr(of, parts[-1]) for name in names}


def print_view(view: View, as_json: bool) -> None:
    """Print a result as one JSON document, or as its tables with a blank line between."""
    if as_json:
        print_document(view.document)
        return
    from mapmore_cli.reporting.table import to_text

    blocks = [to_text(table).rstrip("\n") for table in view.tables]
    if view.lines:
        blocks.append("\n".join(view.lines))
    print(printable("\n\n".join(blocks)))


def print_document(document: Mapping[str, Any]) -> None:
    """Print one JSON document. NaN and infinities, which JSON does not have, become null."""
    print(json.dumps(_as_json(document), indent=2), file=_documents.get())


_documents: ContextVar[TextIO | None] = ContextVar("_documents", default=None)


@contextmanager
def documents_alone() -> Iterator[None]:
    """Keep stdout for JSON documents, which are printed at the end of the context: everything that
    a plugin prints within it goes to stderr.
    """
    documents = StringIO()
    token = _documents.set(documents)
    try:
        with plugins.printing_to_stderr():
            yield
    finally:
        _documents.reset(token)
        print(documents.getvalue(), end="")


def _as_json(value: object) -> object:
    """Convert a document to JSON types: records become objects, arrays and tuples become lists, and
    non-finite numbers None.
    """
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _as_json(item) for key, item in value.items()}
    # this is a NumPy value; NumPy is not imported for documents without arrays
    if hasattr(value, "tolist"):
        return _as_json(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_as_json(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# Files

FIGURE_FILES, TABLE_FILES = ("svg", "pdf", "png", "pgf"), ("csv", "tex")


def folder_of(run: Path, runs: Path) -> Path:
    """Return the folder of a run from its name or its path.

    A run with this name is preferred to a folder with the same name, which may be the folder of its
    study.
    """
    named = runs / run
    return run if run.is_dir() and not named.is_dir() else named


def spec_of(config: Path, overrides: list[str], runs: Path) -> tuple[Path, list[str]]:
    """Return the path of a spec and its settings. `config` is the path of the spec, or the name or
    the folder of a run. For a run, its spec is returned, and its settings before the `overrides`.
    """
    from mapmore_cli.storage.run_record import load_origin

    folder = folder_of(config, runs)
    origin = None if config.is_file() else load_origin(folder)
    if origin is None or not origin.spec:
        return config, overrides
    spec = Path(os.path.relpath(folder / origin.spec))
    return spec, [*origin.settings, *overrides]


def refuse_endings(
    paths: Sequence[Path],
    endings: Sequence[str] = (*FIGURE_FILES, *TABLE_FILES),
    what: str = "figures and tables cannot have this file ending",
) -> None:
    """Raise UsageError for a file whose ending is not among the `endings`, before anything is
    computed; `what` is the reason.
    """
    for path in paths:
        if path.suffix.removeprefix(".") not in endings:
            raise UsageError(f"{path}: {what}", f"choose .{', .'.join(endings)}")


def write_figure(path: Path, drawing: Drawing) -> None:
    """Write a figure in the format that the ending of the path names."""
    from mapmore_cli.reporting.figures.drawing import compose, to_bytes
    from mapmore_cli.reporting.figures.style import figure_style
    from mapmore_cli.storage.outputs import write_bytes

    with figure_style():
        write_bytes(
            path,
            to_bytes(compose(drawing), path.suffix.removeprefix("."), drawing.name, drawing.alt),
        )


def write_ci_files(
    junit: Path | None,
    summary: Path | None,
    ended: Mapping[str, Finished | BaseException],
    tables: Sequence[Table] = (),
) -> None:
    """Write a JUnit file and a Markdown summary of how runs ended, if they are requested."""
    if junit is None and summary is None:
        return
    from mapmore_cli.reporting.ci import RunReport, to_junit, to_summary
    from mapmore_cli.storage.outputs import write_text

    reports = [
        RunReport(name, failure=error_text(run))
        if isinstance(run, BaseException)
        else RunReport(name, run.seconds, None, run.limits, run.warnings)
        for name, run in ended.items()
    ]
    if junit is not None:
        write_text(junit, to_junit(reports))
    if summary is not None:
        write_text(summary, to_summary(reports, tables))


# Errors
# --------------------------------------------------------------------------------------------------

INTERNAL_FAULT = 1
INTERRUPTED = 130  # exit code after Ctrl-C: 128 + SIGINT, as shells report it
BROKEN_PIPE = 141  # 128 + SIGPIPE

_STDOUT = {
    errno.ENOSPC: (
        "stdout: cannot be written (no space left on device)",
        "free some space, or write to another place",
    ),
    errno.EBADF: (
        "stdout: cannot be written (it is closed)",
        "leave stdout open; use `-q` and `> /dev/null` for a quiet run",
    ),
}
"""Message for each error of stdout. Errors of files are explained by the storage layer."""


def settle(error: BaseException, debug: bool, as_json: bool) -> int:
    """Print what went wrong on stderr, and return the exit code. The traceback is printed with
    `--debug` only.

    With `--json`, the error is also printed on stdout, as a document. There are two exceptions:
    Ctrl-C, and limits that were missed, because the result on stdout already names these limits.
    """
    if isinstance(error, BrokenPipeError):
        _silence_stdout()
        return BROKEN_PIPE
    if isinstance(error, OSError) and error.errno in _STDOUT:
        _silence_stdout()
        error = WriteError(*_STDOUT[error.errno])
    if debug:
        traceback.print_exception(error, file=sys.stderr)
    else:
        print(printable(message(error)), file=sys.stderr)
    annotate("error", error_text(error))
    if as_json and not isinstance(explained(error), LimitMissed | KeyboardInterrupt):
        try:
            print_document({"error": error_document(error)})
            sys.stdout.flush()
        except OSError:  # nobody reads stdout; stderr and the exit code report the error
            _silence_stdout()
    return exit_code(error)


def error_document(error: BaseException) -> dict[str, object]:
    """Return an error as a part of a JSON document."""
    error = explained(error)
    if isinstance(error, MapmoreError):
        return {"message": error.message, "remedy": error.remedy, "exit_code": error.exit_code}
    return {"message": error_text(error), "remedy": None, "exit_code": exit_code(error)}


def exit_code(error: BaseException) -> int:
    """Return the exit code of a command that ends with this error."""
    error = explained(error)
    if isinstance(error, MapmoreError):
        return error.exit_code
    if isinstance(error, Stopped):
        return 128 + error.number
    return INTERRUPTED if isinstance(error, KeyboardInterrupt) else INTERNAL_FAULT


def message(error: BaseException) -> str:
    """Return the message for the user. An internal fault is a single line."""
    error = explained(error)
    if isinstance(error, KeyboardInterrupt):
        return str(error) or "interrupted"
    if isinstance(error, MapmoreError):
        return f"error: {error_text(error)}"
    package = plugins.blamed(error)
    if package is not None:
        fault = f"{type(error).__name__}: {error}"
        return f"error: the plug-in {package} failed: {fault}\n  ask its authors, or uninstall it"
    return error_text(error)


def _silence_stdout() -> None:
    """Redirect stdout to nothing, because Python would complain at exit that it cannot flush the
    rest.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
