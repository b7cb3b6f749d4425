"""Define the command `mapmore` with its subcommands, and turn every error into a message and an
exit code.

To start fast, nothing large is imported here or at the top of the modules of the commands. Only the
module of the requested command is imported, and its functions import what they need.
"""

from __future__ import annotations

import io
import os
import sys
import warnings
from collections.abc import Callable
from contextlib import nullcontext, suppress
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, TextIO, cast

import typer
from typer import Option
from typer.core import TyperGroup

from mapmore_cli.cli import console
from mapmore_cli.domain import plugins
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.storage.inputs import files_read

if TYPE_CHECKING:
    from typer._click.core import Command, Context

MODULES = {
    **dict.fromkeys(("ingest", "segment", "fit", "fuse", "validate", "report", "run"), "pipeline"),
    **dict.fromkeys(("freeze", "compare"), "compare"),
    **dict.fromkeys(("figure", "show", "schema", "example"), "files"),
    **dict.fromkeys(("predict", "invert"), "predict"),
    **{name: name for name in ("adapt", "check", "clean")},
}
"""Module in `cli/` of each command. The function in the module has the name of the command. Plugins
add further commands (`domain.plugins`).
"""

ORDER = (
    *("ingest", "segment", "fit", "fuse", "validate", "report", "run", "batch", "tune", "plan"),
    *("predict", "adapt", "invert", "freeze", "compare", "export", "figure"),
    *("show", "clean", "init", "example", "check", "schema"),
)
"""Order in which `--help` lists the commands: the order in which a user needs them."""

REMOVED = {
    "paper": (
        "`mapmore paper` no longer exists: docs/papers/compare.py makes its page",
        "run `make paper` in a checkout of the sources",
    ),
    "simulate": (
        "`mapmore simulate` no longer exists: datasets/rig makes the shipped recordings",
        "run `python -m datasets.rig SPEC` in a checkout of the sources",
    ),
}
"""For each command that no longer exists: an explanation, and what to do instead."""

AS_JSON = "mapmore.json"
"""Key in the context of Typer: True if the command line asks for JSON. Errors are then reported in
JSON as well.
"""


def _function(name: str) -> Callable[..., None]:
    """Return the Python function that executes a command. Raises NotInstalled if the function
    belongs to a package that cannot be imported.
    """
    if name in MODULES:
        function: Callable[..., None]
        function = getattr(import_module(f"mapmore_cli.cli.{MODULES[name]}"), name)
        return function
    return cast(Callable[..., None], plugins.load("commands", name))


def _command(name: str, function: Callable[..., None], any_line: bool) -> Command:
    """Return a command that calls a function. With `any_line`, the command accepts all arguments
    and options; this is used for commands that only report an error.
    """
    settings = {"ignore_unknown_options": any_line, "allow_extra_args": any_line}
    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command(name, context_settings=settings)(function)
    return typer.main.get_command(alone)


def _absent(name: str, fault: UsageError) -> Command:
    """Return a command that only reports the error `fault`, for a command that is not available."""

    def absent() -> None:
        """Report why this command is not available."""
        raise fault

    return _command(name, absent, any_line=True)


class Commands(TyperGroup):
    """Group of subcommands, which imports a command when it is requested, turns errors into exit
    codes, and accepts `--debug`, `--no-plugins`, `--no-color` and `--env` anywhere on the command
    line.
    """

    def list_commands(self, ctx: Context) -> list[str]:  # noqa: ARG002 - as click calls it
        """Return the names of all commands, in the order in which a user usually needs them."""
        # commands of plugins are looked up only here, because `--no-plugins` may exclude them
        if not self.commands:
            added = plugins.entry_points("commands")
            for name in added.keys() & MODULES.keys():
                plugins.leave_plugin_out(
                    "commands", name, ValueError("mapmore itself has a command of this name")
                )
            names = {*MODULES, *added} - {*REMOVED}
            ordered = [*(name for name in ORDER if name in names), *sorted(names - {*ORDER})]
            self.commands = cast("dict[str, Command]", dict.fromkeys(ordered))
        return [*self.commands]

    def get_command(self, ctx: Context, cmd_name: str) -> Command | None:
        """Return the command with this name, or None for an unknown name. A command is built when
        it is requested for the first time.
        """
        if cmd_name in REMOVED:
            return _absent(cmd_name, UsageError(*REMOVED[cmd_name]))
        self.list_commands(ctx)
        if cmd_name in self.commands and not self.commands[cmd_name]:
            try:
                self.commands[cmd_name] = _command(cmd_name, _function(cmd_name), any_line=False)
            except plugins.NotInstalled as fault:
                self.commands[cmd_name] = _absent(cmd_name, fault)
        return super().get_command(ctx, cmd_name)

    def parse_args(self, ctx: Context, args: list[str]) -> list[str]:
        """Move `--debug`, `--no-plugins`, `--no-color` and `--env NAME` to the front, so that a
        user can append them to a command that failed.
        """
        ctx.meta[AS_JSON] = "--json" in args
        if "--no-plugins" in args:
            plugins.leave_out_others()
        if "--no-color" in args:
            os.environ["NO_COLOR"] = "1"  # Rich prints no colours if this is set
        for anywhere in {"--debug", "--no-plugins", "--no-color"} & {*args}:
            args = [anywhere, *(arg for arg in args if arg != anywhere)]
        for _ in range(args.count("--env")):
            at = len(args) - 1 - args[::-1].index("--env")
            args = [*args[at : at + 2], *args[:at], *args[at + 2 :]]
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Context) -> None:
        """Run the command and flush its output, so that a broken pipe is noticed here and not at
        exit.
        """
        # Typer may contain its own copy of click, so the class of usage errors is taken from Typer
        typers_own: tuple[type[BaseException], ...] = (
            typer.Exit,
            typer.Abort,
            *typer.BadParameter.__bases__,
        )
        try:
            with files_read(), console.documents_alone() if ctx.meta[AS_JSON] else nullcontext():
                super().invoke(ctx)
            sys.stdout.flush()
        except typers_own:
            raise
        # a plugin may raise any exception, even SystemExit
        except BaseException as error:
            raise typer.Exit(
                console.settle(error, debug=ctx.params["debug"], as_json=ctx.meta[AS_JSON])
            ) from error


app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from mapmore_cli import __version__

        typer.echo(f"mapmore {__version__}")
        raise typer.Exit


def _let_read(names: list[str]) -> list[str]:
    """Allow specs to read further environment variables, in this process and in its child
    processes.
    """
    if names:
        os.environ["MAPMORE_ENV"] = ",".join([*names, os.environ.get("MAPMORE_ENV", "")])
    return names


@app.callback()
def _common(
    version: Annotated[
        bool,
        Option("--version", callback=_print_version, is_eager=True, help="Print the version."),
    ] = False,
    debug: Annotated[
        bool,
        Option("--debug", help="Show the traceback of an error (anywhere on the command line)."),
    ] = False,
    env: Annotated[
        list[str],
        Option(
            "--env",
            metavar="NAME",
            callback=_let_read,
            help="Let specs read this environment variable too.",
        ),
    ] = console.NONE,
    no_plugins: Annotated[
        bool,
        Option("--no-plugins", help="Leave out the plug-ins of other packages."),
    ] = False,
    no_color: Annotated[
        bool,
        Option("--no-color", help="Print without colours (as with NO_COLOR=1 in the environment)."),
    ] = False,
) -> None:
    """Build and test models of soft fluidic muscles from measured curves: one spec, one command, a
    validated model, and a page with the results.
    """


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning in the form of mapmore's own warnings if it says that a plugin is left out.
    Print all other warnings as Python does.
    """
    if not issubclass(category, plugins.PluginLeftOut):
        (file or sys.stderr).write(
            warnings.formatwarning(message, category, filename, lineno, line)
        )
    elif not {"-q", "--quiet"} & {*sys.argv}:
        print(f"warning: {message}", file=sys.stderr)


def main() -> None:
    """Run the command `mapmore`, also as `python -m mapmore_cli`."""
    warnings.showwarning = _show_warning
    # a terminal that cannot show ² or – still shows the rest of the table
    cast(io.TextIOWrapper, sys.stdout).reconfigure(errors="replace")
    try:
        app(prog_name="mapmore")
    # errors that occur outside of a command, for example while --help is printed
    except (OSError, MemoryError) as error:
        sys.exit(console.settle(error, debug=False, as_json=False))
    finally:
        # plugins may still print at exit: from here on, their output goes to stderr
        with suppress(OSError, ValueError):
            sys.stdout.flush()
            os.dup2(2, 1)
