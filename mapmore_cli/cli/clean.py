"""Implement `mapmore clean`, which removes the runs that belong to none of the given specs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from mapmore_cli.cli.console import RUNS, AsJson, Runs, View, print_view
from mapmore_cli.domain.errors import UsageError


def clean(
    configs: Annotated[
        list[Path],
        Argument(metavar="CONFIG...", help="All specs and campaigns whose runs are kept."),
    ],
    runs: Runs = RUNS,
    yes: Annotated[
        bool, Option("--yes", help="Move the listed folders to the trash, RUNS/.trash/DATE.")
    ] = False,
    now: Annotated[
        bool, Option("--now", help="With --yes: remove them at once, without the trash.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """List the runs that no spec names; remove them with --yes.

    The runs of the given specs and campaigns are kept, with their variations and the runs on which
    they build or with which they are compared. A run is removed as a whole or not at all: it is
    kept if its folder contains a file that its record does not list, a file that has changed since,
    or somebody else's folder or link. The command lists these files.
    """
    from mapmore_cli.pipeline.runs_page import write_runs_page
    from mapmore_cli.pipeline.staleness import named_runs
    from mapmore_cli.storage.atomic import refusals_told
    from mapmore_cli.storage.ownership import TRASH, contents_of, remove_own
    from mapmore_cli.storage.run_folder import run_lock
    from mapmore_cli.study.campaign import expanded
    from mapmore_cli.study.loader import load

    if not runs.is_dir():
        raise UsageError(
            f"{runs}: this folder does not exist", "name the folder of the runs with --runs"
        )
    if now and not yes:
        raise UsageError("--now needs --yes", "write `--yes --now`")
    entries = expanded(configs, ())[1]
    names = named_runs([load(entry.config, entry.overrides) for entry in entries])
    gone, kept = dict[Path, tuple[str, ...]](), dict[Path, tuple[str, ...]]()
    with refusals_told(runs):
        for folder in _unnamed(runs, names):
            contents = contents_of(folder)
            if yes and not contents.others:
                with run_lock(folder):
                    contents = contents_of(folder, rehash=now)
                    if not contents.others:
                        remove_own(folder, contents.own, now)
            (kept if contents.others else gone)[folder] = contents.others or contents.own
    if yes:
        write_runs_page(runs, [])
    print_view(_view(gone, kept, yes, f" to {runs / TRASH}" if yes and not now else ""), as_json)


def _unnamed(runs: Path, names: set[str]) -> list[Path]:
    """Return the folders in `runs` that contain a run whose name is not in `names`. Links are left
    out.

    Folders are compared by their identity and not by their names, because the file system may treat
    capital and small letters as equal.
    """
    from mapmore_cli.storage.run_record import load_origin

    named = {_identity(place) for name in names if (place := runs / name).exists()}
    return [
        folder
        for folder in sorted(runs.iterdir())
        if not folder.is_symlink() and load_origin(folder) and _identity(folder) not in named
    ]


def _identity(place: Path) -> tuple[int, int]:
    """Return the device number and the inode number of a folder. They are equal for two paths to
    the same folder.
    """
    state = place.stat()
    return state.st_dev, state.st_ino


def _view(
    gone: dict[Path, tuple[str, ...]], kept: dict[Path, tuple[str, ...]], yes: bool, where: str
) -> View:
    """Return the view of the command: the runs that were removed or would be removed, and the
    reasons why other runs are kept.
    """
    files = [str(folder / path) for folder, paths in gone.items() for path in paths]
    runs = f"{len(gone)} run{'s' if len(gone) != 1 else ''}"
    count = f"{len(files)} file{'s' if len(files) != 1 else ''} of {runs}"
    done = f"{count} {'moved' if where else 'removed'}{where}"
    end = done if yes else f"{count} would be removed; add --yes"
    why = [
        (
            f"kept: {folder}, because it contains files that its run did not write, or that "
            f"changed since: {', '.join(others)}"
        )
        for folder, others in kept.items()
    ]
    document = {
        "unnamed": [str(folder) for folder in gone],
        "files": files,
        "kept": {str(folder): others for folder, others in kept.items()},
        "removed": yes,
    }
    return View(document, lines=(*files, *why, end))
