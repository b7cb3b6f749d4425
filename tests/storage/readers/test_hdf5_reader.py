from functools import partial

import h5py
import numpy as np
import pytest
from common import parts
from reading import refusal, table_of

from mapmore_cli.storage.readers import hdf5

T = np.arange(6.0)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as made:
        made["run/pressure"] = T.astype(">f4")
        made.create_dataset(
            "run/both", data=np.column_stack([T, -T]), chunks=(2, 1), compression="gzip"
        )
        made["run/text"] = ["a"] * 6
        made["run/scalar"] = 3.0
        table = np.zeros(6, dtype=[("t", "f8"), ("F", "i4")])
        table["t"], table["F"] = T, 7 * T
        made["table"] = table
        for i in (10, 2, 1):
            made[f"runs/run_{i}/P"] = i + T
        made["link"] = h5py.SoftLink("/nowhere")
    return path


read = partial(table_of, "hdf5")


READ = """
run/pressure     -        0 1 2 3 4 5
run.pressure     -        0 1 2 3 4 5
pressure         run      0 1 2 3 4 5
/run/both[:,1]   -        0 -1 -2 -3 -4 -5
run/both[2,:]    -        2 -2
1                run/both 0 -1 -2 -3 -4 -5
F                table    0 7 14 21 28 35
table.t          -        0 1 2 3 4 5
run/scalar       -        3
"""
"""Column, root, and what is read."""


@pytest.mark.parametrize("line", READ.strip().splitlines())
def test_addresses(file, line):
    column, root, *expected = line.split()
    column = int(column) if column.isdigit() else column
    values = read(file, column, root=None if root == "-" else root).columns[column]
    np.testing.assert_array_equal(values, [*map(float, expected)])
    assert values.dtype == np.float64


WRONG = """
run/presure | - | no 'presure' on the way to 'run/presure' | Did you mean 'pressure'?
run | - | 'run' is a group of 4, not an array | both, pressure
run/both | - | an array of 6 x 2 | `run/both[:,0]`
run/both[:,2] | - | reaches beyond an array of 6 x 2
run/text | - | 'run/text' holds | not real numbers
table | - | 'table' is a table of 6 | A table of 6 has: t, F
table.force | - | no 'force' | t, F
run/scalar run/pressure | - | 'run/scalar' has 1 samples, 'run/pressure' has 6
link | - | a.h5: 'link' is a link without a target
P | runs | there is no 'P' | A group of 3 has: run_1, run_10, run_2
x | run/pressure[*] | every element of an array of 6 | `root: run/pressure`
"""
"""Columns, root, and parts of the message."""


@pytest.mark.parametrize("line", WRONG.strip().splitlines())
def test_addresses_that_lead_nowhere(file, line):
    columns, root, *told = parts(line)
    refusal(told, "hdf5", file, *columns.split(), root=None if root == "-" else root)


def test_one_column_is_read_without_the_others(tmp_path):
    with h5py.File(tmp_path / "wide.h5", "w") as made:
        # 480 GB, never written
        made.create_dataset("wide", shape=(6, 10**10), chunks=(6, 1000), dtype="f8", fillvalue=3.0)
    table = read(tmp_path / "wide.h5", "wide[:,5]", incomplete=True)
    np.testing.assert_array_equal(table.columns["wide[:,5]"], [np.nan] * 6)


def test_a_file_is_of_matlab_if_one_of_its_members_is(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as made:
        made["P"], made["other"] = np.stack([T, T + 1]), T
        made["P"].attrs["MATLAB_class"] = b"double"
    table = table_of("hdf5", tmp_path / "a.h5", "P[:,1]")
    np.testing.assert_array_equal(table.columns["P[:,1]"], T + 1)


def test_a_group_is_a_struct_array_only_if_all_its_fields_are_references(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as made:
        made["run/x"], made["P"] = T, T
        made["run/of"] = np.array([made["P"].ref], dtype=h5py.ref_dtype)
        made["P"].attrs["MATLAB_class"] = b"double"
    table = table_of("hdf5", tmp_path / "a.h5", "run.x")
    np.testing.assert_array_equal(table.columns["run.x"], T)


def test_texts_are_read_in_parts_that_fit_into_memory_even_if_each_is_as_long_as_the_file(
    monkeypatch,
):
    with h5py.File("a", "w", driver="core", backing_store=False) as file:
        file["texts"] = texts = [[f"{n}", "x"] for n in range(7)]
        stored, taken, sizes = file["texts"], [], []

        class Noted:
            def __getitem__(self, rows):
                taken.append(rows)
                return stored[rows]

        monkeypatch.setattr(hdf5, "BOMB_SIZE", 6 * file.id.get_filesize())
        monkeypatch.setattr(hdf5, "refuse_bombs", lambda _name, size, _: sizes.append(size))
        assert hdf5._texts(stored, Noted()).astype(str).tolist() == texts
    assert [(rows.start, rows.stop) for rows in taken] == [(0, 3), (3, 6), (6, 9)]
    assert sizes == [17 * count for count in (6, 12, 14)]  # a letter, and where it stands


@pytest.mark.parametrize(("kind", "each"), [("f4", 8), ("f8", 8), ("S100", 100)])
def test_a_value_that_was_read_takes_eight_bytes_at_least(kind, each):
    token = hdf5._read.set({})
    with h5py.File("a", "w", driver="core", backing_store=False) as file:
        hdf5._own_values(file.create_dataset("x", (3, 5), kind), (slice(None), 2))
    assert [*hdf5._read.get().values()] == [3 * each]
    hdf5._read.reset(token)
