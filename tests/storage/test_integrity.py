"""Files from strangers: what may be read, what is refused before any value is read, and whether
values are those that were written.
"""

import os
import random
import tracemalloc
from contextlib import nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from threading import Thread
from typing import Any

import h5py
import numpy as np
import pytest
from stored_records import same
from test_artefacts import KINDS, changed, examples, put
from used_files import use

import mapmore_cli
from mapmore_cli.annexes.motion.body import Motion, MotionSection, StateSpace
from mapmore_cli.annexes.sums import Part, Sum
from mapmore_cli.cli.views import of_stage
from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.domain.fits import MemoryModel, StateSet
from mapmore_cli.domain.models import Memory
from mapmore_cli.domain.recording import Signal
from mapmore_cli.domain.results import PiecesFit
from mapmore_cli.storage import artefacts
from mapmore_cli.storage.artefacts import hdf5
from mapmore_cli.storage.artefacts.decoding import Decoder, _compare_lengths
from mapmore_cli.storage.run_record import refuse_newer

CURVE = "body/curves/000"
SEGMENT = f"{CURVE}/segments/000"
THETA = "body/curves/all/segments/all/theta"


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "model.h5"
    artefacts.write_model(path, examples()["model"])
    return path


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            put(f"{SEGMENT}/theta/shape", [1]),
            "theta_error, has 2 values, but other arrays with the dimension (k) have 1",
        ),
        (put(THETA, [[1.0, 2.0]]), "theta, is not an array of 1 dimensions of float64"),
        (put(f"{SEGMENT}/theta/from", 1), "theta, lies beyond the end of "),
        (put(f"{SEGMENT}/theta/from", -1), "theta, is not a reference to its array"),
        (put(f"{SEGMENT}/theta/array", "document"), "theta, is not a reference to its array"),
        (put("document", data=np.zeros(3)), "document, is not a text of at most 32 MB"),
        (put(THETA, [np.nan, 1.0]), "theta, is not finite"),
        (put("body/curves/all/boundaries/all", [0.2, 0.1]), "boundaries/000, does not ascend"),
        (put(f"{CURVE}/limits/strain", [0.2, 0.1]), "limits/strain, does not ascend"),
        (put(f"{SEGMENT}/samples", -1), "samples, is negative"),
        (put(f"{SEGMENT}/stop", "\x1b[31m"), "stop, has control characters or line breaks"),
        (put("name", 'a\n"""'), "name, has control characters or line breaks"),
        (put("output/unit", "N*\\\n/"), "unit, has control characters or line breaks"),
        (put(f"{SEGMENT}/terms", ["strain", "__import__('os')"]), "terms/001, is not a valid term"),
        (put("notes", ["fine", "a\u2028b"]), "notes/001, has control characters or line breaks"),
        (put("body/kind", "oracle"), "of the kind 'oracle'"),
        (put("body/fusion/extrapolation/strain", ["guess", 0.0]), "is not one of continue"),
        (put("body/fusion/transition", "quartic"), "transition, is not one of linear"),
        (put("body/fusion/z_s", 0.75), "z_s, is not between 0 and 0.5"),
        (put("body/backbone/status", "fine"), "status, is not one of converged"),
        (put(THETA), "theta, is not an array"),
        (put(f"{SEGMENT}/id", 3), "id, is not of the type str"),
        (put(f"{SEGMENT}/id"), "id, is missing"),
        (put(f"{SEGMENT}/samples", True), "samples, is not of the type int"),
        (put(f"{SEGMENT}/scaling", 1.0), "scaling, is not of the type Scaling"),
        (put("colour", "red"), "colour, is not known in this format"),
        (put(THETA, data=np.array([4.0], "<f4")), "theta, is not an array"),
    ],
)
def test_forms_that_cannot_be_are_named(change, words, model):
    with pytest.raises(DataError, match="is not a valid model: ") as caught:
        artefacts.read_model(changed(model, change))
    assert words in caught.value.message
    assert "delete" not in str(caught.value)


def test_a_known_checksum_is_computed_again_only_on_demand(model, monkeypatch):
    real = artefacts.checksum_of(model, True)
    monkeypatch.setitem(artefacts._as_written, artefacts._mark(model), "known")
    assert [artefacts.checksum_of(model, anew) for anew in (False, True)] == ["known", real]


def test_columns_of_a_curve_have_one_length(tmp_path):
    artefacts.write_dataset(tmp_path / "x.h5", examples()["dataset"])
    path = changed(tmp_path / "x.h5", put("curves/0/columns/force/shape", [4]))
    with pytest.raises(DataError, match="columns/force, has 4 values, but other arrays with the"):
        artefacts.read_dataset(path)


@pytest.mark.parametrize(
    ("length", "letter", "fits"),
    [
        *((2, "k", True), (3, "k", False), (0, "k", False)),
        *((2, "k or 0", True), (3, "k or 0", False), (0, "k or 0", True)),
    ],
)
def test_arrays_with_the_same_letter_have_one_length_or_are_empty(length, letter, fits):
    with nullcontext() if fits else pytest.raises(hdf5.Invalid, match=r"dimension \(k\) have 2"):
        _compare_lengths("x", (length,), (letter,), {"k": 2})


def parts_that_do_not_fit():
    """Records that the writer takes, and that no stage makes."""
    model, (curve,), fit = examples()["model"], examples()["segmentation"], examples()["fit"]
    pieces, (function,) = model.body, model.body.curves
    (cell,) = function.segments

    def with_terms(*terms):
        return replace(function, segments=(replace(cell, terms=terms),))

    ends = {"strain": ("saturate",), "pressure": ("guess", 0.0)}
    higher = replace(function, level=300.0)
    bodies = [
        replace(pieces, **own)
        for own in (
            {"fusion": replace(pieces.fusion, extrapolation={"strain": ("continue", 0.0)})},
            {"fusion": replace(pieces.fusion, extrapolation=ends)},
            {"level": ""},
            {"level": None},
            {"variables": ("pressure",)},
            {"curves": pieces.curves * 2},
            {
                "curves": (
                    function,
                    replace(higher, limits={**function.limits, "speed": (0.0, 1.0)}),
                )
            },
            {"curves": (function, replace(higher, segments=()))},
            {"curves": (replace(function, boundaries=(np.array([0.2, 0.1]),)),)},
            {"curves": (replace(function, boundaries=(np.array([0.0]),)),)},
            {"curves": (with_terms("1", "import(os)"),)},
            {"curves": (with_terms("1", "velocity"),)},
            {"backbone": replace(fit.backbone, name="nobody")},
            {"backbone": replace(fit.backbone, parameters={"a1": 1.0})},
        )
    ]
    bodies += [Sum(()), Sum((Part(model, 1.0, {"time": "strain"}),))]
    memory = MemoryModel("force", NO_STATES, ("1",), np.ones(1), np.ones(1), 0.0, (0.0, 1.0))
    strange = (
        ("pressure", "speed[k-1]"),
        ("pressure", "pressure"),
        ("play(pressure, 0.1)",),
        ("slow(resonance(strain)[k-1], 0.1)",),
    )
    bodies += [
        Memory(replace(memory, states=replace(NO_STATES, names=names)), (), None)
        for names in strange
    ]
    bodies.append(Memory(replace(memory, output="strain"), (), None))
    section = MotionSection("1", 1, "all", 0.1, 0.1, np.ones(1))
    motion = Motion(
        "pressure", "force", 0.1, "hard", (), False, 0.0, ("pressure",), (section,), (0.0, 1.0)
    )
    others = [
        {"output": "strain"},
        {"input": "speed", "drives": ("speed",)},
        {"input": "strain"},
        {"boundaries": (0.5,)},
    ]
    bodies += [StateSpace(replace(motion, **other), ()) for other in others]
    yield from (("model", replace(model, body=body)) for body in bodies)
    for name in ("time", "speed"):
        yield "model", replace(model, signals=(Signal(name, "rate", "strain", 0.1, 2, 1.0, 1.0),))
    yield "model", replace(model, inputs=model.inputs[:1], body=Sum((Part(model, 1.0, {}),)))
    yield "model", replace(model, inputs=model.inputs * 2)
    (segment,) = curve.segments
    for cell in ((2,), ()):
        yield "segmentation", (replace(curve, segments=(replace(segment, cell=cell),)),)
    (piece,) = fit.body.segments
    yield (
        "fit",
        replace(
            fit,
            body=PiecesFit(
                (replace(piece, selection=replace(piece.selection, chosen=np.array([0, 0]))),)
            ),
        ),
    )


NO_STATES = StateSet(("pressure",), 0.1, {}, {}, np.zeros(0), np.zeros(0), 0.0)


@pytest.mark.parametrize(("kind", "record"), [*parts_that_do_not_fit()])
@pytest.mark.filterwarnings("ignore")
def test_parts_that_do_not_fit_together_are_no_fault_of_the_program(kind, record, tmp_path):
    """Found by structure-aware fuzzing: `predict` and `show` ended as internal faults. No checksum
    vouches for such a file.
    """
    path = tmp_path / "file.h5"
    KINDS[kind][0](path, record)
    with suppress(MapmoreError):
        use(path, random.Random(1))


def test_ten_sums_within_each_other_are_read_and_sixteen_are_not(model):
    whole = examples()["model"]
    for depth in range(1, 17):
        whole = replace(whole, body=Sum((Part(whole, 1.0, {}),)))
        if depth in (10, 16):
            artefacts.write_model(model, whole)
            with nullcontext() if depth == 10 else pytest.raises(DataError, match="more than 60"):
                assert same(artefacts.read_model(model), whole)


def test_a_file_can_be_written_by_any_thread(model):
    model.unlink()
    thread = Thread(target=artefacts.write_model, args=(model, examples()["model"]))
    thread.start()
    thread.join()
    assert same(artefacts.read_model(model), examples()["model"])


@pytest.mark.parametrize("value", [np.zeros(3), h5py.Empty("f8"), 1.5, b"\xff\xfe"])
@pytest.mark.parametrize(
    ("attribute", "words"),
    [("kind", "not one of mapmore's"), ("checksum", "the checksum does not match")],
)
def test_attributes_of_the_root_that_are_no_text(attribute, words, value, model):
    with pytest.raises(DataError, match=words):
        artefacts.read_model(changed(model, lambda file: file.attrs.__setitem__(attribute, value)))


def _virtual_dataset(file):
    del file[THETA]
    layout = h5py.VirtualLayout((2,), "<f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (2,))
    file.create_virtual_dataset(THETA, layout)


def _external_link(file):
    del file["body"]
    file["body"] = h5py.ExternalLink("other.h5", "body")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            put(THETA, shape=(2,), dtype="<f8", external=[("secret", 0, 16)]),
            "takes its values from other files",
        ),
        (_virtual_dataset, "takes its values from other files"),
        (_external_link, "body, is a link to another place"),
        (
            lambda file: file.__setitem__("body/again", h5py.SoftLink("/body")),
            "again, is a link to another place",
        ),
        (lambda file: file.__setitem__("body/again", file["body"]), "is linked too many times"),
        (put(THETA, data=np.zeros(2), compression="lzf"), "a filter other than gzip"),
        (
            put(THETA, shape=(10**9,), dtype="<f8", chunks=(1000,), compression="gzip"),
            "MB of values",
        ),
        (
            lambda file: file.__setitem__(
                "too", np.array([file["document"].ref], dtype=h5py.ref_dtype)
            ),
            "holds neither numbers nor texts",
        ),
        (put(THETA, data=h5py.Empty("f8")), "has no values"),
        (lambda file: file.__setitem__("type", np.dtype("f8")), "neither a group nor a dataset"),
        (
            put("document", data="x" * 10, dtype=h5py.string_dtype()),
            "nor texts of a declared length",
        ),
        (
            lambda file: file["body"].attrs.create(
                "more", ["x" * 99] * 99, dtype=h5py.string_dtype()
            ),
            "has the attribute 'more'",
        ),
    ],
)
def test_what_the_format_does_not_know_is_refused_before_it_is_read(
    change, words, model, monkeypatch
):
    changed(model, change)

    def read(*_):
        raise AssertionError("a value was read")

    monkeypatch.setattr(artefacts, "take_document", read)
    with pytest.raises(DataError, match="is not a valid model: ") as caught:
        artefacts.read_model(model)
    assert words in caught.value.message


@pytest.mark.parametrize("beyond", [0, 1])
@pytest.mark.parametrize(
    ("words", "change"),
    [
        ("attributes", lambda file, n: [file.attrs.create(f"a{i}", 1) for i in range(100 + n)]),
        ("the attribute 'a'", lambda file, n: file.attrs.create("a", np.zeros(512 + n))),
        ("groups deep", lambda file, n: file.create_group("/".join(["a"] * (61 + n)))),
        ("MB of values", lambda file, n: file.create_dataset("a", data=np.zeros(1000 + n))),
        (
            "chunks of more than",
            lambda file, n: file.create_dataset(
                "a", (1,), "f8", maxshape=(None,), chunks=(1000 + n,)
            ),
        ),
    ],
)
def test_a_file_may_be_as_large_as_a_limit_says_and_not_larger(words, change, beyond, monkeypatch):
    monkeypatch.setattr(hdf5, "ROOM", 8000)
    with h5py.File("a", "w", driver="core", backing_store=False) as file:
        change(file, beyond)
        with pytest.raises(hdf5.Invalid, match=words) if beyond else nullcontext():
            hdf5.look_over(file, 10, 0)


def test_texts_and_paths_may_be_as_long_as_a_limit_says(monkeypatch):
    monkeypatch.setattr(hdf5, "DOCUMENT", 2)
    with h5py.File("a", "w", driver="core", backing_store=False) as file:
        for length, word in ((4096, "x" * 4096), (4097, None)):
            file.attrs["kind"] = np.bytes_("x" * length)
            assert hdf5.root_text(file, "kind") == word
        hdf5.put_text(file, "document", "{}", "")
        assert hdf5.take_document(file) == ("{}", {})
        del file["document"]
        hdf5.put_text(file, "document", "{} ", "")
        with pytest.raises(hdf5.Invalid, match="is not a text of at most"):
            hdf5.take_document(file)
    decoder, deepest = Decoder(None, False), "/" * 60
    assert decoder.value("x", str, deepest, (), {}) == "x"
    with pytest.raises(hdf5.Invalid, match="more than 60 fields deep"):
        decoder.value("x", str, f"{deepest}/", (), {})


def test_an_array_of_a_file_is_not_copied():
    """A long array is a part of the file that is mapped into memory."""
    values = np.zeros(3)
    decoder = Decoder(lambda *_: values, False)
    found = decoder.value({"array": "x"}, np.ndarray[Any, np.dtype[np.float64]], "x", ("n",), {})
    assert np.shares_memory(found, values)


def test_attributes_that_refer_to_one_text_many_times_are_not_read(model):
    """A text of a megabyte that `kind` refers to 4000 times took 8 GB before anything was looked
    over.
    """
    text = np.array(["x" * 100_000] * 200, dtype=object)
    changed(model, lambda file: file.attrs.create("kind", text, dtype=h5py.string_dtype()))
    for read in (artefacts.read_model, artefacts.kind_of):
        tracemalloc.start()
        with pytest.raises(DataError, match="not one of mapmore's"):
            read(model)
        assert tracemalloc.get_traced_memory()[1] < 5_000_000
        tracemalloc.stop()


def test_special_files_are_not_opened(tmp_path):
    os.mkfifo(tmp_path / "model.h5")
    for read in (artefacts.read_model, artefacts.kind_of):
        with pytest.raises(DataError, match="special file"):
            read(tmp_path / "model.h5")


@pytest.mark.parametrize("kind", KINDS)
def test_a_changed_value_is_found_by_the_checksum(kind, tmp_path):
    path = tmp_path / "file.h5"
    write, read, _ = KINDS[kind]
    write(path, examples()[kind])
    changes = {
        "dataset": ("level", "force"),
        "segmentation": ("curves/000/variables", ["force"]),
        "fit": ("notes", ["other"]),
    }
    changed(path, put(*changes.get(kind, ("notes" if kind == "model" else "warnings", ["other"]))))
    with pytest.raises(DataError, match="the checksum does not match") as caught:
        read(path)
    assert "--unverified" in str(caught.value)
    told = []
    read(path, told.append, True)
    assert "checksum does not match" in told[0]


def test_a_changed_file_of_a_stage_is_not_shown(model):
    changed(model, put("notes", ["other"]))
    with pytest.raises(DataError, match="the checksum does not match"):
        of_stage("fuse", model.parent)


def test_a_file_without_a_checksum_is_told(model):
    told = []
    read = artefacts.read_model(
        changed(model, lambda file: file.attrs.__delitem__("checksum")), told.append
    )
    assert same(read, examples()["model"])
    assert ["has no checksum" in message for message in told] == [True]
    with pytest.warns(UserWarning, match="has no checksum"):
        mapmore_cli.load_model(model)


def test_a_file_of_a_newer_minor_version_cannot_be_verified(model):
    major, minor = artefacts.FORMAT_VERSION.split(".")

    def newer(file):
        file.attrs["format_version"] = f"{major}.{int(minor) + 1}"
        put("body/colour", "red")(file)

    told = []
    artefacts.read_model(changed(model, newer), told.append)
    assert "cannot be verified" in told[0]


def test_a_fault_of_the_program_is_not_blamed_on_the_file(model, monkeypatch):
    def faulty(*_):
        raise TypeError("a slip of ours")

    monkeypatch.setattr(artefacts, "add_to_hash", faulty)
    with pytest.raises(TypeError, match="a slip of ours"):
        artefacts.read_model(model)


@pytest.mark.parametrize("found", ["x" * 5000, "9" * 2000, "9" * 5000 + ".1"])
def test_a_version_of_any_length_is_refused_in_a_line(found):
    with pytest.raises(DataError) as refused:
        refuse_newer(Path("run.h5"), found, "3.3")
    assert "run.h5" in str(refused.value)
    assert len(str(refused.value)) < 300
