"""Manage the folder of a run: it is made or refused before the work, and changed only by moving
whole files and folders into it.

A stage builds its outputs in a folder of its own (`.tmp-...`). A new file is moved over the old
file of the same name. A folder cannot be replaced in this way, so the old one is renamed
(`.old-NAME`) for an instant; if the process is interrupted in this instant, `recover` restores it.
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
    """Results in the folder of a run, read when they are needed. Raises the same errors as
    `artefacts.read_*`.

    The results that were written or read most recently stay in memory as long as their files are
    unchanged; their arrays are read-only.
    """

    folder: Path

    def dataset(self) -> Dataset:
        """Return the dataset that `ingest` wrote."""
        from mapmore_cli.storage.artefacts import DATASET_FILE

        return DATASET_FILE.latest(self.folder / DATASET)

    def segmentation(self) -> tuple[SegmentedCurve, ...]:
        """Return the cuts of the training curves, which `segment` wrote."""
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
        """Return predictions and scores, which `validate` wrote."""
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
        """Return the scores of the run, which are stored without the predictions."""
        return read_scores(self.folder / "scores.json")


SEARCH = "search.json"
"""File with the structures that a search tried."""


@contextmanager
def run_lock(run_dir: Path, patient: bool = False) -> Iterator[None]:
    """Lock the run. If another process holds the lock, wait if `patient`, otherwise raise
    WriteError. The system releases the lock when its holder ends.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(run_dir / LOCK, timeout=-1 if patient else 0)
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
            lock.acquire()
    except Timeout:
        remedy = "wait until it is done, or choose another folder with --runs"
        raise WriteError(f"{run_dir}: another process is writing this run", remedy) from None
    # for example, a network drive may have no locks
    except (OSError, NotImplementedError) as fault:
        what = getattr(fault, "strerror", None) or "its file system has no locks"
        raise WriteError(
            f"{run_dir}: cannot be locked ({what})", "choose a local folder with --runs"
        ) from fault
    try:
        yield
    finally:
        lock.release()


def open_run_folder(run_dir: Path) -> None:
    """Make the folder of a run. Raises WriteError if it cannot be made or written, or if it
    contains files of somebody else.
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
    """Raise WriteError if a folder contains files, but not the `record` that mapmore writes into
    all its folders.
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
    """Remove the remains of an interrupted process. If the process had renamed some `outputs` to
    make room for new ones, restore the renamed ones.
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
    """Make a new folder inside the run folder, so that it is on the same file system, and remove it
    when the stage ends, also after an error. Long columns are stored in it while the stage works.
    """
    with unfinished_beside(run_dir / stage, folder=True) as folder:
        token = SCRATCH.set(str(folder))
        try:
            yield folder
        finally:
            SCRATCH.reset(token)


def make_way(run_dir: Path, name: str, known: Mapping[str, Stamp]) -> list[str]:
    """Move a file to the trash before a new file takes its place, unless the record `known` lists
    the file and it is unchanged. Return a list with the `name` of the file if it was moved,
    otherwise an empty list. Raises WriteError as `refuse_irregular` does.
    """
    refuse_irregular(run_dir / name)
    if not (run_dir / name).is_file() or is_as_written(run_dir / name, known.get(name)):
        return []
    to_trash(run_dir, [name])
    return [name]


def swap_in(
    folder: Path, run_dir: Path, outputs: Sequence[str], known: Mapping[str, Stamp] = NOTHING
) -> list[str]:
    """Move finished `outputs` from `folder` into the run, each as a whole, after all of them are on
    the disk.

    A file belongs to somebody else if `known` does not list it, or if it has changed since. Such a
    file is moved to the trash if an output takes its place; otherwise it stays. Return the paths of
    the files that were moved to the trash.
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
