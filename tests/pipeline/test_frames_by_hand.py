"""Columns of tables in memory: which are meant, in which units, and what a fit says of them."""

from dataclasses import replace
from datetime import datetime
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from common import score_of

from mapmore_cli.api.fitted import Scores, Study
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.scores import ScoreTable
from mapmore_cli.pipeline import notebooks
from mapmore_cli.pipeline.frames import Door
from mapmore_cli.pipeline.notebooks import LoadedModel
from mapmore_cli.pipeline.records import Reading
from mapmore_cli.pipeline.tables_in_memory import (
    canonical_columns,
    column_of,
    columns_in,
    plain_values,
    quantities_of,
    section_of,
    tables_of,
    with_canonical_columns,
    write_tables,
)
from mapmore_cli.study.sections.logs import SourceColumn


@pytest.mark.parametrize(
    ("labels", "column", "meant"),
    [
        ("a b", "b", ["b"]),
        ("a b", "c", []),
        ("a b", 1, ["b"]),
        ("a b", 2, []),
        ("a b", -1, []),
        ((10, 1), 1, [1]),
        ((10, 1), 0, []),  # labels that are numbers are no places
        ((np.int64(1), np.int64(0)), 0, [0]),
        ((1, 0), "1", [1]),
        ((1, "1"), "1", ["1"]),
        ((1, 2.0), "2.0", [2.0]),
        ((1.5, "1.5"), "1.5", ["1.5"]),
    ],
)
def test_which_label_a_column_means(labels, column, meant):
    labels = labels.split() if isinstance(labels, str) else labels
    assert columns_in({label: [0.0] for label in labels}, column) == meant


def test_columns_with_names_of_quantities_need_no_entry():
    frame = {"force": [1.0], "strain_rate": [1.0], "tip x": [1.0], "colour": [1.0]}
    assert [*canonical_columns(frame, "static")] == ["force", "strain_rate"]
    assert [*canonical_columns(frame, "colour")] == ["force", "strain_rate", "colour"]
    with pytest.raises(SpecError, match="no column of the frame has the name of a quantity"):
        canonical_columns({"colour": [1.0]}, "static")
    other = {"force": [1.0], "P": [1.0]}
    assert with_canonical_columns([frame], {"x": "colour"}, ["strain_rate"]) == {
        "force": {"column": "force"},
        "x": "colour",
    }
    assert [*with_canonical_columns([frame, other], {"x": {"column": "P"}}, [])] == ["force", "x"]
    # a column that has another name already, and an entry of the same name, stay
    assert with_canonical_columns([frame], {"F": "force", "strain_rate": 3}, []) == {
        "F": "force",
        "strain_rate": 3,
    }


def test_columns_have_the_units_of_their_entries():
    frame = {"P": [1.0, 2.0], "force": [3.0, 4.0], "x": [5.0, 6.0]}
    columns = {
        "pressure": SourceColumn(column="P", unit="bar", scale=2.0, offset=0.5),
        "strain": SourceColumn(column=2, unit="%"),
        "force": SourceColumn(column="F", scale=7.0),
    }
    units = {"pressure": "kPa", "strain": "1", "force": "kN"}
    found = quantities_of(frame, ("pressure", "strain", "force"), columns, units)
    np.testing.assert_allclose(found["pressure"], [250, 450])
    np.testing.assert_allclose(found["strain"], [0.05, 0.06])
    np.testing.assert_allclose(found["force"], [3, 4])  # by its name, in the model's unit
    own = quantities_of({**frame, "strain": [0.5, 0.6]}, ("strain",), columns, units)
    np.testing.assert_allclose(own["strain"], [0.5, 0.6])
    with pytest.raises(DataError, match="the frame: there is no column 'time'"):
        quantities_of(frame, ("time",), columns, units)


def test_tables_are_recordings_in_memory():
    force = np.array([1.0, 2.0, 3.0])
    frames = [{"F": force, "t": ["00:00", "00:01", "02:30"]}, {"F": [4.0], "t": ["01:00"]}]
    columns = {"force": "F", "time": {"column": "t", "unit": "ms", "format": "%M:%S"}}
    first, second = tables_of(frames, columns, {}).values()
    np.testing.assert_array_equal(first.columns["force"], force)
    assert not first.columns["force"].flags.writeable
    assert force.flags.writeable
    time = first.columns["time"]
    np.testing.assert_allclose(time - time[0], [0, 1000, 150_000])
    columns["time"].pop("format")
    with pytest.raises(DataError, match="frame 1: column 't', row 0: '00:00' is not a number"):
        tables_of(frames, columns, {})
    assert (first.label, second.label) == ("frame 1", "frame 2")
    assert (len(first.rows), len(second.rows)) == (3, 1)
    assert first.titles == {"force": "'F'", "time": "'t'"}
    (alone,) = tables_of(frames[:1], {"force": "F"}, {}).values()
    assert alone.label == "the frame"
    uneven = {"a": [1.0], "b": [1.0, 2.0]}
    with pytest.raises(DataError, match=r"different length: \{'force': 1, 'strain': 2\}"):
        tables_of([uneven], {"force": "a", "strain": "b"}, {})
    with pytest.raises(DataError, match=r"has the shape \(1, 1\)"):
        column_of({"a": [[1.0]]}, "a", "the frame", "force", "N")


def test_the_section_of_tables_names_quantities_instead_of_columns(tmp_path):
    columns = {"force": "F", "time": {"column": "t", "unit": "ms", "format": "%S"}}
    assert section_of(["recording_1"], columns) == {
        "files": ["recording_1"],
        "reader": "hdf5",
        "columns": {"force": {"column": "force"}, "time": {"column": "time", "unit": "ms"}},
    }
    tables = tables_of([{"F": [1.0, 2.0], "t": [3.0, 4.0]}], {"force": "F", "time": "t"}, {})
    (path,) = write_tables(tables, tmp_path / "new" / "folder")
    assert path == tmp_path / "new" / "folder" / "recording_1.h5"
    with h5py.File(path) as file:
        assert {name: file[name][()].tolist() for name in file} == {
            "force": [1, 2],
            "time": [3, 4],
        }


def test_values_of_numpy_and_paths_become_those_of_yaml():
    given = {1: (np.float64(2.0), Path("a/b")), "x": {"y": np.arange(2)}, "z": [True, None, "t"]}
    made = plain_values(given)
    assert made == {"1": [2.0, "a/b"], "x": {"y": [0, 1]}, "z": [True, None, "t"]}
    assert type(made["1"][0]) is float


def test_pooled_rows_are_found_by_model_data_and_target():
    rows = (
        score_of(curve="p=1", rmse=1.0),
        score_of(rmse=2.0),
        score_of(split="train", rmse=3.0),
        score_of(model="cubic", rmse=4.0),
        score_of("z", rmse=5.0),
    )
    scores = Scores.of(ScoreTable(rows, {"y": "N", "z": "N"}))
    assert [
        scores.of_model(*asked)["rmse"]
        for asked in ((), ("mapmore", "train"), ("cubic",), ("mapmore", "validate", "z"))
    ] == [2, 3, 4, 5]
    with pytest.raises(KeyError, match="no row for the model plane on the validate data"):
        scores.of_model("plane")


def test_a_spec_of_a_fit_reads_its_tables_from_memory(tmp_path):
    document = {
        "name": "a",
        "target": "static",
        "dictionary": [{"terms": ["strain"]}],
        "data": {"columns": {"force": "F", "strain": "e"}},
    }
    frame = {"F": [1.0, 2.0], "e": [0.0, 0.1]}
    study = Study(document, (frame,), tmp_path, check=True, progress=None)
    loaded = study.loaded({"fit.max_terms": 3})
    assert (loaded.spec.fit.max_terms, [*loaded.tables]) == (3, ["recording_1"])
    text = study.written(tmp_path / "out" / "spec.yaml")
    assert "files: [spec_data/recording_1.h5]" in text
    assert (tmp_path / "out" / "spec_data" / "recording_1.h5").is_file()
    assert "max_terms: 3" not in text


class Echo(LoadedModel):
    """A model that returns the inputs with which it is called."""

    def __call__(self, **inputs):
        return {name: values.tolist() for name, values in inputs.items()}


@pytest.fixture
def echo():
    rate = SimpleNamespace(name="rate")
    quantities = {"inputs": (Quantity("u", "N"), Quantity("rate", "N/s"))}
    quantities["outputs"] = (Quantity("y", "N"), Quantity("z", "N"))
    return Echo(SimpleNamespace(signals=(rate,), of=lambda name: f"of {name}", **quantities))


def test_rates_are_columns_of_a_frame_without_a_clock(echo, monkeypatch):
    known = []

    def reading(_model, names):
        known.append({*names})
        return Reading(("u",), (), ("z",))

    monkeypatch.setattr(notebooks, "reading_of", reading)
    frame = {"u": [1.0, 2.0], "z": [3.0, 4.0]}
    assert echo.predict(frame) == {"u": [1, 2], "z": [3, 4]}
    assert echo.predict({**frame, "time": [0.0, 1.0]}) == {"u": [1, 2], "z": [3, 4]}
    scaled = {"u": {"column": "U", "unit": "kN", "scale": 2.0}}
    assert echo.predict({"U": [1.0], "z": [5.0]}, scaled) == {"u": [2000], "z": [5]}
    assert known == [{"u", "z", "rate"}, {"u", "z", "time"}, {"u", "U", "z", "rate"}]


def test_an_interval_holds_95_of_100_samples_unless_asked_otherwise(echo, monkeypatch):
    monkeypatch.setattr(notebooks, "interval", lambda _model, _flat, level: np.full((2, 1), level))
    monkeypatch.setattr(LoadedModel, "_flattened", lambda *_: (None, ()))
    assert [end.tolist() for end in echo.interval(u=1.0)] == [0.95, 0.95]
    assert [end.tolist() for end in echo.interval(0.5, u=1.0)] == [0.5, 0.5]


def test_dates_are_no_numbers_unless_a_clock_is_read():
    door = Door(lambda array, _unit: array)
    for date in (datetime(2026, 1, 1), np.array(["2026-01-01"], "datetime64[s]")):
        with pytest.raises(DataError):
            door.numbers(date, "p")
    assert replace(door, clock=True).numbers(datetime(1970, 1, 2), "time") == 86400


def test_one_of_several_outputs_is_named(echo):
    assert echo.of("z").model == "of z"
    with pytest.raises(TypeError, match="this model has the outputs y, z; got 'x'"):
        echo.of("x")


def test_files_of_an_export_are_written_into_a_folder(echo, tmp_path, monkeypatch):
    asked = []

    def export(model, to, warn, **options):
        asked.append((model, to, options))
        return {"m.c": b"int", "m.h": b"\x00"}

    monkeypatch.setattr(notebooks.plugins, "load", lambda *_: export)
    folder = tmp_path / "new" / "folder"
    assert echo.export("c", folder, single=True) == [folder / "m.c", folder / "m.h"]
    assert ((folder / "m.c").read_text(), (folder / "m.h").read_bytes()) == ("int", b"\x00")
    assert asked == [(echo.model, "c", {"single": True})]
