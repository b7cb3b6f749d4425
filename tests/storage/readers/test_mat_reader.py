"""MAT files: those that MATLAB wrote come with SciPy; the others are SciPy's, and HDF5 laid out as
MATLAB 7.3 does.
"""

import math
import re
import subprocess
import zlib
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from common import NO_OCTAVE, OCTAVE, peak_memory
from reading import element, opaque_mat, refusal, tables_of, timetable_of_73
from scipy import sparse

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import READERS, hdf5, mat
from mapmore_cli.storage.tables.matlab_objects import REMEDIES, object_of_matlab

# SciPy 1.18 says so of `loadmat`, which is the oracle here
pytestmark = pytest.mark.filterwarnings(
    "ignore:The default value for `spmatrix`:DeprecationWarning"
)

BY_MATLAB = Path(scipy.io.__file__).parent / "matlab" / "tests" / "data"
T = np.arange(5.0)
Y = np.column_stack([T, 2 * T, 3 * T]).astype(np.int16)
CUBE = np.arange(30.0).reshape(5, 2, 3)


read = partial(tables_of, "mat")


def values(path, column, **request):
    (table,) = read(path, column, **request)
    return list(table.columns[column])


def write_v5(path, **options):
    """Everything that the tests address, as SciPy writes it."""
    train = np.empty(3, dtype=object)
    train[:] = [{"y": np.column_stack([T + i, 10 * T]), "t": T[: 5 - i]} for i in range(3)]
    runs = np.zeros(2, dtype=[("P", object), ("inner", object)])
    for i in range(2):
        runs[i] = (100 * i + T, {"eps": T / 10})
    run = {"P": T, "sensor": {"F": -T[:, None]}, "note": "hello"}
    content = {
        "run": run,
        "y": Y,
        "train": train,
        "runs": runs,
        "z": T + 1j,
        "flags": T > 2,
        "nothing": np.zeros((0, 0)),
        "cube": CUBE,
    }
    scipy.io.savemat(path, content, **options)
    return path


def write_v73(path):
    """The same as MATLAB 7.3 lays it out: axes in the opposite order, cells and elements of struct
    arrays as references.
    """
    with h5py.File(path, "w", userblock_size=512) as file:
        kinds = {"b": b"logical", "i": b"int16", "f": b"double", "V": b"double"}

        def put(group, name, array, kind=None):
            array = np.atleast_2d(np.asarray(array))
            stored = group.create_dataset(
                name, data=(array.astype(np.uint8) if array.dtype == bool else array).T
            )
            stored.attrs["MATLAB_class"] = kind or kinds[array.dtype.kind]
            return stored

        def struct(name):
            group = file.create_group(name)
            group.attrs["MATLAB_class"] = b"struct"
            return group

        put(struct("run"), "P", T[:, None])
        put(struct("run/sensor"), "F", -T[:, None])
        put(file["run"], "note", [[ord(letter) for letter in "hello"]], b"char")
        for name, array in (("y", Y), ("flags", T > 2), ("cube", CUBE)):
            put(file, name, array)
        file["z"] = np.array([(1.0, 1.0)] * 5, dtype=[("real", "f8"), ("imag", "f8")])
        file["z"].attrs["MATLAB_class"] = b"double"
        empty = put(file, "nothing", np.zeros((1, 2)))
        empty.attrs["MATLAB_empty"] = np.uint8(1)
        for i in range(3):
            put(struct(f"#refs#/train{i}"), "y", np.column_stack([T + i, 10 * T]))
            put(file[f"#refs#/train{i}"], "t", T[None, : 5 - i])
        file["train"] = np.array(
            [[file[f"#refs#/train{i}"].ref] for i in range(3)], dtype=h5py.ref_dtype
        )
        file["train"].attrs["MATLAB_class"] = b"cell"
        runs = struct("runs")
        for i in range(2):
            put(file["#refs#"], f"P{i}", 100 * i + T)
            put(struct(f"#refs#/inner{i}"), "eps", T / 10)
        for name in ("P", "inner"):
            runs[name] = np.array(
                [[file[f"#refs#/{name}{i}"].ref] for i in range(2)], dtype=h5py.ref_dtype
            )
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    with path.open("r+b") as file_:
        file_.write(head)
    return path


VERSIONS = pytest.mark.parametrize("write", [write_v5, write_v73], ids=["v5", "v7.3"])


@VERSIONS
@pytest.mark.parametrize(
    ("column", "expected"),
    [
        ("run.P", T),
        ("run.sensor.F", -T),
        ("run/sensor/F", -T),
        ("y[:,1]", 2 * T),
        ("y[3,:]", [3, 6, 9]),
        ("y[3]", [3, 6, 9]),
        ("cube[:,1,2]", CUBE[:, 1, 2]),
        ("flags", [0, 0, 0, 1, 1]),
        ("train[1].y[:,0]", T + 1),
        ("train[2].t", T[:3]),
        ("runs[1].P", 100 + T),
        ("runs[1].inner.eps", T / 10),
    ],
)
def test_addresses(tmp_path, write, column, expected):
    np.testing.assert_allclose(values(write(tmp_path / "a.mat"), column), expected)


@VERSIONS
def test_every_element_is_a_recording(tmp_path, write):
    path = write(tmp_path / "a.mat")
    tables = read(path, "y[:,0]", "y[:,1]", root="train[*]")
    assert [(table.element, table.at(4)) for table in tables] == [
        (i, f"a.mat:train[{i}]:index 4") for i in range(3)
    ]
    for i, table in enumerate(tables):
        np.testing.assert_array_equal(table.columns["y[:,0]"], T + i)
        np.testing.assert_array_equal(table.columns["y[:,1]"], 10 * T)
    assert [table.columns["P"][0] for table in read(path, "P", root="runs[*]")] == [0, 100]
    assert [table.element for table in read(path, "P", root="run[*]")] == [0]


@VERSIONS
def test_columns_from_the_root(tmp_path, write):
    path = write(tmp_path / "a.mat")
    assert values(path, 2, root="y") == list(3 * T)
    assert values(path, "P", root="runs[1]") == list(100 + T)


WRONG = """
run.p |  | a.mat: there is no 'p' on the way to 'run.p' | Did you mean 'P'? | A struct has: P,
runn.P |  | no 'runn' on the way | Did you mean 'run'? | The file has
run.P.x |  | no 'x' on the way | It is an array of
run |  | 'run' is a struct, not an array | has: P,
runs.P |  | no 'P' on the way to 'runs.P' | a struct array of 2 | [*]
train |  | 'train' is a cell array of | [*]
train[3].t |  | no element 3 on the way | 0 to 2
y |  | 'y' is not one column, but an array of 5 x 3 | `y[:,0]`
y[:,3] |  | 'y[:,3]' reaches beyond an array of 5 x 3
3 | y | reaches beyond an array of 5 x 3
y[:,0,0] |  | reaches beyond
y[-1] |  | '[-1]' is not a valid index | 0-based
y[:,0 |  | 'y[:,0' is not a valid address
run..P |  | 'run..P' is not a valid address
 |  | empty address
z |  | 'z' | complex
run.note |  | 'run.note' holds text, not real numbers
nothing |  | 'nothing' is empty
run.P y[3,:] |  | different length: 'y[3,:]' has 3 samples, 'run.P' has 5 | join
y[:,0] t | train[*] | a.mat:train[1]: columns of different length: 't' has 4 samples, 'y[:,0]' has 5
P | y[*] | `root: y[*]` asks for every element of an array of 5 x 3 | `root: y`
P | trains[*] | Did you mean 'train'?
"""
"""Columns, root, and parts of the message."""


@VERSIONS
@pytest.mark.parametrize("line", WRONG.strip("\n").splitlines())
def test_addresses_that_lead_nowhere(tmp_path, write, line):
    columns, root, *parts = map(str.strip, line.split("|"))
    wanted = [int(one) if one.isdigit() else one for one in columns.split(" ")]
    told = refusal(parts, "mat", write(tmp_path / "a.mat"), *wanted, root=root or None)
    assert told.startswith(("a.mat", "'"))


@VERSIONS
def test_ragged_recordings_end_with_the_shortest_column_where_the_spec_drops_what_is_missing(
    tmp_path, write
):
    tables = read(write(tmp_path / "a.mat"), "y[:,0]", "t", root="train[*]", incomplete=True)
    assert [len(table.rows) for table in tables] == [5, 4, 3]


@pytest.mark.parametrize(
    ("name", "column", "expected"),
    [
        ("testhdf5_7.4_GLNX86.mat", "testdouble", np.linspace(0, 2 * math.pi, 9)),
        # on a machine whose numbers are big-endian
        ("testdouble_6.1_SOL2.mat", "testdouble", np.linspace(0, 2 * math.pi, 9)),
        ("testdouble_4.2c_SOL2.mat", "testdouble", np.linspace(0, 2 * math.pi, 9)),
        ("testcell_7.4_GLNX86.mat", "testcell[3]", [1, 2, 3]),
        ("teststruct_7.4_GLNX86.mat", "teststruct.doublefield", [math.sqrt(2), math.e, math.pi]),
        ("teststructnest_6.5.1_GLNX86.mat", "teststructnest.one", [1]),
        ("test3dmatrix_7.4_GLNX86.mat", "test3dmatrix[1,:,3]", [20, 22, 24]),
    ],
)
def test_files_that_matlab_wrote(name, column, expected):
    if not (BY_MATLAB / name).is_file():
        pytest.skip("this SciPy comes without its test files")
    np.testing.assert_allclose(values(BY_MATLAB / name, column), expected)
    # the other reader takes it as well, with the axes as MATLAB shows them
    if name.startswith("testhdf5"):
        (table,) = tables_of("hdf5", BY_MATLAB / name, "testdouble[0,:]")
        np.testing.assert_allclose(table.columns["testdouble[0,:]"], expected)


@pytest.mark.parametrize("format_", ["4", "5"])
@pytest.mark.parametrize("packed", [False, True])
def test_arrays_of_every_type_equal_those_of_scipy(tmp_path, format_, packed):
    kinds = (
        ("f8", "f4", "i4", "i2", "u2", "u1")
        if format_ == "4"
        else ("f8", "f4", "i8", "u8", "i4", "u4", "i2", "u2", "i1", "u1", "?")
    )
    arrays = {
        f"v{kind[0].replace('?', 'b')}{kind[1:]}": np.arange(12).reshape(4, 3).astype(kind)
        for kind in kinds
    }
    scipy.io.savemat(
        tmp_path / "a.mat",
        arrays,
        format=format_,
        do_compression=packed,
    )
    known = scipy.io.loadmat(tmp_path / "a.mat")
    for name in arrays:
        np.testing.assert_array_equal(values(tmp_path / "a.mat", f"{name}[:,2]"), known[name][:, 2])


def test_texts_of_any_encoding_do_not_hide_the_numbers_beside_them(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"P": T, "label": "20 °C 🙂", "other": T})
    for path in (tmp_path / "a.mat", BY_MATLAB / "testunicode_7.4_GLNX86.mat"):
        assert not path.exists() or list(READERS["mat"].peek(path, 3))
    assert values(tmp_path / "a.mat", "P") == list(T)
    refusal(["'label' holds text"], "mat", tmp_path / "a.mat", "label")


def variable_5(of_class, shape, *parts):
    flags, size = np.array([of_class, 0], "<u4").tobytes(), np.array(shape, "<i4").tobytes()
    return element(14, element(6, flags) + element(5, size) + element(1, b"x") + b"".join(parts))


NUMBER = element(9, T[1:2].tobytes())
ZEROS = zlib.compress(variable_5(6, (1, 15 * 10**6), element(9, bytes(12 * 10**7))), 1)
FAR_TOO_MUCH = {
    "cells that are not there": (variable_5(1, (10**9, 1)), "0 elements instead of 1000000000"),
    "fields": (
        variable_5(2, (10**9, 1), element(5, np.array([2], "<i4").tobytes()), element(1, b"P\0")),
        "0 elements instead of 1000000000",
    ),
    "numbers that are not there": (variable_5(6, (10**9, 10**9), NUMBER), "cannot reshape"),
    "packed": (
        b"\x0f\0\0\0" + np.array([len(ZEROS)], "<u4").tobytes() + ZEROS,
        "the file unpacks from",
    ),
    "a size below zero": (variable_5(6, (-1, 1), NUMBER), "cannot reshape"),
    "an end beyond the file": (variable_5(6, (1, 1), NUMBER)[:-8], "an array is cut off"),
}


@pytest.mark.parametrize(("variable", "told"), FAR_TOO_MUCH.values(), ids=FAR_TOO_MUCH)
def test_files_that_declare_far_too_much_are_refused_at_once(tmp_path, variable, told):
    path = tmp_path / "a.mat"
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + variable)
    assert peak_memory(lambda: refusal(["a.mat: ", told], "mat", path, "x", root=None)) < 400e6


@pytest.mark.parametrize(("most", "readable"), [(3, True), (2, False)])
def test_a_cell_array_has_at_most_as_many_elements_as_a_limit_says(
    tmp_path, monkeypatch, most, readable
):
    monkeypatch.setattr(mat, "MOST_ELEMENTS", most)
    cells = np.empty(3, dtype=object)
    cells[:] = [T, T + 1, T + 2]
    scipy.io.savemat(tmp_path / "a.mat", {"x": cells})
    if readable:
        assert values(tmp_path / "a.mat", "x[2]") == list(T + 2)
    else:
        refusal(["'x' is a cell array or a struct with more"], "mat", tmp_path / "a.mat", "x[2]")


def test_empty_cell_arrays_and_struct_arrays_without_fields_have_no_elements():
    fields = (element(5, np.array([32], "<i4").tobytes()), element(1, b""))
    content = memoryview(variable_5(2, (1, 2), *fields))[8:]
    assert mat._Version5("<", len(content)).member(content, "x").count == 0
    with h5py.File("a", "w", driver="core", backing_store=False) as file:
        cells = file.create_dataset("x", data=np.array([file.ref], dtype=h5py.ref_dtype))
        cells.attrs["MATLAB_class"], cells.attrs["MATLAB_empty"] = b"cell", np.uint8(1)
        assert hdf5._matlab_array(cells).count == 0


@pytest.mark.parametrize("version", ["4", "5"])
def test_variables_are_listed_in_alphabetical_order(tmp_path, version):
    scipy.io.savemat(tmp_path / "a.mat", {"t": T, "F": T, "P": T}, format=version)
    (top,) = READERS["mat"].peek(tmp_path / "a.mat", 3)
    assert top.addresses == ("F", "P", "t")


@pytest.mark.parametrize("version", ["4", "5"])
def test_a_sparse_matrix_is_told_with_the_way_to_save_it(tmp_path, version):
    content = {"few": sparse.csc_array(np.diag(T)), "P": T[:, None]}
    scipy.io.savemat(tmp_path / "a.mat", content, format=version)
    refusal(["'few' is a sparse matrix", "`full(few)`"], "mat", tmp_path / "a.mat", "few[:,1]")
    assert values(tmp_path / "a.mat", "P") == list(T)


@VERSIONS
def test_cut_files_give_what_they_hold_or_an_error(tmp_path, write):
    whole = write(tmp_path / "a.mat").read_bytes()
    cut = tmp_path / "cut.mat"
    noticed = 0
    for end in range(0, len(whole) - 1, max(1, len(whole) // 150)):
        cut.write_bytes(whole[:end])
        try:
            (table,) = read(cut, "run.P", "y[:,0]")
        except DataError:
            noticed += 1
        else:  # what was asked for stands before the cut
            np.testing.assert_array_equal(table.columns["y[:,0]"], T)
    assert noticed > 20


def test_objects_of_matlab_are_told_with_the_way_to_save_arrays(tmp_path):
    tables = opaque_mat(tmp_path / "a.mat", "log", "timetable", T)
    assert values(tables, "x") == list(T)
    timetable_of_73(tmp_path / "b.mat")
    for path, column, name in [
        (tables, "log", "'log' is an object of MATLAB (timetable)"),
        (tables, "log.P", "'log' is an object of MATLAB (timetable)"),
        (tmp_path / "b.mat", "log", "'log' is an object of MATLAB (timetable)"),
        (BY_MATLAB / "testobject_7.4_GLNX86.mat", "testobject", "'testobject' is an object of"),
        (BY_MATLAB / "testfunc_7.4_GLNX86.mat", "testfunc", "'testfunc' is an object of MATLAB"),
    ]:
        assert refusal(["save('log.mat', "], "mat", path, column).startswith(f"a.mat: {name}")


def commands_for(of_class):
    return re.findall(r"`(.*)`", object_of_matlab("run.log", of_class).remedy)[0]


@pytest.mark.skipif(OCTAVE is None, reason=NO_OCTAVE)
def test_octave_reads_the_commands_that_save_arrays(tmp_path):
    """Octave has no tables, but it can make out each command; for a struct with the members of a
    time series it runs them, and we read what they save.
    """
    script = [f"if false, {commands_for(name)}; end" for name in (*REMEDIES, "Simulink.Bus", "")]
    script += ["run.log.Time = [0; 1; 2]; run.log.Data = reshape([3 4 5], 1, 1, 3);"]
    script += [commands_for("timeseries").replace("save(", "save('-v7', ")]
    (tmp_path / "a.m").write_text("\n".join(script))
    subprocess.run([OCTAVE, "--quiet", "a.m"], cwd=tmp_path, check=True)
    assert values(tmp_path / "log.mat", "t") == [0, 1, 2]
    assert values(tmp_path / "log.mat", "y") == [3, 4, 5]


@pytest.mark.parametrize(
    ("of_class", "command"),
    [
        ("table", "S = table2struct(run.log, 'ToScalar', true)"),
        ("timetable", "S.t = seconds(t - t(1))"),
        ("timeseries", "t = run.log.Time; y = squeeze(run.log.Data)"),
        ("datetime", "x = seconds(run.log - run.log(1)); save('log.mat', 'x', '-append')"),
        ("categorical", "x = double(run.log)"),
        ("string", "x = str2double(run.log)"),
        ("Simulink.Bus", "S = struct(run.log)"),
    ],
)
def test_each_class_has_commands_of_its_own(of_class, command):
    assert command in commands_for(of_class)
