"""Archives of NumPy arrays and tables in Parquet: columns by name, and what is no column."""

import zipfile

import numpy as np
import pytest
from reading import refusal, table_of

pa = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")
T = np.arange(5.0)


@pytest.fixture
def npz(tmp_path):
    pairs = np.array([*zip(T, 2 * T, strict=True)], dtype=[("P", "f8"), ("F", ">f4")])
    arrays = {"t": T.astype("i2"), "P [kPa]": T[:, None], "rig/y": np.column_stack([T, 2 * T])}
    objects = {"o": np.array([1, None]), "z": T + 1j, "cube": np.zeros((2, 2, 2)), "s": ["a", "b"]}
    np.savez(tmp_path / "a.npz", **arrays, **objects, pairs=pairs)
    return tmp_path / "a.npz"


@pytest.fixture
def table(tmp_path):
    columns = {
        "t": pa.array([0, 1, None, 3, 4]),
        "rig.P [kPa]": T,
        "code": pa.array(T).dictionary_encode(),
        "exact": pa.array(T).cast(pa.decimal128(9, 2)),
        "flag": T > 1,
        "note": [*"abcde"],
        "list": [[1.0]] * 5,
        "inner": [{"x": 1.0}] * 5,
        "stamp": np.datetime64("1970-01-02") + T.astype("timedelta64[s]"),
    }
    parquet.write_table(pa.table(columns), tmp_path / "a.parquet")
    return tmp_path / "a.parquet"


def test_columns_by_name(npz, table):
    for path, column, expected in (
        (npz, "t", T),
        (npz, "P [kPa]", T),
        (npz, "rig/y[:,1]", 2 * T),
        (npz, "pairs.F", 2 * T),
        (table, "t", [0, 1, np.nan, 3, 4]),
        (table, "rig.P [kPa]", T),
        (table, "code", T),
        (table, "exact", T),
    ):
        read = table_of(path.suffix[1:], path, column)
        np.testing.assert_array_equal(read.columns[column], expected)
    stamps = table_of("parquet", table, "stamp", clocks=frozenset({"stamp"}))
    np.testing.assert_array_equal(stamps.columns["stamp"], 86400 + T)


def test_what_is_no_column_of_numbers(npz, table):
    for path, column, *told in (
        (npz, "o", "'o' is an array of Python objects", "`values.astype(float)`"),
        (npz, "z", "'z' holds complex numbers"),
        (npz, "cube", "'cube' is an array of 2 x 2 x 2"),
        (npz, "s", "'s' holds text"),
        (npz, "pairs", "a table of 5", "P, F"),
        (npz, "T", "there is no 'T'", "Did you mean 't'?"),
        (table, "note", "column 'note' holds values of type string", "a column of numbers"),
        (table, "list", "column 'list' holds values of type list"),
        (table, "inner", "column 'inner' holds values of type struct"),
        (table, "flag", "holds TRUE and FALSE"),
        (table, "stamp", "a date stands here"),
        (table, "p", "there is no 'p'", "t, rig.P [kPa]"),
    ):
        refusal([f"a.{path.suffix[1:]}: ", *told], path.suffix[1:], path, column)


def test_what_unpacks_to_far_more_than_it_has_is_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr("mapmore_cli.storage.tables.BOMB_SIZE", 1_000_000)
    np.savez_compressed(tmp_path / "a.npz", x=np.zeros(1_000_000))
    refusal(["a.npz: 'x' unpacks from"], "npz", tmp_path / "a.npz", "x")
    parquet.write_table(pa.table({"x": np.zeros(1_000_000)}), tmp_path / "a.parquet")
    refusal(["a.parquet: each column unpacks"], "parquet", tmp_path / "a.parquet", "x")
    np.save(tmp_path / "x.npy", T)
    header = (tmp_path / "x.npy").read_bytes().replace(b"(5,), }        ", b"(500000000,), }")
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("x.npy", header)
    refusal(["a.npz: the file is damaged", "'x' is cut off"], "npz", tmp_path / "a.npz", "x")


@pytest.mark.parametrize("kind", ["npz", "parquet"])
def test_every_cut_is_noticed(request, tmp_path, kind):
    whole = request.getfixturevalue({"parquet": "table"}.get(kind, kind)).read_bytes()
    for end in range(0, len(whole), 97):
        (tmp_path / "cut").write_bytes(whole[:end])
        refusal([f"a.{kind}: the file is damaged"], kind, tmp_path / "cut", "t")
