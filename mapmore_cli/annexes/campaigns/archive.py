"""Frozen models: what a run found, kept under a name that no later run overwrites."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

from mapmore_cli import __version__
from mapmore_cli.domain.errors import DataError, UsageError, WriteError
from mapmore_cli.storage.atomic import refusals_told, sync_tree, unfinished_beside, write_text
from mapmore_cli.storage.run_folder import MODEL
from mapmore_cli.storage.run_record import RUN_RECORD, load_records, take_stamp

KEPT = (MODEL, "scores.json", "scores.csv", "experiment.yaml", RUN_RECORD)
FROZEN = "frozen.json"
TAG = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


def freeze(run_dir: Path, tag: str, archive: Path) -> Path:
    """Copy the model of a finished run, its scores, spec and hashes to `ARCHIVE/NAME@TAG`; the
    folder.

    Raises DataError where the run is not finished, its files are not the ones that it wrote, or its
    record has no name of a run; UsageError where the tag is no name; WriteError where that name is
    taken, or the archive cannot be written.
    """
    if not TAG.fullmatch(tag):
        raise UsageError(
            f"{tag!r} cannot be a tag",
            "use letters, digits, points, dashes and underscores, as 2026-spring",
        )
    _check_finished(run_dir)
    name = _entry(run_dir / RUN_RECORD, "name")
    if not isinstance(name, str) or not TAG.fullmatch(name):  # a stranger's may lead anywhere
        raise DataError(
            f"{run_dir / RUN_RECORD}: has no name of a run",
            "make the run anew with `mapmore run CONFIG --force`",
        )
    place = archive / f"{name}@{tag}"
    if place.exists():
        raise WriteError(f"{place}: is frozen already, and stays as it is", "choose another tag")
    with refusals_told(archive):
        archive.mkdir(parents=True, exist_ok=True)
        with unfinished_beside(place, folder=True) as unfinished:
            for kept in KEPT:
                shutil.copyfile(run_dir / kept, unfinished / kept)
            hashes = {kept: take_stamp(unfinished / kept).sha256 for kept in KEPT}
            document = {
                "creator": f"mapmore {__version__}",
                "name": name,
                "tag": tag,
                "sha256": hashes,
            }
            write_text(
                unfinished / FROZEN, json.dumps(document, indent=1, ensure_ascii=False) + "\n"
            )
            for file in (*KEPT, FROZEN):
                (unfinished / file).chmod(0o444)  # read-only
            sync_tree(unfinished)
            unfinished.chmod(0o755)
            unfinished.rename(place)
    return place


def _entry(path: Path, *keys: str) -> object:
    """Return what stands under some keys of a JSON file; None where there is nothing, or no such
    file.
    """
    try:
        entry = json.loads(path.read_text(encoding="utf-8"))
        for key in keys:
            entry = entry[key]
    except (OSError, ValueError, TypeError, KeyError, IndexError, RecursionError):
        return None
    return entry


def _check_finished(run_dir: Path) -> None:
    """Check that what `run.json` says was written is there."""
    remedy = "bring the run up to date with `mapmore run`"
    if missing := [kept for kept in KEPT if not (run_dir / kept).is_file()]:
        raise DataError(f"{run_dir}: is no finished run ({', '.join(missing)} missing)", remedy)
    written = {
        path: stamp
        for record in load_records(run_dir, lambda _message: None).values()
        for path, stamp in record.outputs.items()
    }
    for kept in KEPT[:3]:
        if kept not in written or take_stamp(run_dir / kept).sha256 != written[kept].sha256:
            raise DataError(f"{run_dir / kept}: is not the file that the run wrote", remedy)


def find_model(text: str, runs: Path, archive: Path) -> Path:
    """Return the model file that a word on the command line means: a file, a run folder, a run,
    `NAME@TAG`, or a tag that one run has.

    Raises DataError where there is none, or a frozen model is not what was frozen; UsageError where
    several runs have the tag.
    """
    path = Path(text)
    if path.is_file():
        return path
    tagged = sorted(archive.glob(f"[!.]*@{text}")) if TAG.fullmatch(text) else []
    places = [path, runs / text, archive / text, *tagged]
    folders = list(dict.fromkeys(place for place in places if (place / MODEL).is_file()))
    if not folders:
        raise DataError(
            f"{text}: there is no model of this name",
            f"name a model file, a run in {runs}, or a tag in {archive}",
        )
    if len(folders) > 1 and folders[0].parent == archive:
        names = ", ".join(place.name for place in folders)
        raise UsageError(
            f"{text}: several frozen models have this tag: {names}", "name one of them in full"
        )
    model, record = folders[0] / MODEL, folders[0] / FROZEN
    if record.is_file() and take_stamp(model).sha256 != _entry(record, "sha256", MODEL):
        raise DataError(
            f"{model}: is not the model that was frozen",
            "take the folder from a backup, or freeze the run anew",
        )
    return model
