"""Files of older formats stay readable, and say the same."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from mapmore_cli.modelling.kinds import predict
from mapmore_cli.storage import artefacts
from mapmore_cli.storage.artefacts.files import FORMAT_VERSION

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
