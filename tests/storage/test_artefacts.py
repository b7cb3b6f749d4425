"""HDF5 artefacts: round trips, determinism, labels, and what is said about bad files."""

from __future__ import annotations

import json
import math
import re
import types
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar
from zipfile import ZipFile

import h5py
import numpy as np
import pytest
from annotated_types import Interval
from hypothesis import HealthCheck, given, settings
from stored_records import records, same

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import (
    FormulaFit,
    Scaling,
    Segment,
    SegmentedCurve,
    SegmentFit,
    Selection,
)
from mapmore_cli.domain.models import Body, CurveFunction, Fusion, Model, Pieces, SegmentFunction
from mapmore_cli.domain.recording import Curve, Dataset, Quantity, Recording
from mapmore_cli.domain.results import FitResult, PiecesFit, Validation
from mapmore_cli.storage import artefacts
from mapmore_cli.storage.artefacts.hdf5 import put_text
from mapmore_cli.storage.artefacts.reference import described
from mapmore_cli.storage.artefacts.schema import (
    SegmentationFile,
    _same,
    bodies,
    stored_fields,
    taken_apart,
)

KINDS = {
    "dataset": (artefacts.write_dataset, artefacts.read_dataset, records(Dataset)),
    "segmentation": (
        artefacts.write_segmentation,
        artefacts.read_segmentation,
        records(SegmentationFile).map(lambda file: file.curves),
    ),
    "fit": (artefacts.write_fit, artefacts.read_fit, records(FitResult)),
    "model": (artefacts.write_model, artefacts.read_model, records(Model)),
    "validation": (artefacts.write_validation, artefacts.read_validation, records(Validation)),
}
NUMBER = TypeVar("NUMBER", bound=np.generic)
QUIET = settings(
    max_examples=12,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@pytest.mark.parametrize("version", ["3.0", "3.1", "3.2"])
def test_files_of_older_formats_are_read(version, tmp_path):
    """They were written by the programs of their time."""
    with ZipFile(Path(__file__).parent / "archive" / f"{version}.zip") as archive:
        archive.extractall(tmp_path)
    told = []
    for kind, record in examples().items():
        path = tmp_path / f"{kind}.h5"
        with h5py.File(path) as file:
            assert file.attrs["format_version"] == version
        assert same(KINDS[kind][1](path, told.append), record)
    assert told == []


def test_a_column_of_a_recording_and_its_curve_is_stored_once(tmp_path):
    path, force = tmp_path / "ingest.h5", np.arange(4096.0)
    recording = Recording("r", "r.csv", {"force": force}, force.size, {})
    curve = Curve("r", None, {"force": force}, np.zeros(force.size, dtype=bool), ("r",))
    quantities = {"force": Quantity("force", "N")}
    dataset = Dataset("force", None, quantities, (recording,), (curve,))
    artefacts.write_dataset(path, dataset)
    with h5py.File(path) as file:
        assert file["recordings/000/columns/force"] == file["curves/000/columns/force"]
    assert same(artefacts.read_dataset(path), dataset)


def test_names_of_candidates_are_stored_once():
    assert "candidates" not in stored_fields(Selection)
    assert "candidates" in stored_fields(SegmentFit)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_is_read_back(kind, tmp_path):
    write, _, every = KINDS[kind]
    files = {one.name: one for one in artefacts.KINDS}

    @QUIET
    @given(every)
    def round_trip(record):
        path = tmp_path / "file.h5"
        write(path, record)
        whole = SegmentationFile(record) if kind == "segmentation" else record
        assert same(replace(files[kind], fault=lambda _model: None).read(path), whole)
        assert artefacts.kind_of(path) == kind
        first = path.read_bytes()
        write(path, record)
        assert path.read_bytes() == first

    round_trip()


def examples():
    """One small but complete record of every kind."""
    scaling = Scaling(
        "unit_square", "left", ("strain",), np.array([4.0]), np.array([-0.1]), 735.0, 12.0
    )
    missing = np.array([[0.2, 0.3, 0.9], [0.1, np.nan, np.nan]])
    selection = Selection(
        chosen=np.array([2, 0]),
        g=np.array([0.9, 0.1]),
        err=np.array([0.75, 0.125]),
        theta=np.array([0.95, 0.1]),
        theta_error=np.array([0.01, np.nan]),
        a=np.array([[1.0, 0.5], [0.0, 1.0]]),
        g_all=missing,
        err_all=missing.copy(),
        runner_up=np.array([0, -1]),
        tied=np.array([0, 0]),
        condition=12.5,
        sse=0.125,
        yy=1.0,
        samples=40,
        stop="max_terms",
    )
    parameters = {"a1": 1.5, "a2": 2.5, "a3": -30.0, "a4": 0.5, "a5": 0.1, "a6": 0.2}
    formula = FormulaFit(
        "sarosi",
        parameters,
        {"a1": 0.1, "a3": np.nan},
        "converged",
        "variable projection",
        4,
        81.0,
        3.5,
        80,
    )
    pressure, strain, force = (
        Quantity("pressure", "kPa"),
        Quantity("strain", "1"),
        Quantity("force", "N"),
    )
    x = np.linspace(0, 0.2, 5)
    columns = {"strain": x, "force": 700 - 3000 * x, "pressure": np.full(5, 250.0)}
    id_, held = "pressure=250/strain:1", np.array([False, False, True, False, True])
    boundaries, limits = (np.array([0.0, 0.2]),), {"strain": (0.0, 0.2), "pressure": (250.0, 250.0)}
    numbers = (selection.theta, selection.theta_error, selection.g, selection.err)
    function = SegmentFunction(
        *numbers, 40, 12.5, "max_terms", id_, (1,), ("strain^2", "1"), scaling
    )
    fusion = Fusion(
        extrapolation={"strain": ("continue", 0.0), "pressure": ("saturate", "saturate")}
    )
    pieces = Pieces(
        "pressure",
        ("strain",),
        (CurveFunction("pressure=250", 250.0, limits, boundaries, (function,)),),
        fusion,
        formula,
    )
    segment = Segment(id_, "pressure=250", (1,), np.arange(3))
    return {
        "dataset": Dataset(
            "force",
            "pressure",
            {"strain": strain, "force": force, "pressure": pressure},
            (Recording("cycle", "data/cycle.csv", columns, 6, {"missing": 1}),),
            (Curve("pressure=250", 250.0, columns, held, ("cycle",)),),
        ),
        "segmentation": (
            SegmentedCurve("pressure=250", 250.0, limits, boundaries, ("strain",), (segment,)),
        ),
        "fit": FitResult(
            PiecesFit(
                (
                    SegmentFit(
                        id_, "pressure=250", (1,), ("1", "strain", "strain^2"), scaling, selection
                    ),
                )
            ),
            formula,
        ),
        "model": Model("demo", force, (pressure, strain), pieces),
        "validation": Validation(
            {"mapmore": (x,), "m2/x": (x,)}, {"sarosi": formula}, (), {"force": "N"}
        ),
    }


@pytest.fixture
def written(tmp_path):
    """A file of every kind."""
    paths = {kind: tmp_path / f"{kind}.h5" for kind in KINDS}
    for kind, record in examples().items():
        KINDS[kind][0](paths[kind], record)
    return paths


def test_equality_of_records_sees_a_difference():
    fit, other = examples()["fit"], examples()["fit"]
    assert same(fit, other)
    other.segments[0].selection.err_all[1, 0] = np.nan
    assert not same(fit, other)


def arrays_of(path):
    names = []
    with h5py.File(path) as file:
        file.visit(names.append)
        arrays = {name: file[name].attrs for name in names if isinstance(file[name], h5py.Dataset)}
        return {
            name: (attributes["unit"], attributes["description"])
            for name, attributes in arrays.items()
        }


def test_every_array_says_its_unit_and_what_it_is(written):
    for path in written.values():
        for unit, description in arrays_of(path).values():
            assert unit
            assert " " in description


UNITS = [
    ("dataset", "curves/all/columns/pressure", "kPa"),
    ("dataset", "recordings/all/columns/force", "N"),
    ("model", "body/curves/all/boundaries/all", "1"),
    ("model", "document", "-"),
    ("model", "body/curves/all/segments/all/scaling/slope", "1/1"),
    ("validation", "predictions/mapmore/all", "N"),
]


def test_units_are_those_of_the_quantities(written):
    assert [(kind, place, arrays_of(written[kind])[place][0]) for kind, place, _ in UNITS] == UNITS


def test_segmentation_holds_rows_and_no_samples(tmp_path):
    curve = replace(
        examples()["segmentation"][0], segments=(Segment("s", "c", (1,), np.arange(20_000)),)
    )
    artefacts.write_segmentation(tmp_path / "s.h5", (curve,))
    with h5py.File(tmp_path / "s.h5") as file:
        rows = file["curves/000/segments/000/rows"]
        assert rows.dtype == np.int64
        assert rows.compression == "gzip"
        assert file["curves/all/boundaries/all"].compression is None


@pytest.mark.parametrize(
    ("size", "packed"), [(4095, None), (4096, "gzip"), (131_071, "gzip"), (131_072, None)]
)
def test_arrays_of_middle_length_are_compressed(size, packed, tmp_path):
    curve = replace(
        examples()["segmentation"][0], segments=(Segment("s", "c", (1,), 2 * np.arange(size)),)
    )
    artefacts.write_segmentation(tmp_path / "s.h5", (curve,))
    with h5py.File(tmp_path / "s.h5") as file:
        found = []
        file.visititems(lambda name, node: found.append(node) if "rows" in name else None)
        assert [(node.compression, node.shuffle) for node in found] == [(packed, bool(packed))]
    assert same(artefacts.read_segmentation(tmp_path / "s.h5"), (curve,))


def test_model_carries_long_provenance(tmp_path):
    spec = "fit: {max_terms: 1}\n" * 10_000  # more than an attribute can hold
    artefacts.write_model(tmp_path / "m.h5", examples()["model"], {"experiment.yaml": spec})
    with h5py.File(tmp_path / "m.h5") as file:
        assert file["provenance/experiment.yaml"].asstr()[()] == spec
    assert same(artefacts.read_model(tmp_path / "m.h5"), examples()["model"])


@pytest.mark.parametrize("kind", KINDS)
def test_truncated_file_is_named(kind, written):
    path = written[kind]
    whole = path.read_bytes()
    for size in {0, 1, 7, 100, *range(0, len(whole), max(1, len(whole) // 25))}:
        path.write_bytes(whole[:size])
        with pytest.raises(DataError, match=path.name) as caught:
            KINDS[kind][1](path)
        assert caught.value.remedy


def changed(path, change):
    with h5py.File(path, "r+") as file:
        change(file)
    return path


def put(place, value=None, **stored):
    """Stores a value at a place of the document, or a dataset; nothing where neither is given."""

    def change(file):
        if isinstance(file.get(place), h5py.Dataset):
            del file[place]
            if stored or value is not None:
                file.create_dataset(place, **(stored or {"data": value}))
            return
        document = json.loads(file["document"].asstr()[()])
        *way, last = [int(step) if step.isdigit() else step for step in place.split("/")]
        holder = document
        for step in way:
            holder = holder[step]
        if value is None:
            del holder[last]
        else:
            holder[last] = value
        write_document(file, json.dumps(document))

    return change


def write_document(file, text):
    del file["document"]
    put_text(file, "document", text, "changed")


@pytest.mark.parametrize(
    "text",
    [
        *(
            "",
            "{",
            "[]",
            "null",
            "[" * 100_000,
            '{"curves": ' + "1" * 5000 + "}",
            '{"curves": NaN}',
            '{"curves": -Infinity}',
        ),
        *(
            '{"curves": [], "curves": []}',
            '{"curves": [], "a": {"b": 1, "b": 2}}',
            '{"curves": 1e999}',
            "\ufeff{}",
        ),
    ],
)
def test_documents_that_are_no_plain_json_are_refused(text, written):
    with pytest.raises(DataError, match="is not a valid segmentation"):
        artefacts.read_segmentation(
            changed(written["segmentation"], lambda file: write_document(file, text))
        )


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no such file"),
        ("folder", "is a folder"),
        ("strain,force\n0,1\n", "x.h5: cannot be read"),
        ({"kind": "something else"}, "not one of mapmore's"),
    ],
)
def test_other_files_are_refused(tmp_path, content, words):
    path = tmp_path / "x.h5"
    if content == "folder":
        path.mkdir()
    elif isinstance(content, str):
        path.write_text(content)
    elif content:
        with h5py.File(path, "w") as file:
            file.attrs.update(content)
    for read in (artefacts.read_model, artefacts.kind_of):
        with pytest.raises(DataError, match=words):
            read(path)


def test_another_kind_is_named(written):
    with pytest.raises(DataError, match="is a fit file, not a model file"):
        artefacts.read_model(written["fit"])


@pytest.mark.parametrize(
    ("version", "readable"),
    [("3.9", True), *((other, False) for other in ("2.1", "1.2", "4.0", "10.0", "one"))],
)
def test_format_versions(version, readable, written):
    changed(written["model"], lambda file: file.attrs.__setitem__("format_version", version))
    if readable:
        assert same(artefacts.read_model(written["model"]), examples()["model"])
    else:
        with pytest.raises(DataError, match=version) as caught:
            artefacts.read_model(written["model"])
        assert caught.value.remedy


@pytest.mark.parametrize("name", ["a\0b", "mess\udce9", "a\nb", "a\x1b[2J", "a\u2028b"])
def test_names_that_are_no_text_are_refused(name, tmp_path):
    with pytest.raises(DataError, match="cannot be stored: it is not one line of valid text"):
        artefacts.write_dataset(tmp_path / "x.h5", replace(examples()["dataset"], notes=(name,)))
    assert not list(tmp_path.iterdir())


# A stored dataclass needs no layout of its own: what its fields are says how they lie in a file
# ------------------------------------------


@dataclass(frozen=True)
class Spring:
    """A body of another kind."""

    stiffness: Annotated[float, Interval(ge=0), "force over displacement"]
    shape: Literal["straight", "coiled"]
    ends: tuple[Quantity, ...]
    names: tuple[str, ...]
    course: Array
    limits: Mapping[str, tuple[float, float]]
    sizes: Mapping[str, float] = field(default_factory=dict)
    preload: float | None = None
    turns: int = 1


def stored(tmp_path, record):
    """What comes back of a record from a file."""
    kind = artefacts.FileKind("model", "test", type(record))
    kind.write(tmp_path / "record.h5", record)
    return kind.read(tmp_path / "record.h5")


def test_every_form_comes_back_and_what_is_not_stored_has_its_default(tmp_path):
    limits, course = {"force": (0.0, 1.0)}, np.array([1.0, 2.0])
    spring = Spring(
        2.0, "coiled", (Quantity("force", "N"),), ("a", "b"), course, limits, {"pitch": 0.5}, 0.1, 7
    )
    assert same(stored(tmp_path, spring), spring)
    plain = replace(spring, sizes={}, turns=1, preload=math.nan)
    assert same(stored(tmp_path, plain), plain)
    with h5py.File(tmp_path / "record.h5") as file:
        assert {"sizes", "turns"}.isdisjoint(json.loads(file["document"].asstr()[()]))


def test_a_value_is_its_default_if_both_are_equal_or_both_are_nan():
    pairs = [(1.0, 1.0), (math.nan, math.nan), (1.0, math.nan), (math.nan, 1.0), (1.0, 2.0)]
    assert [_same(*pair) for pair in pairs] == [True, True, False, False, False]


@dataclass
class Alias:
    """As NumPy 2.5 has `NDArray`: `type NDArray[T] = ndarray[Any, dtype[T]]`, which Python 3.11
    cannot say.
    """

    __value__: Any

    def __hash__(self):
        return id(self)


def test_aliases_of_types_are_looked_through():
    of_numbers = Alias(np.ndarray[Any, np.dtype[NUMBER]])
    hint = types.GenericAlias(of_numbers, (np.float64,))
    assert taken_apart(Annotated[hint, "(k) values"])[:2] == (np.ndarray, (np.float64,))
    assert taken_apart(Alias(float)).kind is float


def test_the_pages_of_the_format_follow_the_declarations():
    page = (Path(__file__).parents[2] / "docs" / "file-format.md").read_text(encoding="utf-8")
    assert described() in page
    headings = set(re.findall(r"^### (\w+)$", described(), re.MULTILINE))
    assert set(re.findall(r"\]\(#(\w+)\)", described())) <= {
        heading.lower() for heading in headings
    }
    assert {body.__name__ for body in bodies(Body).values()} <= headings
    assert f"format {artefacts.FORMAT_VERSION}" in page
    for kind in artefacts.KINDS:
        assert f"kind `{kind.name}`" in page
        assert f"`{kind.type.__name__}`" in page
        assert kind.type.__name__ in headings


def test_a_fault_of_a_file_is_named_in_few_words(written):
    """A damaged file may hold a name of any length."""
    path = changed(written["dataset"], put("recordings/0/dropped/" + "x" * 5000, "many"))
    with pytest.raises(
        DataError, match=r"is not a valid dataset: recordings/0*/dropped/x+"
    ) as caught:
        artefacts.read_dataset(path)
    assert len(str(caught.value)) < len(str(path)) + 400


def test_a_folder_in_place_of_a_model_names_the_file_that_is_meant(tmp_path):
    with pytest.raises(DataError, match="is a folder") as caught:
        artefacts.read_model(tmp_path)
    assert "runs/NAME/model.h5" in caught.value.remedy
