"""The `mapmore` command: its subcommands in the order of the work, and where every error ends.

Nothing heavy is imported here or in the modules of the commands; each command imports what it needs when it runs.
"""

from __future__ import annotations

import io
import sys
from typing import Annotated, Any, cast

import typer
from typer.core import TyperGroup

from mapmore_cli.cli import (
    batch,
    check,
    compare,
    example,
    exits,
    export,
    figure,
    freeze,
    init,
    invert,
    pipeline,
    predict,
    schema,
    show,
    simulate,
    tune,
)

AS_JSON = "mapmore.json"
"""Key of the context: whether the line asks for JSON, in which errors are then told too."""


class Commands(TyperGroup):
    """The group of subcommands: turns errors into exit codes, and takes `--debug` anywhere on the line."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Move `--debug` to the front, so that it can be added at the end of a line that failed."""
        ctx.meta[AS_JSON] = "--json" in args
        if "--debug" in args:
            args = ["--debug", *(arg for arg in args if arg != "--debug")]
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the command and flush what it printed, so that a broken pipe shows here and not at exit."""
        # The base of BadParameter is the usage error of the click that this Typer uses, its own copy or the package.
        typers_own: tuple[type[BaseException], ...] = (typer.Exit, typer.Abort, *typer.BadParameter.__bases__)
        try:
            super().invoke(ctx)
            sys.stdout.flush()
        except typers_own:
            raise
        except (Exception, KeyboardInterrupt) as error:
            raise typer.Exit(exits.settle(error, debug=ctx.params["debug"], as_json=ctx.meta[AS_JSON])) from error


app = typer.Typer(cls=Commands, no_args_is_help=True, rich_markup_mode=None, context_settings={"help_option_names": ["-h", "--help"]})


def _print_version(wanted: bool) -> None:
    if wanted:
        from mapmore_cli import __version__

        typer.echo(f"mapmore {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error (anywhere on the line).")] = False,
) -> None:
    """Models of soft fluidic muscles from measured curves: one spec, one command, a validated model and a page to look at."""


pipeline.add_to(app)
batch.add_to(app)
tune.add_to(app)
predict.add_to(app)
invert.add_to(app)
freeze.add_to(app)
compare.add_to(app)
export.add_to(app)
figure.add_to(app)
simulate.add_to(app)
show.add_to(app)
init.add_to(app)
example.add_to(app)
check.add_to(app)
schema.add_to(app)


def main() -> None:
    """Entry point of the installed command and of `python -m mapmore_cli`."""
    cast(io.TextIOWrapper, sys.stdout).reconfigure(errors="replace")  # a terminal without ² and – still shows the table
    app(prog_name="mapmore")
