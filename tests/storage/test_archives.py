"""Files of older formats stay readable, and results stay in memory as long as their files are the same."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from mapmore_cli.domain.recording import Curve, Dataset, Quantity, Recording
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.storage import artefacts, run_folder
from mapmore_cli.storage.artefacts import FORMAT_VERSION, write_dataset
from mapmore_cli.storage.run_folder import DATASET, RunFiles

ARCHIVES = sorted(path for path in (Path(__file__).parent / "archives").iterdir() if path.is_dir())


@pytest.mark.parametrize("archive", ARCHIVES, ids=lambda path: path.name)
def test_an_archive_is_what_it_is_called(archive: Path) -> None:
    for path in archive.glob("*.h5"):
        with h5py.File(path) as file:
            assert file.attrs["format_version"] == archive.name
    assert int(archive.name.split(".")[0]) <= int(FORMAT_VERSION.split(".")[0])


@pytest.mark.parametrize("archive", ARCHIVES, ids=lambda path: path.name)
def test_a_model_of_old_predicts_as_it_did(archive: Path) -> None:
    dataset = artefacts.read_dataset(archive / "ingest.h5")
    model = artefacts.read_model(archive / "model.h5")
    then = artefacts.read_validation(archive / "validate.h5").predictions["mapmore"]
    for curve, values in zip(dataset.curves, then, strict=True):
        np.testing.assert_allclose(predict(model, curve.columns), values, rtol=1e-12)


@pytest.mark.parametrize("archive", ARCHIVES, ids=lambda path: path.name)
def test_the_other_files_of_old_fit_together(archive: Path) -> None:
    segments = {segment.id for curve in artefacts.read_segmentation(archive / "segment.h5") for segment in curve.segments}
    result = artefacts.read_fit(archive / "fit.h5")
    assert {fit.id for fit in result.segments} == segments
    assert result.backbone is not None
    assert result.backbone.name == "polynomial_2"


def write(folder: Path, slope: float) -> None:
    columns = {"strain": np.arange(5.0), "force": slope * np.arange(5)}
    curve = Curve("a", None, columns, np.zeros(5, dtype=np.bool_), ("a",))
    quantities = {"strain": Quantity("strain", "1"), "force": Quantity("force", "N")}
    write_dataset(folder / DATASET, Dataset("force", None, quantities, (Recording("a", "a.csv", columns, 5, {}),), (curve,)))


def test_a_file_is_read_again_when_it_was_replaced(tmp_path: Path) -> None:
    write(tmp_path, 2.0)
    first = RunFiles(tmp_path).dataset()
    assert RunFiles(tmp_path).dataset() is first
    write(tmp_path, 3.0)
    assert RunFiles(tmp_path).dataset().curves[0].columns["force"][1] == 3.0


def test_nobody_changes_what_others_read(tmp_path: Path) -> None:
    write(tmp_path, 2.0)
    with pytest.raises(ValueError, match="read-only"):
        RunFiles(tmp_path).dataset().curves[0].columns["force"][0] = 1.0


def test_large_files_are_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_folder, "KEPT_BYTES", 100)
    write(tmp_path, 2.0)
    assert RunFiles(tmp_path).dataset() is not RunFiles(tmp_path).dataset()
