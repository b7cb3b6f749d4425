"""Seal a run: record the states of all its files at a moment when the run is up to date.

Before a run is repeated, it is planned: mapmore finds out which of its stages are outdated, which
takes a while. This is not necessary if the seal shows that all files are unchanged. A campaign of
thousands of runs saves much time in this way. If the seal is missing, damaged or from another run,
the run is planned as usual.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TypedDict

from mapmore_cli.storage.atomic import content_of, write_own

SEAL = ".seal"
"""File in the run folder that contains the seal. If it is lost, nothing else happens than that the
run is planned again.
"""

REVISION = 2
"""Version of the contents of a seal. It is raised when `Answer` gets other keys, so that runs with
an older seal are planned again.
"""


class Answer(TypedDict):
    """Results of a run that is up to date.

    - `patterns`, `recordings`: the file patterns in the spec, and the files that they matched.
    - `stages`: the stages that are up to date.
    - `published`, `limits`: published scores and limits with which the scores of the run are
      compared, as JSON values.
    - `warnings`: findings of the rules.
    - `alerts`: sentences that warn about the scores of the run, as JSON values.
    """

    patterns: list[str]
    recordings: list[str]
    stages: list[str]
    published: object
    limits: object
    warnings: list[str]
    alerts: object


class Sealed(TypedDict):
    """Contents of a seal, which states that a run is up to date as long as its files are unchanged.

    - `question`: what was requested (spec and options), and the version of the program, as JSON
      values.
    - `texts`: SHA-256 of the specs, by path relative to the run's folder.
    - `files`: states of sources and results (`state_of`), by path relative to the run's folder.
    - `answer`: results of the run, which are used again if the other three are unchanged.
    """

    question: object
    texts: dict[str, str]
    files: dict[str, list[int]]
    answer: Answer


def state_of(state: os.stat_result) -> list[int]:
    """Return the state of a file: its size, modification time, inode number and time of the last
    change. At least one of these numbers changes when the file is written to or replaced.
    """
    return [state.st_size, state.st_mtime_ns, state.st_ino, state.st_ctime_ns]


def hashes_of(run_dir: Path, paths: Iterable[str]) -> dict[str, str]:
    """Return the SHA-256 of files, by path. The files are read as a whole, so they should be small.
    Raises OSError if a file cannot be read.
    """
    return {path: hashlib.sha256(content_of(file_at(run_dir, path))).hexdigest() for path in paths}


def states_of(run_dir: Path, paths: Iterable[str]) -> dict[str, list[int]]:
    """Return the states of files (`state_of`), by path. Raises OSError if a file does not exist."""
    return {path: state_of(file_at(run_dir, path).stat()) for path in paths}


def file_at(run_dir: Path, path: str) -> Path:
    """Return the path of a file from its path relative to a run folder. A step `..` is removed from
    the text of the path, because the run folder may not exist yet, or may be a link.
    """
    return Path(os.path.normpath(run_dir / path))


def write_seal(run_dir: Path, sealed: Sealed) -> None:
    """Write the seal of a run."""
    body = json.dumps(sealed)
    write_own(run_dir / SEAL, f"{hashlib.sha256(body.encode()).hexdigest()}\n{body}")


def read_seal(run_dir: Path) -> Sealed | None:
    """Return the seal of a run; None if the run has no seal, or if the seal file was changed."""
    try:
        digest, _, body = content_of(run_dir / SEAL).partition(b"\n")
    except OSError:
        return None
    if hashlib.sha256(body).hexdigest().encode() != digest:
        return None
    sealed: Sealed = json.loads(body)
    return sealed


def still_holds(run_dir: Path, sealed: Sealed) -> bool:
    """Return True if every spec, source and result is unchanged since the run was sealed."""
    try:
        return (
            states_of(run_dir, sealed["files"]) == sealed["files"]
            and hashes_of(run_dir, sealed["texts"]) == sealed["texts"]
        )
    except OSError:
        return False
