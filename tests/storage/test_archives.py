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
def test_files_of_old_are_read_and_their_model_predicts_as_it_did(archive: Path) -> None:
    assert int(archive.name.split(".")[0]) <= int(FORMAT_VERSION.split(".")[0])
    for path in archive.glob("*.h5"):
        with h5py.File(path) as file:
            assert file.attrs["format_version"] == archive.name
    dataset, model = artefacts.read_dataset(archive / "ingest.h5"), artefacts.read_model(archive / "model.h5")
    then = artefacts.read_validation(archive / "validate.h5").predictions["mapmore"]
    for curve, values in zip(dataset.curves, then, strict=True):
        np.testing.assert_allclose(predict(model, curve.columns), values, rtol=1e-12)
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


def test_results_stay_in_memory_until_their_file_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, 2.0)
    first = RunFiles(tmp_path).dataset()
    assert RunFiles(tmp_path).dataset() is first
    with pytest.raises(ValueError, match="read-only"):  # nobody changes what others read
        first.curves[0].columns["force"][0] = 1.0
    write(tmp_path, 3.0)
    assert RunFiles(tmp_path).dataset().curves[0].columns["force"][1] == 3.0
    monkeypatch.setattr(run_folder, "KEPT_BYTES", 100)
    assert RunFiles(tmp_path).dataset() is not RunFiles(tmp_path).dataset()
