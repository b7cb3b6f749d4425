"""Read and write `run.json`, the record of a run: the inputs, settings and versions with which
every stage was made. The entry of a stage is written after its outputs. If outputs have no entry,
for example after an interruption, the stage runs again.

Sizes, times and hashes show whether files have changed since they were read or written. The record
contains no absolute paths, no names of users or computers, and no environment variables.

Version 1.1 of this format added `origin`, the spec from which the run was made. Version 1.2 added
`files`, the files that the run wrote in addition to the outputs of its stages.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache, lru_cache
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import AfterValidator, TypeAdapter

from mapmore_cli.domain.errors import DataError, Warn
from mapmore_cli.storage.atomic import content_of, write_own
from mapmore_cli.storage.inputs import note_read
from mapmore_cli.storage.tables.cells import shortened

LONGEST_NAME = 255  # largest number of bytes in the name of a file on common file systems


def _as_path(text: str) -> str:
    """Return a path from a record unchanged. Raises ValueError if no file can have such a path, so
    that a damaged record is recognised when it is read. Otherwise, the file system would raise
    errors of various types later.
    """
    names = [os.fsencode(name) for name in text.split("/")]
    if b"\0" in b"".join(names) or max(map(len, names)) > LONGEST_NAME:
        raise ValueError(f"no file can be called {text[:40]!r}")
    return text


RecordedPath = Annotated[str, AfterValidator(_as_path)]


@dataclass(frozen=True)
class Stamp:
    """State of a file when it was read or written: its size in bytes, its modification time and the
    SHA-256 of its content. For a long result file, the checksum inside the file is used instead of
    the SHA-256 of its content.

    The modification time alone is not sufficient, because programs that copy files can set it.
    Therefore, the inode number and the time of the last change of any kind (`ctime_ns`) are stored
    too: they show that a file was replaced. They are 0 if they are unknown, as in a record of an
    older version, or if the program itself changes them (`storage/stamps.py`).
    """

    size: int
    mtime_ns: int
    sha256: str
    inode: int = 0
    ctime_ns: int = 0

    def is_of(self, state: Sequence[int]) -> bool:
        """Return True if a file is unchanged since the stamp was taken. `state` is the present
        state of the file (`seals.state_of`).
        """
        known = (self.size, self.mtime_ns, self.inode, self.ctime_ns)
        size, mtime_ns, *rest = zip(known, state, strict=True)
        return all(a == b for a, b in (size, mtime_ns)) and all(a in (0, b) for a, b in rest)


def refuse_newer(path: Path, file_version: str, known: str) -> None:
    """Raise DataError if the format version of a file, `file_version`, is not a version
    number, or if its major number is larger than that of `known`, the version that this
    program reads.
    """
    shown = shortened(file_version)
    try:
        major = int(file_version.split(".")[0])
    except ValueError:
        raise DataError(
            f"{path}: has the unreadable format version {shown!r}",
            "delete it and run `mapmore run CONFIG`",
        ) from None
    if major > int(known.split(".")[0]):
        remedy = (
            "update mapmore, or make the file again with this version by `mapmore run CONFIG "
            "--force`"
        )
        raise DataError(
            f"{path}: was written in format {shown} by a newer mapmore; this one reads up to "
            f"{known}",
            remedy,
        )


@cache
def tool_versions() -> Mapping[str, str]:
    """Return the versions of all packages that affect numbers and files, without importing the
    packages.
    """
    packages = {name: version(name) for name in ("mapmore", "numpy", "scipy", "h5py")}
    return {**packages, "python": platform.python_version()}


RUN_RECORD = "run.json"
CAMPAIGN_RECORD = "campaign.json"
"""File by which the folder of a campaign's page is recognised."""
STAGES = ("ingest", "search", "segment", "fit", "fuse", "validate", "report")
"""The stages in their order."""
SEARCH_STAGE = "search"
"""The stage that finds the structure of a model; a spec without a search has no such stage."""
FORMAT_VERSION = "1.2"


@dataclass(frozen=True)
class StageRecord:
    """Entry of one stage in the record of a run.

    - `fingerprint`: hash of everything on which the results of the stage depend.
    - `revision`: revision of the stage's code.
    - `before`: fingerprint of the stage before; empty for the first.
    - `slice`: the part of the spec that the stage reads, as JSON values.
    - `inputs`: source files, by POSIX path relative to the spec's folder.
    - `outputs`: written files, by POSIX path relative to the run's folder.
    - `tools`: versions of the packages with which the stage was run.
    - `seconds`: duration of the stage.
    - `why`: reason why it ran.
    """

    fingerprint: str
    revision: int
    before: str
    slice: Any
    inputs: Mapping[RecordedPath, Stamp]
    outputs: Mapping[RecordedPath, Stamp]
    tools: Mapping[str, str]
    seconds: float
    why: str


@dataclass(frozen=True)
class Origin:
    """Origin of a run.

    - `spec`: POSIX path of the spec, relative to the run's folder. If this path would lead through
      the root folder, it is only the file name. It is empty if the spec is unknown.
    - `campaign`: POSIX path of the campaign, relative to the run's folder; empty without a
      campaign.
    - `settings`: settings from the campaign or the command line that replace settings of the spec.
    """

    spec: RecordedPath
    campaign: RecordedPath = ""
    settings: tuple[str, ...] = ()

    def rival_of(self, other: Origin, run_dir: Path) -> str | None:
        """Return the spec or the campaign that conflicts with this origin, as a path relative to
        the run's folder. `other` is the origin of a run that already has the same name and the same
        folder. There is a conflict if it names another spec, or a campaign with other settings.
        Return None without a conflict, or if the other file does not exist any more.
        """
        if other.spec != self.spec:
            return other.spec if (run_dir / other.spec).is_file() else None
        campaigns = self.campaign and other.campaign and self.campaign != other.campaign
        return (
            other.campaign
            if campaigns
            and self.settings != other.settings
            and (run_dir / other.campaign).is_file()
            else None
        )


_ORIGIN, _STAGES = TypeAdapter(Origin), TypeAdapter(dict[str, StageRecord])
_FILES = TypeAdapter(dict[RecordedPath, Stamp])
DAMAGE = (OSError, ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError)
"""Errors that reading a foreign JSON document may raise."""


def read_json(path: Path) -> Any:
    """Return the contents of a JSON file. The caller must not change them, because they are cached.
    Raises the errors in `DAMAGE`.
    """
    return _document(content_of(path).decode())


@lru_cache(maxsize=4)
def _document(text: str) -> Any:
    return json.loads(text)


def stale_stages(records: Mapping[str, StageRecord]) -> dict[str, str]:
    """Return the stages whose results are out of date, because an earlier stage was repeated after
    them. Each stage is returned with the name of this earlier stage.
    """
    reasons: dict[str, str] = {}
    done = [name for name in STAGES if name in records]
    first, after = records.get("ingest"), records.get("segment")
    if first and after and after.before == first.fingerprint and SEARCH_STAGE in done:
        done.remove(SEARCH_STAGE)  # `mapmore tune` searched, but the run has another structure
    for before, name in pairwise(done):
        if records[name].before != records[before].fingerprint or before in reasons:
            reasons[name] = reasons.get(before, before)
    return reasons


def refuse_stale(run_dir: Path) -> None:
    """Raise DataError if the model or the scores of a run are out of date, because an earlier stage
    was repeated after them. The results of the run then belong to different specs or data.
    """
    old = stale_stages(load_records(run_dir))
    if name := next((name for name in STAGES[:-1] if name in old), None):
        raise DataError(
            f"{run_dir}: {name} is out of date, because {old[name]} was repeated since",
            "bring the run up to date with `mapmore run`",
        )


def load_origin(run_dir: Path) -> Origin | None:
    """Return the origin of a run; None if it is unknown."""
    try:
        return _ORIGIN.validate_python(read_json(run_dir / RUN_RECORD)["origin"])
    except DAMAGE:
        return None


def load_records(run_dir: Path, warn: Warn = lambda _message: None) -> dict[str, StageRecord]:
    """Return the entries of the stages in the record of a run, by name. If there is no record, the
    result is empty. If the record is damaged, `warn` is called, and the result is empty too.

    Raises DataError for a record of a newer format.
    """
    path = run_dir / RUN_RECORD
    try:
        document = read_json(path)
        stages = _STAGES.validate_python(document["stages"])
        version = str(document["format_version"])
    except FileNotFoundError:
        return {}
    except DAMAGE as fault:
        warn(
            f"{path}: is damaged ({type(fault).__name__}: {str(fault).partition(chr(10))[0]}) "
            "and is ignored; every stage runs again"
        )
        return {}
    refuse_newer(path, version, FORMAT_VERSION)
    note_read(_sources_of(run_dir, stages))
    return stages


def _sources_of(run_dir: Path, stages: Mapping[str, StageRecord]) -> Iterator[Path]:
    """Yield the spec and the source files of a run, from its record."""
    if (origin := load_origin(run_dir)) is not None:
        spec = run_dir / origin.spec
        yield spec
        for record in stages.values():
            yield from (spec.parent / path for path in record.inputs)


def is_record(record: Path) -> bool:
    """Return True if the file `record` may have been written by mapmore. This includes a file that
    is damaged, so that it cannot be read. Return False for an intact JSON document of another
    program.
    """
    try:
        document = json.loads(content_of(record))
    except (OSError, ValueError, RecursionError):
        return record.is_file()
    ours = document.get("creator") == "mapmore" if isinstance(document, dict) else True
    return ours or not document or "stages" in document


def holds_results(folder: Path) -> bool:
    """Return True if a folder holds the record of a run, of a frozen model or of a campaign."""
    return any(
        (folder / name).is_file() and is_record(folder / name)
        for name in (RUN_RECORD, CAMPAIGN_RECORD)
    )


def written_files(run_dir: Path) -> dict[str, Stamp]:
    """Return the stamps of all files that the record of a run lists, by POSIX path relative to the
    run folder. The result is empty if the record cannot be read.
    """
    try:
        document = read_json(run_dir / RUN_RECORD)
        refuse_newer(run_dir / RUN_RECORD, str(document["format_version"]), FORMAT_VERSION)
        stamps = _FILES.validate_python(document.get("files", {}))
        for record in _STAGES.validate_python(document["stages"]).values():
            stamps |= record.outputs
    except (*DAMAGE, DataError):
        return {}
    return stamps


def recorded_name(run_dir: Path) -> str | None:
    """Return the name of the run in the record of a folder; None if it is unknown."""
    try:
        document = read_json(run_dir / RUN_RECORD)
        return _as_path(str(document["name"])) if document["creator"] == "mapmore" else None
    except DAMAGE:
        return None


def save_records(
    run_dir: Path,
    name: str,
    origin: Origin,
    records: Mapping[str, StageRecord],
    files: Mapping[str, Stamp] = MappingProxyType({}),
) -> None:
    """Write `run.json` as a whole. `files` are files that the run wrote in addition to the outputs
    of its stages.

    The record that exists so far may list more files, for example the result of a search that the
    spec no longer requests. As long as such a file exists, it is listed again.
    """
    outputs = {path for record in records.values() for path in record.outputs}
    listed = {**written_files(run_dir), **files}
    document = {
        "format_version": FORMAT_VERSION,
        "creator": "mapmore",
        "name": name,
        "origin": asdict(origin),
        "files": {
            path: asdict(stamp)
            for path, stamp in sorted(listed.items())
            if path not in outputs and os.path.lexists(run_dir / path)
        },
        "stages": {stage: asdict(record) for stage, record in records.items()},
    }
    write_own(
        run_dir / RUN_RECORD,
        json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
    )
