"""A file that its reader cannot read: the error names the reader that fits its first bytes."""

import gzip
import io
import zipfile
from contextlib import nullcontext

import h5py
import numpy as np
import pytest
import scipy.io
from reading import refusal, refused

from mapmore_cli.annexes.drafting.preview import preview
from mapmore_cli.storage.readers import READERS, reader_of

VALUES = {"t": np.arange(40) / 7, "F": np.sqrt(np.arange(40))}


def archive(**members):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as made:
        for name, content in members.items():
            made.writestr(name.replace("__", "."), content)
    return stream.getvalue()


def content_of(kind):
    """Return a file of a kind."""
    stream = io.BytesIO()
    if kind == "npz":
        np.savez(stream, **VALUES)
    elif kind == "hdf5":
        with h5py.File(stream, "w") as file:
            file["t"] = VALUES["t"]
    elif kind == "mat":
        scipy.io.savemat(stream, VALUES)
    elif kind == "xlsx":
        pytest.importorskip("openpyxl").Workbook().save(stream)
    elif kind == "parquet":
        pyarrow, parquet = map(pytest.importorskip, ("pyarrow", "pyarrow.parquet"))
        parquet.write_table(pyarrow.table(VALUES), stream)
        return stream.getvalue()
    elif kind == "tdms":
        nptdms = pytest.importorskip("nptdms")
        with nptdms.TdmsWriter(stream) as file:
            file.write_segment([nptdms.ChannelObject("g", "t", VALUES["t"])])
            return stream.getvalue()
    elif kind == "xls":
        book = pytest.importorskip("xlwt").Workbook()
        book.add_sheet("a").write(0, 0, "t")
        book.save(stream)
    elif kind == "ods":
        return archive(mimetype="application/vnd.oasis.opendocument.spreadsheet")
    return stream.getvalue()


KINDS = {"xls": "xlsx", "ods": "xlsx"}


@pytest.mark.parametrize("kind", ["npz", "hdf5", "mat", "xlsx", "parquet", "tdms", "xls", "ods"])
def test_a_file_for_another_reader(kind, tmp_path):
    path, reader = tmp_path / "a.dat", KINDS.get(kind, kind)
    path.write_bytes(content_of(kind))
    fits = f"write `reader: {reader}`"
    assert fits in refusal(["like one for the reader"], "csv", path, "t")
    assert fits in refusal([], "csv", path, "t", encoding="latin-1")
    for other in READERS.keys() - {reader, "csv", "mat"}:
        assert fits in refusal([], other, path, "t")
    assert reader_of(path).name == reader
    packed = tmp_path / "a.csv.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    refusal([f"unpack it, and {fits}"], "csv", packed, "t")


OTHERS = {
    "a ZIP archive": archive(a__csv="t,F\n1,2\n"),
    "a binary file of an unknown format": np.arange(1, 300, dtype=np.float64).tobytes(),
    "an SQLite database": b"SQLite format 3\0\x10\0\1\1\0\x40\x20\x20" + bytes(range(64)),
    "a single NumPy array (.npy)": b"\x93NUMPY\1\0" + bytes(range(32)),
}


@pytest.mark.parametrize("kind", OTHERS)
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
def test_a_file_for_no_reader_is_no_text(kind, encoding, tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(OTHERS[kind])
    refusal([f"a.csv: is no text file, but {kind}", "CSV"], "csv", path, "t", encoding=encoding)
    with refused("is no text file"):
        preview(path)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("t,F\n1,2\0\0\0\n3,x\n", "a.csv:row 2: the line contains NUL bytes"),
        ("t;°C\n\x1b[31m;\x07\n" + "1;2\n" * 90, None),
        ("t,F\n" + "1,x\n" * 99 + "\0" * 999, "no table of numbers was found"),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "utf-16"])
def test_a_text_with_faults_is_a_text(text, fault, encoding, tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(text.encode(encoding))
    for declared in ("utf-8", encoding):
        message = refusal(["a.csv"], "csv", path, "F", encoding=declared)
        assert "no text" not in message
    with nullcontext() if fault is None else refused(fault):
        preview(path)
