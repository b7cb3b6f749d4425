"""Frozen models: what a run found, kept under a name that no later run overwrites, and compared
with later ones.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mapmore_cli import __version__
from mapmore_cli.domain.errors import DataError, UsageError, WriteError
from mapmore_cli.modelling.validation.comparison import Comparison, compare
from mapmore_cli.pipeline.staleness import (
    MODEL_STAGE,
    SEARCH_STAGE,
    known_records,
    slice_differences,
)
from mapmore_cli.storage.artefacts import read_model
from mapmore_cli.storage.atomic import refusals_told, sync_tree, unfinished_beside, write_text
from mapmore_cli.storage.run_folder import MODEL
from mapmore_cli.storage.run_record import (
    CAMPAIGN_RECORD,
    RUN_RECORD,
    Origin,
    StageRecord,
    load_origin,
    load_records,
    take_stamp,
)

KEPT = (MODEL, "scores.json", "scores.csv", "experiment.yaml", RUN_RECORD)
FROZEN = "frozen.json"
TAG = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


def freeze(run_dir: Path, tag: str, archive: Path) -> list[Path]:
    """Copy the model of a finished run, its scores, spec and hashes to `ARCHIVE/NAME@TAG`, or those
    of all runs of a campaign; the folders, that of the campaign last.

    Raises DataError where a run is not finished, its files are not the ones that it wrote, or its
    record has no name of a run; UsageError where the tag is no name; WriteError where a name is
    taken, or the archive cannot be written. Then nothing is frozen.
    """
    if not TAG.fullmatch(tag):
        raise UsageError(
            f"{tag!r} cannot be a tag",
            "use letters, digits, points, dashes and underscores, as 2026-spring",
        )
    members = _members(run_dir)
    run_dirs = [run_dir] if members is None else [run_dir.parent / name for name in members]
    places = [archive / f"{_checked_name(one)}@{tag}" for one in run_dirs]
    if members is not None:
        places.append(archive / f"{run_dir.name}@{tag}")
    if taken := next((place for place in places if place.exists()), None):
        raise WriteError(f"{taken}: is frozen already, and stays as it is", "choose another tag")
    for one, place in zip(run_dirs, places, strict=False):
        hashes = {kept: take_stamp(one / kept).sha256 for kept in KEPT}
        about = {"name": place.name.removesuffix(f"@{tag}"), "tag": tag, "sha256": hashes}
        _keep(one, KEPT, FROZEN, about, place)
    if members is not None:
        _keep(run_dir, (), CAMPAIGN_RECORD, {"campaign": run_dir.name, "runs": members}, places[-1])
    return places


def _keep(
    run_dir: Path, kept: Sequence[str], record: str, about: Mapping[str, Any], place: Path
) -> None:
    """Copy files of a run to a place of the archive, with a record about them, all read-only."""
    document = {"creator": f"mapmore {__version__}", **about}
    with refusals_told(place.parent):
        place.parent.mkdir(parents=True, exist_ok=True)
        with unfinished_beside(place, folder=True) as unfinished:
            for name in kept:
                shutil.copyfile(run_dir / name, unfinished / name)
            text = json.dumps(document, indent=1, ensure_ascii=False) + "\n"
            write_text(unfinished / record, text)
            for file in (*kept, record):
                (unfinished / file).chmod(0o444)  # read-only
            sync_tree(unfinished)
            unfinished.chmod(0o755)
            unfinished.rename(place)


def made_from(run_dir: Path) -> tuple[str, tuple[str, ...]]:
    """Return the spec or the campaign that a run was made from, from its folder, and the settings
    on the command line that decide about its model.
    """
    origin = load_origin(run_dir) or Origin("")
    if origin.campaign:
        return origin.campaign, ()
    harmless = ("name=", "report", "validate")
    return origin.spec, tuple(one for one in origin.settings if not one.startswith(harmless))


def _members(folder: Path) -> list[str] | None:
    """Return the names of the runs of a campaign whose page or record is in a folder; None for any
    other.

    Raises DataError where the record does not name them.
    """
    record = folder / CAMPAIGN_RECORD
    if not record.is_file():
        return None
    names = _entry(record, "runs")
    if not isinstance(names, list) or not all(
        isinstance(name, str) and TAG.fullmatch(name) for name in names
    ):
        raise DataError(
            f"{record}: does not name the runs of the campaign",
            "make it anew with `mapmore batch CAMPAIGN`",
        )
    return names


def _checked_name(run_dir: Path) -> str:
    """Return the name of a finished run whose files are those that it wrote; raises DataError."""
    _check_finished(run_dir)
    name = _entry(run_dir / RUN_RECORD, "name")
    if not isinstance(name, str) or not TAG.fullmatch(name):  # a stranger's may lead anywhere
        raise DataError(
            f"{run_dir / RUN_RECORD}: has no name of a run",
            "make the run anew with `mapmore run CONFIG --force`",
        )
    return name


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


def find_campaign(text: str, runs: Path, archive: Path) -> dict[str, Path] | None:
    """Return the models of a campaign by the names of its runs; None where the text names none."""
    for folder in (Path(text), runs / text, archive / text):
        members = _members(folder)
        if members is not None:
            _, at, tag = folder.name.rpartition("@")
            places = [
                folder.parent / f"{name}{at}{tag}" if at else folder.parent / name
                for name in members
            ]
            return {
                name: find_model(str(place), runs, archive)
                for name, place in zip(members, places, strict=True)
            }
    return None


def compared(before: Path, after: Path, margin: float, other_settings: bool = False) -> Comparison:
    """Compare two models, with what their runs were made from.

    Raises UsageError where their settings differ, unless `other_settings` are allowed; DataError
    where they are of other quantities, or have too few curves in common.
    """
    records = [known_records(model.parent) for model in (before, after)]
    settings = tuple(_other_settings(*records))
    if settings and not other_settings:
        raise UsageError(
            f"{before} and {after} were made by other settings, so that a difference may be theirs:"
            f" {'; '.join(settings)}",
            "make both by the same settings, or add --allow-other-settings",
        )
    hashes = [
        sorted(stamp.sha256 for stamp in one["ingest"].inputs.values()) if "ingest" in one else []
        for one in records
    ]
    try:
        found = compare(read_model(before), read_model(after), margin)
    except ValueError as fault:
        raise DataError(
            f"{before}, {after}: {fault}",
            "compare models of the same quantities that have curves in common",
        ) from fault
    return replace(found, settings=settings, same_recordings=hashes[0] == hashes[1] != [])


MADE_BY = ("segment", "dictionary", "model", "fit", "fuse")
"""Sections by which a model is made of its curves."""


def _other_settings(
    before: Mapping[str, StageRecord], after: Mapping[str, StageRecord]
) -> Iterator[str]:
    """Yield the keys that differ, with both values; none where a model was sent alone, without the
    record of its run, or where both searched alike.
    """
    both = [record for record in (before, after) if MODEL_STAGE in record]
    searched = [record[SEARCH_STAGE].slice for record in both if SEARCH_STAGE in record]
    if len(both) < 2 or (len(searched) == 2 and searched[0] == searched[1]):
        return
    old, new = (record[MODEL_STAGE].slice for record in both)
    if isinstance(old, dict) and isinstance(new, dict):
        for section in MADE_BY:
            yield from slice_differences(
                MODEL_STAGE, {section: old.get(section)}, {section: new.get(section)}
            )
