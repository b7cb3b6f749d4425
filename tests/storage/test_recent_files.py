"""Results that a process has read or written are at hand, as long as the file is the same, and no large ones."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve, Dataset, Quantity, Recording
from mapmore_cli.storage import recent
from mapmore_cli.storage.artefacts import read_dataset, write_dataset
from mapmore_cli.storage.artefacts.files import FileKind
from mapmore_cli.storage.atomic import link_or_copy
from mapmore_cli.storage.run_folder import DATASET, RunFiles


def dataset(slope: float, size: int = 5) -> Dataset:
    columns = {"strain": np.arange(float(size)), "force": slope * np.arange(size)}
    recording = Recording("a", "a.csv", columns, size, {})
    curve = Curve("a", None, columns, np.zeros(size, dtype=np.bool_), ("a",))
    quantities = {"strain": Quantity("strain", "1"), "force": Quantity("force", "N")}
    return Dataset("force", None, quantities, (recording,), (curve,))


def write(folder: Path, slope: float) -> None:
    folder.mkdir(exist_ok=True)
    write_dataset(folder / DATASET, dataset(slope))


def test_what_was_written_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_kind: FileKind, path: Path, *_rest: object) -> None:
        raise AssertionError(f"{path} is read")

    monkeypatch.setattr(FileKind, "read", refuse)
    write(tmp_path, 2.0)
    assert RunFiles(tmp_path).dataset().curves[0].columns["force"][1] == 2.0


def test_a_result_of_another_process_is_seen(tmp_path: Path) -> None:
    """Also where it has the size of the one before, and not even its time differs: it is another file."""
    write(tmp_path / "other", 3.0)
    recent._kept.clear()  # what the other process knows
    write(tmp_path, 2.0)
    before = (tmp_path / DATASET).stat()
    os.utime(tmp_path / "other" / DATASET, ns=(before.st_atime_ns, before.st_mtime_ns))
    (tmp_path / "other" / DATASET).replace(tmp_path / DATASET)
    assert (tmp_path / DATASET).stat().st_size == before.st_size
    assert RunFiles(tmp_path).dataset().curves[0].columns["force"][1] == 3.0


def test_a_file_is_read_again_when_it_was_replaced(tmp_path: Path) -> None:
    write(tmp_path, 2.0)
    first = RunFiles(tmp_path).dataset()
    assert RunFiles(tmp_path).dataset() is first
    link_or_copy(tmp_path / DATASET, tmp_path / "other.h5")
    write(tmp_path, 3.0)
    assert RunFiles(tmp_path).dataset().curves[0].columns["force"][1] == 3.0
    (tmp_path / "linked").mkdir()
    (tmp_path / "other.h5").rename(tmp_path / "linked" / DATASET)
    assert RunFiles(tmp_path / "linked").dataset() is first


def test_nobody_changes_what_others_read(tmp_path: Path) -> None:
    given = dataset(2.0)
    write_dataset(tmp_path / DATASET, given)
    found = RunFiles(tmp_path).dataset().curves[0].columns["force"]
    with pytest.raises(ValueError, match="read-only"):
        found[0] = 1.0
    given.curves[0].columns["force"][1] = 9.0  # the writer's own stay its own
    assert found[1] == 2.0


def test_what_cannot_be_is_told_when_it_is_asked_for(tmp_path: Path) -> None:
    broken = replace(dataset(2.0), curves=(replace(dataset(2.0).curves[0], held_out=np.zeros(4, dtype=np.bool_)),))
    write_dataset(tmp_path / DATASET, broken)
    with pytest.raises(DataError, match="held_out, has 4 values"):
        RunFiles(tmp_path).dataset()


def test_large_files_are_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_dataset(tmp_path / DATASET, dataset(2.0, 5000))  # compressed: more in memory than on the disk
    assert recent._key(read_dataset, (tmp_path / DATASET).stat()) not in recent._kept
    monkeypatch.setattr(recent, "WRITTEN_BYTES", 100)
    monkeypatch.setattr(recent, "READ_BYTES", 100)
    write(tmp_path, 2.0)
    assert RunFiles(tmp_path).dataset() is not RunFiles(tmp_path).dataset()


def test_only_the_latest_are_kept(tmp_path: Path) -> None:
    for number in range(recent.MOST + 3):
        write(tmp_path / str(number), 2.0)
    assert len(recent._kept) == recent.MOST
