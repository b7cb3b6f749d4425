from functools import partial

import h5py
import numpy as np
import pytest
from common import parts
from reading import refusal, table_of

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
