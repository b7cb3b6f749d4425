"""Manage the folder of a run. Before the work, the folder is made, or refused if it contains other
files. Results are built elsewhere, and whole files and folders are then moved into it.

A stage builds its outputs in a folder of its own (`.tmp-...`). A new file is moved over the old
file of the same name. A folder cannot be replaced in this way. Therefore, the old folder is first
renamed to `.old-NAME`, and the new folder is then moved to `NAME`. If the process is interrupted
between these two steps, `recover` gives the old folder its name back.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from mapmore_cli.domain.arrays import SCRATCH
from mapmore_cli.domain.errors import DataError, WriteError
from mapmore_cli.domain.results import Search
from mapmore_cli.storage.atomic import (
    UNFINISHED,
    refusals_told,
    refuse_irregular,
    remove,
    sync_folder,
    sync_tree,
    unfinished_beside,
)
from mapmore_cli.storage.ownership import ASIDE, LOCK, is_as_written, is_same, put_back, to_trash
from mapmore_cli.storage.run_record import (
    RUN_RECORD,
    Stamp,
    is_record,
    written_files,
)
from mapmore_cli.storage.scores import read_scores

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import SegmentedCurve
    from mapmore_cli.domain.models import Model
    from mapmore_cli.domain.recording import Dataset
    from mapmore_cli.domain.results import FitResult, Validation
    from mapmore_cli.domain.scores import ScoreTable

DATASET, SEGMENTATION, FIT, MODEL, VALIDATION = (
    "ingest.h5",
    "segment.h5",
    "fit.h5",
    "model.h5",
    "validate.h5",
)
RESULTS: Mapping[str, str] = MappingProxyType(
    {"ingest": DATASET, "segment": SEGMENTATION, "fit": FIT, "fuse": MODEL, "validate": VALIDATION}
)
"""File with the result of each stage; `report` has a page instead."""

NOTHING: Mapping[str, Stamp] = MappingProxyType({})
"""Stamps of a record without files."""


@dataclass(frozen=True)
class RunFiles:
    """Results in the folder of a run. A result is read when its method is called. The methods raise
    the same errors as `artefacts.read_*`.

    The results that were written or read most recently stay in memory as long as their files are
    unchanged; their arrays are read-only.
    """

    folder: Path

    def dataset(self) -> Dataset:
        """Return the dataset that `ingest` wrote."""
        from mapmore_cli.storage.artefacts import DATASET_FILE

        return DATASET_FILE.latest(self.folder / DATASET)

    def segmentation(self) -> tuple[SegmentedCurve, ...]:
        """Return how the training curves are cut into segments, as the stage `segment` wrote it."""
        from mapmore_cli.storage.artefacts import SEGMENTATION_FILE

        return SEGMENTATION_FILE.latest(self.folder / SEGMENTATION).curves

    def fit(self) -> FitResult:
        """Return the fit that the stage `fit` wrote."""
        from mapmore_cli.storage.artefacts import FIT_FILE

        return FIT_FILE.latest(self.folder / FIT)

    def model(self) -> Model:
        """Return the model that `fuse` wrote."""
        from mapmore_cli.storage.artefacts import MODEL_FILE

        return MODEL_FILE.latest(self.folder / MODEL)

    def validation(self) -> Validation:
        """Return the predictions and scores that the stage `validate` wrote."""
        from mapmore_cli.storage.artefacts import VALIDATION_FILE

        return VALIDATION_FILE.latest(self.folder / VALIDATION)

    def search(self) -> Search | None:
        """Return the structures that a search tried; None without a search."""
        from pydantic import TypeAdapter, ValidationError

        path = self.folder / SEARCH
        try:
            return TypeAdapter(Search).validate_json(path.read_bytes()) if path.is_file() else None
        except ValidationError as fault:
            raise DataError(f"{path}: is damaged", "delete it, and run the study again") from fault

    def scores(self) -> ScoreTable:
        """Return the scores of the run from `scores.json`, which is quicker to read than the file
        with all predictions.
        """
        return read_scores(self.folder / "scores.json")


SEARCH = "search.json"
"""File with the structures that a search tried."""


@contextmanager
def run_lock(run_dir: Path, patient: bool = False) -> Iterator[None]:
    """Lock the run within the context. If another process holds the lock, wait if `patient` is
    True; otherwise raise WriteError. If the process that holds the lock ends, the system releases
    the lock.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(run_dir / LOCK)
    if (run_dir / LOCK).is_dir() or (run_dir / LOCK).is_symlink():
        raise WriteError(
            (
                f"{run_dir / LOCK}: is a folder or a link, but this is the place of the lock file "
                "of the run"
            ),
            "move it away",
        )
    try:
        with refusals_told(run_dir):
            lock.acquire(blocking=patient)
    except Timeout:
        remedy = "wait until it is done, or choose another folder with --runs"
        raise WriteError(f"{run_dir}: another process is writing this run", remedy) from None
    # the file system, for example of a network drive, may not support locks
    except (OSError, NotImplementedError) as fault:
        reason = getattr(fault, "strerror", None) or "its file system has no locks"
        raise WriteError(
            f"{run_dir}: cannot be locked ({reason})", "choose a local folder with --runs"
        ) from fault
    try:
        yield
    finally:
        lock.release()


def open_run_folder(run_dir: Path) -> None:
    """Make the folder of a run, if it does not exist. Raises WriteError if it cannot be made or
    written, or if it contains files of somebody else.
    """
    with refusals_told(run_dir):
        refuse_irregular(run_dir)
        for place in (run_dir, *run_dir.parents):
            if place.exists() and not place.is_dir():
                remedy = "move the file away, or choose another folder with --runs"
                raise WriteError(f"{place}: is a file where a folder is needed for the run", remedy)
        run_dir.mkdir(parents=True, exist_ok=True)
    if not os.access(run_dir, os.W_OK | os.X_OK):
        raise WriteError(
            f"{run_dir}: you may not write in this folder",
            "change its permissions, or choose another folder with --runs",
        )
    refuse_foreign(run_dir, RUN_RECORD)


def refuse_foreign(folder: Path, record: str) -> None:
    """Raise WriteError if a folder contains files, but no file `record`. mapmore writes this file
    into all its folders, so that a folder without it belongs to somebody else.
    """
    refuse_irregular(folder)
    try:
        names = {path.name for path in folder.iterdir()} if folder.is_dir() else set[str]()
    except OSError as fault:
        raise WriteError(
            f"{folder}: cannot be read ({fault.strerror})",
            "change its permissions, or choose another folder",
        ) from fault
    others = sorted(name for name in names if name != LOCK and not UNFINISHED.fullmatch(name))
    if others and (record not in names or not is_record(folder / record)):
        more = ", ..." if len(others) > 3 else ""
        raise WriteError(
            f"{folder}: holds files that mapmore did not write there "
            f"({', '.join(others[:3])}{more})",
            "give the study another `name`, or choose another folder with --runs",
        )


def recover(run_dir: Path, outputs: Iterable[str]) -> None:
    """Remove the temporary files that an interrupted process has left. If it was interrupted while
    it replaced a folder in `outputs`, and the new folder is not there yet, the old folder gets its
    name back.
    """
    with refusals_told(run_dir):
        for output in outputs:
            aside, place = run_dir / f"{ASIDE}{output}", run_dir / output
            if aside.is_dir() and not aside.is_symlink():
                if place.exists():
                    put_back(run_dir, output, written_files(run_dir))
                else:
                    aside.rename(place)
        for entry in sorted(run_dir.iterdir()):
            if UNFINISHED.fullmatch(entry.name):
                remove(entry)


def is_tidy(run_dir: Path) -> bool:
    """Return True if no process is working in the folder of a run, and none was killed during its
    work.
    """
    return not any(
        UNFINISHED.fullmatch(name) or name.startswith(ASIDE)
        for name in os.listdir(run_dir)  # noqa: PTH208
    )


@contextmanager
def stage_folder(run_dir: Path, stage: str) -> Iterator[Path]:
    """Make a new folder for the outputs of a stage, and remove it when the stage ends, also after
    an error. It is inside the run folder, because files can be moved in one step only within a file
    system. While the stage works, long columns are stored there too, instead of in memory.
    """
    with unfinished_beside(run_dir / stage, folder=True) as folder:
        token = SCRATCH.set(str(folder))
        try:
            yield folder
        finally:
            SCRATCH.reset(token)


def make_way(run_dir: Path, name: str, known: Mapping[str, Stamp]) -> list[str]:
    """Move the file `name` to the trash before a new file takes its place. If the record `known`
    lists the file and the file is unchanged, it is not moved, because it belongs to the run. Return
    a list with the name of the file if it was moved; otherwise an empty list. Raises WriteError as
    `refuse_irregular` does.
    """
    refuse_irregular(run_dir / name)
    if not (run_dir / name).is_file() or is_as_written(run_dir / name, known.get(name)):
        return []
    to_trash(run_dir, [name])
    return [name]


def swap_in(
    folder: Path, run_dir: Path, outputs: Sequence[str], known: Mapping[str, Stamp] = NOTHING
) -> list[str]:
    """Move finished `outputs` (files and folders) from `folder` into the run folder. They are first
    flushed to the disk, and then each is moved as a whole.

    An existing file belongs to somebody else if `known` does not list it, or if it has changed
    since it was written. If an output has the same name, this file is moved to the trash; otherwise
    it stays. Return the paths of the files that were moved to the trash.
    """
    sync_tree(folder)
    for output in outputs:
        for new in (folder / output, *(folder / output).rglob("*")):
            refuse_irregular(run_dir / new.relative_to(folder))
    moved = list[str]()
    for output in outputs:
        new, place = folder / output, run_dir / output
        if not (new.is_dir() and place.exists()):
            moved += [] if is_same(new, place) else make_way(run_dir, output, known)
            new.replace(place)
            continue
        aside = run_dir / f"{ASIDE}{output}"
        place.rename(aside)
        try:
            new.rename(place)
        except BaseException:
            aside.rename(place)
            raise
        moved += put_back(run_dir, output, known)
    sync_folder(run_dir)
    return moved
