"""Results that a process has read are at hand, as long as the file is the same, and no large ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mapmore_cli.domain.recording import Curve, Dataset, Quantity, Recording
from mapmore_cli.storage import run_folder
from mapmore_cli.storage.artefacts import write_dataset
from mapmore_cli.storage.atomic import link_or_copy
from mapmore_cli.storage.run_folder import DATASET, RunFiles


def write(folder: Path, slope: float) -> None:
    folder.mkdir(exist_ok=True)
    columns = {"strain": np.arange(5.0), "force": slope * np.arange(5.0)}
    recording = Recording("a", "a.csv", columns, 5, {})
    curve = Curve("a", None, columns, np.zeros(5, dtype=np.bool_), ("a",))
    quantities = {"strain": Quantity("strain", "1"), "force": Quantity("force", "N")}
    write_dataset(folder / DATASET, Dataset("force", None, quantities, (recording,), (curve,)))


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
    write(tmp_path, 2.0)
    with pytest.raises(ValueError, match="read-only"):
        RunFiles(tmp_path).dataset().curves[0].columns["force"][0] = 1.0


def test_large_files_are_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, 2.0)
    monkeypatch.setattr(run_folder, "KEPT_BYTES", 100)
    assert RunFiles(tmp_path).dataset() is not RunFiles(tmp_path).dataset()
