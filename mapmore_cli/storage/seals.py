"""The seal of a run: what one look at its files has to show for the run to be up to date still.

It saves a campaign of thousands of runs from planning each of them. A seal that is missing, damaged
or of another run says nothing, and the run is planned.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TypedDict

from mapmore_cli.storage.atomic import write_text

SEAL = ".seal"
"""The file in the folder of a run; nobody misses it."""

REVISION = 2
"""Raised when an `Answer` has other keys, so that runs with an older seal are planned."""


class Answer(TypedDict):
    """Results of a run that is up to date.

    - `patterns`, `recordings`: the files that the spec names, and what was found by these patterns.
    - `stages`: the stages that are up to date.
    - `published`, `limits`: the numbers that its scores are compared with, as JSON values.
    - `warnings`: what the rules found.
    - `alerts`: what speaks against its scores, as JSON values.
    """

    patterns: list[str]
    recordings: list[str]
    stages: list[str]
    published: object
    limits: object
    warnings: list[str]
    alerts: object


class Sealed(TypedDict):
    """A run that is up to date while the rest of it is as it was.

    - `question`: what was asked for, and the program that answered, as JSON values.
    - `texts`: SHA-256 of the specs, by path from the run's folder.
    - `files`: the states of sources and results, by path from the run's folder.
    - `answer`: what is known of the run then.
    """

    question: object
    texts: dict[str, str]
    files: dict[str, list[int]]
    answer: Answer


def state_of(state: os.stat_result) -> list[int]:
    """Return what changes when a file is written to or replaced."""
    return [state.st_size, state.st_mtime_ns, state.st_ino, state.st_ctime_ns]


def hashes_of(run_dir: Path, paths: Iterable[str]) -> dict[str, str]:
    """Return the SHA-256 of small files; OSError where one cannot be read."""
    return {path: hashlib.sha256(file_at(run_dir, path).read_bytes()).hexdigest() for path in paths}


def states_of(run_dir: Path, paths: Iterable[str]) -> dict[str, list[int]]:
    """Return the states of files; OSError where one cannot be found."""
    return {path: state_of(file_at(run_dir, path).stat()) for path in paths}


def file_at(run_dir: Path, path: str) -> Path:
    """Return a file by its path from a folder, which may not be there yet, or be reached by a
    link.
    """
    return Path(os.path.normpath(run_dir / path))


def write_seal(run_dir: Path, sealed: Sealed) -> None:
    """Seal a run."""
    body = json.dumps(sealed)
    write_text(run_dir / SEAL, f"{hashlib.sha256(body.encode()).hexdigest()}\n{body}")


def read_seal(run_dir: Path) -> Sealed | None:
    """Return the seal of a run; None where there is none, or it is not as it was written."""
    try:
        digest, _, body = (run_dir / SEAL).read_bytes().partition(b"\n")
    except OSError:
        return None
    if hashlib.sha256(body).hexdigest().encode() != digest:
        return None
    sealed: Sealed = json.loads(body)
    return sealed


def still_holds(run_dir: Path, sealed: Sealed) -> bool:
    """Return whether every spec, source and result is as it was when the run was sealed."""
    try:
        return (
            states_of(run_dir, sealed["files"]) == sealed["files"]
            and hashes_of(run_dir, sealed["texts"]) == sealed["texts"]
        )
    except OSError:
        return False
