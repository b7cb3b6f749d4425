"""Archives of NumPy arrays and tables in Parquet: columns by name, and what is no column."""

import struct
import zipfile
from contextlib import nullcontext
from decimal import Decimal

import numpy as np
import pytest
from reading import refusal, table_of

from mapmore_cli.study.sections.logs import Logs

pa = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")
T = np.arange(5.0)
READ = """
npz      t            0 1 2 3 4
npz      P_[kPa]      0 1 2 3 4
npz      rig/y[:,1]   0 2 4 6 8
npz      pairs.F      0 2 4 6 8
parquet  t            0 1 nan 3 4
parquet  rig.P_[kPa]  0 1 2 3 4
parquet  code         0 1 2 3 4
parquet  exact        0 1 2 3 4
"""
REFUSED = """
npz      o            'o' is an array of Python objects, which are not read
npz      z            'z' holds complex numbers
npz      cube         'cube' is not one column, but an array of 2 x 2 x 2
npz      s            's' holds text
npz      pairs        'pairs' is a table of 5, not an array of numbers
npz      T            there is no 'T'
parquet  note         column 'note' holds values of type string, not numbers
parquet  list         column 'list' holds values of type list<element: double>, not numbers
parquet  inner        column 'inner' holds values of type struct<x: double>, not numbers
parquet  flag         'flag' holds TRUE and FALSE
parquet  stamp        'stamp': a date, not a number
parquet  p            there is no 'p'
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with `a.npz` and `a.parquet`."""
    pairs = np.array([*zip(T, 2 * T, strict=True)], dtype="f8,>f4")
    pairs.dtype.names = ("P", "F")
    arrays = {"t": T.astype("i2"), "P_[kPa]": T[:, None], "rig/y": np.column_stack([T, 2 * T])}
    others = {"o": np.array([1, None]), "z": T + 1j, "cube": np.zeros((2, 2, 2)), "s": ["a", "b"]}
    np.savez(tmp_path / "a.npz", **arrays, **others, pairs=pairs)
    columns = {"rig.P_[kPa]": T, "exact": T, "flag": T > 1, "note": [*"abcde"]}
    columns |= {"list": [[1.0]] * 5, "inner": [{"x": 1.0}] * 5, "t": [0, 1, None, 3, 4]}
    columns |= {"stamp": T.astype("M8[s]"), "code": pa.array(T).dictionary_encode()}
    columns["exact"] = pa.array(T).cast(pa.decimal128(9, 2))
    parquet.write_table(pa.table(columns), tmp_path / "a.parquet")
    return tmp_path


def test_columns_by_name(folder):
    for line in READ.strip().splitlines():
        kind, column, *cells = line.split()
        table = table_of(kind, folder / f"a.{kind}", column)
        np.testing.assert_array_equal(table.columns[column], [*map(float, cells)])
    table = table_of("parquet", folder / "a.parquet", "stamp", clocks={"stamp"})
    np.testing.assert_array_equal(table.columns["stamp"], T)


def test_what_is_no_column_of_numbers(folder):
    for line in REFUSED.strip().splitlines():
        kind, column, told = line.split(maxsplit=2)
        refusal([f"a.{kind}: ", told, "\n"], kind, folder / f"a.{kind}", column)


def lying_about_its_size(archive):
    """An archive that declares more packed bytes for its part than it has itself."""
    whole = bytearray(archive.read_bytes())
    struct.pack_into("<I", whole, whole.rindex(b"PK\x01\x02") + 20, 10**9)
    archive.write_bytes(whole)
    return archive


@pytest.mark.parametrize(("kind", "each"), [("f8", 8), ("O", 100)])
def test_a_number_of_a_column_takes_eight_bytes_and_a_decimal_number_a_hundred(
    tmp_path, monkeypatch, kind, each
):
    monkeypatch.setattr("mapmore_cli.storage.tables.BOMB_RATIO", 0)
    numbers = np.full(99, Decimal("1.5"), dtype=kind)
    parquet.write_table(pa.table({"x": numbers}), tmp_path / "a.parquet")
    monkeypatch.setattr("mapmore_cli.storage.tables.BOMB_SIZE", each * 99)
    assert table_of("parquet", tmp_path / "a.parquet", "x").size == 99
    monkeypatch.setattr("mapmore_cli.storage.tables.BOMB_SIZE", each * 99 - 1)
    refusal(["unpacks from"], "parquet", tmp_path / "a.parquet", "x")


def test_what_unpacks_to_far_more_than_it_has_is_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr("mapmore_cli.storage.tables.BOMB_SIZE", 1_000_000)
    np.savez_compressed(tmp_path / "a.npz", x=np.zeros(1_000_000))
    refusal(["a.npz: 'x' unpacks from"], "npz", tmp_path / "a.npz", "x")
    refusal(["'x' unpacks from"], "npz", lying_about_its_size(tmp_path / "a.npz"), "x")
    np.save(tmp_path / "x.npy", T)
    header = (tmp_path / "x.npy").read_bytes().replace(b"(5,), }        ", b"(500000000,), }")
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("x.npy", header)
    refusal(
        ["a.npz: the file is damaged", "'x' declares more values"], "npz", tmp_path / "a.npz", "x"
    )


@pytest.mark.parametrize("of_frame", [False, True])
@pytest.mark.parametrize("key", ["unit", "units", "Unit", "UNITS"])
def test_units_that_a_table_in_parquet_notes(tmp_path, key, of_frame):
    """In the metadata of a column, or by its name in the `attrs` of a frame of pandas."""
    key = key.lower() if of_frame else key
    attributes = f'{{"columns": [], "attributes": {{"{key}": {{"P": "psi"}}}}}}'
    own, other = None if of_frame else {key: "psi"}, pa.field("F", pa.float64())
    schema = pa.schema([pa.field("P", pa.float64(), metadata=own), other])
    schema = schema.with_metadata({"pandas": attributes} if of_frame else None)
    parquet.write_table(pa.table({"P": T, "F": T}, schema=schema), tmp_path / "a.parquet")
    noted = table_of("parquet", tmp_path / "a.parquet", "P", "F").noted
    assert (noted["P"].unit, noted["F"].unit) == ("psi", "")


@pytest.mark.parametrize("reader", ["parquet", "tdms", "npz", "hdf5"])
def test_columns_of_some_formats_have_no_numbers(reader):
    spec = {"files": ["a"], "reader": reader, "columns": {"F": {"column": 0}}, "sample_time": 1}
    refused = reader in ("parquet", "tdms")
    words = "finds columns by name, not by number"
    with pytest.raises(ValueError, match=words) if refused else nullcontext():
        Logs.model_validate(spec)
