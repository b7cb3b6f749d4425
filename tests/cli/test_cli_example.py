"""`mapmore example`, and a model in a notebook."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
import yaml

import mapmore_cli
from mapmore_cli.study.prediction.loaded_model import LoadedModel

PROJECT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, mapmore: Callable[..., Any]) -> Path:
    """The folder of the example, with its run; `test_shipped_studies` makes the page of the same study."""
    folder = tmp_path_factory.mktemp("new") / "muscle"
    result = mapmore("example", folder)
    assert result.exit_code == 0, result.stderr
    assert f"Next: mapmore run {folder / 'study.yaml'}" in result.stdout
    result = mapmore("validate", folder / "study.yaml", "--runs", folder / "runs", "-q")
    assert result.exit_code == 0, result.stderr
    return folder


def test_the_example_is_the_static_study_that_is_shipped(finished: Path) -> None:
    """The same recordings byte for byte, and so the same scores."""
    for recording in sorted(finished.glob("*.csv")):
        assert recording.read_bytes() == (PROJECT / "datasets" / "mckibben" / recording.name).read_bytes()
    rig = yaml.safe_load((finished / "rig.yaml").read_text())
    assert rig == yaml.safe_load((PROJECT / "datasets" / "mckibben" / "load_cycles.yaml").read_text())


def test_a_folder_with_something_in_it_is_left_alone(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    result = mapmore("example", tmp_path)
    assert result.exit_code == 7
    assert "is not an empty folder" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.fixture
def model(finished: Path) -> LoadedModel:
    return mapmore_cli.load_model(finished / "runs" / "example" / "model.h5")


def test_a_notebook_shows_what_a_model_is(model: LoadedModel, finished: Path) -> None:
    assert repr(model) == "<model example: force [N] of pressure [kPa], strain [1]>"
    assert model.units == {"pressure": "kPa", "strain": "1", "force": "N"}
    assert list(model.scores) == json.loads((finished / "runs" / "example" / "scores.json").read_text())["scores"]


def test_points_outside_of_the_training_range_are_told(model: LoadedModel) -> None:
    assert np.isfinite(model(pressure=150.0, strain=[0.02, 0.05])).all()
    with pytest.warns(UserWarning, match=r"1 of 2 point\(s\) lie outside of the training range of example"):
        model(pressure=150.0, strain=[0.02, 0.9])


def test_a_model_draws_its_training_curves(model: LoadedModel) -> None:
    mpl.use("Agg")
    ax = model.plot()
    assert [line.get_label() for line in ax.lines] == ["pressure=80", "pressure=150", "pressure=350"]
    line = ax.lines[1]
    np.testing.assert_allclose(line.get_ydata(), model(pressure=150.0, strain=line.get_xdata()))
    assert ax.get_xlabel() == "strain [1]"
    mpl.pyplot.close(ax.figure)
