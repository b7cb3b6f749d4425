"""`mapmore show`, `load_model` and `example`: what is in the files, and a model in a notebook."""

import json

import matplotlib as mpl
import numpy as np
import pytest
from cli_samples import PROJECT, by_hand

import mapmore_cli
from mapmore_cli.storage.artefacts import read_fit

SEGMENT_KEYS = {"id", "terms", "theta", "g", "err", "scaling", "stop", "condition"}
HOSTILE = [
    *(
        '{"stages": 3}',
        '{"stages": {"fit": 3}}',
        '{"stages": {"fit": {"seconds": "x"}}}',
        '{"scores": [3]}',
    ),
    *('{"scores": [{"model": "x"}], "units": {}}', "[" * 100_000),
]
FILES = [
    "ingest.h5",
    "segment.h5",
    "fit.h5",
    "model.h5",
    "validate.h5",
    "scores.json",
    "run.json",
    ".",
]


@pytest.mark.parametrize("name", FILES)
def test_every_result_file_has_a_table_and_a_document(name, finished, document, mapmore):
    _, runs = finished
    assert isinstance(document("show", runs / "bench" / name), dict)
    shown = mapmore("show", runs / "bench" / name)
    assert (shown.exit_code, shown.stderr) == (0, "")
    assert "---" in shown.stdout


def test_fit(finished, document):
    _, runs = finished
    fits = read_fit(runs / "bench/fit.h5").segments
    shown = document("show", runs / "bench/fit.h5")["segments"]
    for segment, fit in zip(shown, fits, strict=True):
        assert set(segment) >= SEGMENT_KEYS
        assert (segment["id"], segment["terms"]) == (fit.id, [*fit.terms])
        assert segment["theta"] == fit.selection.theta.tolist()
        assert segment["err"] == fit.selection.err.tolist()
        assert segment["scaling"]["slope"] == fit.scaling.slope.tolist()


def test_model(model_file, document):
    shown = document("show", model_file)
    assert shown["output"] == {"name": "force", "unit": "N"}
    assert [quantity["name"] for quantity in shown["inputs"]] == ["pressure", "strain"]
    assert [segment["theta"] for segment in shown["segments"]] == [[-400.0], [-500.0]]
    assert shown["limits"]["pressure=200"]["strain"] == [0.0, 0.2]
    assert shown["weights"]["levels"] == [100.0, 200.0]
    assert shown["weights"]["extrapolation"]["strain"] == ["continue", "continue"]
    assert [equation["text"] for equation in shown["equations"]] == [
        "100 - 400*strain",
        "200 - 500*strain",
    ]


def test_numbers_that_are_none_are_null(tmp_path, finished, mapmore, document):
    _, runs = finished
    scores = json.loads((runs / "bench/scores.json").read_text())
    scores["scores"][0]["r2"] = None
    (tmp_path / "scores.json").write_text(json.dumps(scores))
    mapmore("show", tmp_path / "scores.json", code=0)
    assert document("show", tmp_path / "scores.json") == scores


@pytest.mark.parametrize(
    "content", [b"{}", b"[1]", b"not json", b"\xff", *(text.encode() for text in HOSTILE)]
)
def test_json_that_is_none_of_ours(content, tmp_path, mapmore):
    (tmp_path / "x.json").write_bytes(content)
    mapmore("show", tmp_path / "x.json", code=4, says="x.json")
    mapmore("show", tmp_path, code=4, says="is not a run folder")


def test_load_model_is_a_function_of_keyword_arrays(model_file):
    model = mapmore_cli.load_model(str(model_file))
    pressure, strain = np.array([[100.0], [160.0]]), np.array([0.0, 0.05, 0.1])
    expected = [[by_hand(p, e) for e in strain] for p in pressure[:, 0]]
    np.testing.assert_allclose(model(pressure=pressure, strain=strain), expected, rtol=1e-12)
    assert model.outside_range(pressure=[100, 100, 99], strain=[0.1, 0.11, 0.1]).tolist() == [
        False,
        True,
        True,
    ]
    assert float(model(pressure=150, strain=0.05)) == pytest.approx(127.5)
    assert [quantity.name for quantity in model.inputs] == ["pressure", "strain"]
    assert model.output.unit == "N"
    assert model.equations[0].text == "100 - 400*strain"


@pytest.mark.parametrize("columns", [{}, {"pressure": 1}, {"pressure": 1, "strain": 0, "force": 2}])
def test_load_model_refuses_other_inputs(columns, model_file):
    with pytest.raises(TypeError, match="a function of pressure, strain"):
        mapmore_cli.load_model(model_file)(**columns)


def test_the_example_is_the_static_study_that_is_shipped(begun):
    """The same recordings byte for byte, and so the same scores."""
    folder, (printed, _) = begun
    assert "Next: mapmore run muscle/study.yaml" in printed.stdout
    for copy in sorted((folder / "muscle").glob("*.csv")):
        assert copy.read_bytes() == (PROJECT / "datasets" / "peano" / copy.name).read_bytes()


@pytest.fixture
def run(begun):
    return begun[0] / "runs" / "muscle"


@pytest.fixture
def model(run):
    return mapmore_cli.load_model(run / "model.h5")


def test_a_notebook_shows_what_a_model_is(model, run):
    assert repr(model) == "<model muscle: force [N] of pressure [kPa], strain [1]>"
    assert model.units == {"pressure": "kPa", "strain": "1", "force": "N"}
    assert list(model.scores) == json.loads((run / "scores.json").read_text())["scores"]


def test_points_outside_of_the_training_range_are_told(model):
    assert np.isfinite(model(pressure=150.0, strain=[0.02, 0.05])).all()
    with pytest.warns(
        UserWarning, match=r"1 of 2 point\(s\) lie outside the training range of muscle"
    ):
        model(pressure=150.0, strain=[0.02, 0.9])


def test_a_model_draws_its_training_curves(model):
    mpl.use("Agg")
    ax = model.plot()
    assert [line.get_label() for line in ax.lines] == [
        "pressure=80",
        "pressure=200",
        "pressure=500",
    ]
    line = ax.lines[1]
    np.testing.assert_allclose(line.get_ydata(), model(pressure=200.0, strain=line.get_xdata()))
    assert ax.get_xlabel() == "Strain (–)"
    mpl.pyplot.close(ax.figure)
