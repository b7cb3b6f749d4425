"""Provide functions that several commands use: declare options, print a result as tables or as one
JSON document, write files, and report errors with their exit codes.
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
    """Raise WriteError before the command computes if a file cannot be written
    (`storage.outputs.refuse_early`). `named` is the path, or the list of paths, that the user gave
    with an option.
    """
    from mapmore_cli.storage.outputs import refuse_early

    for path in named if isinstance(named, list) else [named]:
        if path is not None and path != STANDARD:
            refuse_early(path)
    return named


def output_option(help: str, *names: str) -> Any:
    """Return a Typer option for a file that a command writes. The option is called `--output`
    unless other `names` are given. If the file cannot be written, the command ends with an error
    before it computes.
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
    """Result of a command: the contents of the JSON document, and the tables and closing lines that
    are printed for people without `--json`.
    """

    document: Mapping[str, Any]
    tables: tuple[Table, ...] = ()
    lines: tuple[str, ...] = ()

    def under(self, head: Mapping[str, Any]) -> View:
        """Return the same view with `head` at the beginning of its document."""
        return View({**head, **self.document}, self.tables, self.lines)


def members(of: object, *names: str) -> Document:
    """Return attributes of an object as a dictionary. The name `curves` gives the entry `{"curves":
    of.curves}`, and `key=curves` gives `{"key": of.curves}`.
    """
    return {(parts := name.split("="))[0]: getattr(of, parts[-1]) for name in names}


def print_view(view: View, as_json: bool) -> None:
    """Print a result as one JSON document, or as its tables and lines with a blank line between
    them.
    """
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
    """Reserve stdout for JSON documents. Within this context, everything that a plugin prints goes
    to stderr, and `print_document` only collects the documents. When the context ends, they are
    printed on stdout.
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
    """Convert a document to JSON types: dataclasses become objects, arrays and tuples become lists,
    and NaN and infinities become None.
    """
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _as_json(item) for key, item in value.items()}
    # only NumPy values have `tolist`; this test works without an import of NumPy, which is slow
    if hasattr(value, "tolist"):
        return _as_json(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_as_json(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# Files

FIGURE_FILES, TABLE_FILES = ("svg", "pdf", "png", "pgf"), ("csv", "tex")


def folder_of(run: Path, runs: Path) -> Path:
    """Return the folder of a run. `run` is the name of the run in `runs`, or a path.

    If both exist, the name is used, because the folder with the same path may contain the study and
    not the run.
    """
    named = runs / run
    return run if run.is_dir() and not named.is_dir() else named


def spec_of(config: Path, overrides: list[str], runs: Path) -> tuple[Path, list[str]]:
    """Return the path of a spec, and the settings that replace its values.

    `config` is the path of a spec, or the name or the folder of a run. For a run, return the spec
    from which it was made; the settings with which it was made come first, and the `overrides`
    follow.
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
    problem: str = "figures and tables cannot have this file ending",
) -> None:
    """Raise UsageError for a path whose file ending is not one of the `endings`. The text `problem`
    says in the message what is wrong.
    """
    for path in paths:
        if path.suffix.removeprefix(".") not in endings:
            raise UsageError(f"{path}: {problem}", f"choose .{', .'.join(endings)}")


def write_figure(path: Path, drawing: Drawing) -> None:
    """Write a figure to a file. The format follows from the ending of the path, for example
    `.pdf`.
    """
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
    """Write a JUnit file and a Markdown summary of several runs, if these files are requested.
    `ended` holds the result of each run by the name of the run, or the error with which it ended.
    """
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
    """Print the message of an error on stderr, and return the exit code. The traceback is printed
    only with `--debug`. A broken pipe is not reported.

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
        except OSError:  # stdout cannot be written; stderr and the exit code still report the error
            _silence_stdout()
    return exit_code(error)


def error_document(error: BaseException) -> dict[str, object]:
    """Return an error as a dictionary for a JSON document: its message, remedy and exit code."""
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
    """Return the message of an error for the user. For an unexpected exception inside of mapmore,
    it is a single line without a traceback.
    """
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
    """Redirect stdout to the null device. Otherwise, Python would complain at exit that it cannot
    flush the rest of the output.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
