"""`mapmore show` and `load_model`: what is in the files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from cli_samples import by_hand

import mapmore_cli
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.artefacts import read_fit, read_model

SEGMENT_KEYS = {"id", "terms", "theta", "g", "err", "scaling", "stop", "condition"}
FILES = ["ingest.h5", "segment.h5", "fit.h5", "model.h5", "validate.h5", "scores.json", "run.json", "."]


@pytest.mark.parametrize("name", FILES)
def test_every_result_file_has_a_table_and_a_document(name: str, finished, document, mapmore) -> None:
    _, runs = finished
    assert isinstance(document("show", runs / "bench" / name), dict)
    shown = mapmore("show", runs / "bench" / name)
    assert (shown.exit_code, shown.stderr) == (0, "")
    assert "---" in shown.stdout


def test_fit(finished, document) -> None:
    _, runs = finished
    fits = read_fit(runs / "bench/fit.h5").segments
    shown = document("show", runs / "bench/fit.h5")["segments"]
    assert [segment["id"] for segment in shown] == [fit.id for fit in fits]
    for segment, fit in zip(shown, fits, strict=True):
        assert set(segment) >= SEGMENT_KEYS
        assert segment["terms"] == list(fit.terms)
        assert segment["theta"] == fit.selection.theta.tolist()
        assert segment["err"] == fit.selection.err.tolist()
        assert segment["scaling"]["slope"] == fit.scaling.slope.tolist()


def test_model(model_file: Path, document) -> None:
    shown = document("show", model_file)
    assert shown["output"] == {"name": "force", "unit": "N"}
    assert [quantity["name"] for quantity in shown["inputs"]] == ["pressure", "strain"]
    assert [segment["theta"] for segment in shown["segments"]] == [[-400.0], [-500.0]]
    assert shown["limits"]["pressure=200"]["strain"] == [0.0, 0.2]
    assert shown["weights"]["levels"] == [100.0, 200.0]
    assert shown["weights"]["extrapolation"]["strain"] == ["continue", "continue"]
    assert [equation["text"] for equation in shown["equations"]] == ["100 - 400*strain", "200 - 500*strain"]


def test_zones_lie_around_the_inner_boundaries(finished, document) -> None:
    _, runs = finished
    weights = document("show", runs / "bench/model.h5")["weights"]
    for curve in weights["curves"]:
        low, middle, high = curve["boundaries"]["strain"]
        quarter = weights["z_s"]
        assert curve["zones"]["strain"] == [pytest.approx([middle - quarter * (middle - low), middle + quarter * (high - middle)])]


def test_numbers_that_are_none_are_null(tmp_path: Path, finished, mapmore) -> None:
    _, runs = finished
    scores = json.loads((runs / "bench/scores.json").read_text())
    scores["scores"][0]["r2"] = None
    (tmp_path / "scores.json").write_text(json.dumps(scores))
    assert mapmore("show", tmp_path / "scores.json").exit_code == 0
    assert json.loads(mapmore("show", tmp_path / "scores.json", "--json").stdout) == scores


@pytest.mark.parametrize("content", [b"{}", b"[1]", b"not json", b"\xff"])
def test_json_that_is_none_of_ours(content: bytes, tmp_path: Path, mapmore) -> None:
    (tmp_path / "x.json").write_bytes(content)
    result = mapmore("show", tmp_path / "x.json")
    assert result.exit_code == 4
    assert "x.json" in result.stderr


def test_a_folder_that_is_no_run(tmp_path: Path, mapmore) -> None:
    result = mapmore("show", tmp_path)
    assert result.exit_code == 4
    assert "is not a run folder" in result.stderr


def test_load_model_is_a_function_of_keyword_arrays(model_file: Path) -> None:
    model = mapmore_cli.load_model(str(model_file))
    pressure, strain = np.array([[100.0], [160.0]]), np.array([0.0, 0.05, 0.1])
    expected = [[by_hand(p, e) for e in strain] for p in pressure[:, 0]]
    np.testing.assert_allclose(model(pressure=pressure, strain=strain), expected, rtol=1e-12)
    assert model.outside_range(pressure=[100, 100, 99], strain=[0.1, 0.11, 0.1]).tolist() == [False, True, True]
    assert float(model(pressure=150, strain=0.05)) == pytest.approx(127.5)
    assert [quantity.name for quantity in model.inputs] == ["pressure", "strain"]
    assert model.output.unit == "N"
    assert model.equations[0].text == "100 - 400*strain"


def test_load_model_agrees_with_the_run(finished, document) -> None:
    """Its equations and numbers are those that `show` prints."""
    _, runs = finished
    path = runs / "bench/model.h5"
    loaded = mapmore_cli.load_model(path)
    assert loaded.model.name == read_model(path).name == "bench"
    assert [equation.text for equation in loaded.equations] == [e["text"] for e in document("show", path)["equations"]]


@pytest.mark.parametrize("columns", [{}, {"pressure": 1}, {"pressure": 1, "strain": 0, "force": 2}])
def test_load_model_refuses_other_inputs(columns: dict[str, float], model_file: Path) -> None:
    with pytest.raises(TypeError, match="a function of pressure, strain"):
        mapmore_cli.load_model(model_file)(**columns)


def test_load_model_of_nothing(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        mapmore_cli.load_model(tmp_path / "model.h5")
