"""Recordings: files of every format, changed in their text, their parts or their bytes, read with
settings that fit or do not.
"""

import gzip
import io
import struct
import sys
import zipfile
import zlib
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import numpy as np
import scipy.io
from driver import Fault, Target, changed_bytes, changed_text, refused
from nptdms import ChannelObject, TdmsWriter
from openpyxl import Workbook

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "storage" / "readers"))

import pyarrow as pa
from pyarrow import parquet
from reading import opaque_variable, other_workbook
from test_lvm_reader import FIRST, HEAD
from test_mat_reader import write_v5

from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.storage.readers import READERS, TableRequest

ROWS = 40
OTHER_BOOKS = ("xls", "ods")
CELLS = (
    *(
        "",
        "nan",
        "inf",
        "-",
        "1e999",
        "1_5",
        "0x1f",
        "1,5",
        '"3',
        '"1\n2"',
        "--",
        "9" * 500,
        "12:30:01",
        "2026-03-01T12:00:00Z",
    ),
    *("\x00", "é", "\u0661", "=1+1", "#N/A"),
)
MARKS = " ,;\t\"'\n\r\x00.eE+-0123456789é"


def table(chance):
    """A header and rows of numbers, some cells hostile."""
    columns = chance.choice([2, 3, 3, 4])
    rows = [
        [f"{chance.uniform(-9, 300):.{chance.randrange(7)}f}" for _ in range(columns)]
        for _ in range(chance.choice([0, 1, 3, ROWS]))
    ]
    for _ in range(chance.choice([0, 0, 1, 1, 3]) if rows else 0):
        chance.choice(rows)[chance.randrange(columns)] = chance.choice(CELLS)
    for _ in range(chance.choice([0, 0, 0, 1]) if rows else 0):
        row = chance.choice(rows)
        row.append("7") if chance.random() < 0.5 else row.pop()
    return [["t", "P", "F", "x"][:columns], *rows]


def text(chance):
    """A text file in some dialect, encoding and packing."""
    mark, end = chance.choice([",", ",", ";", "\t", " "]), chance.choice(["\n", "\n", "\r\n", "\r"])
    written = end.join(mark.join(row) for row in table(chance)) + chance.choice(["", end])
    if chance.random() < 0.3:
        written = written.replace(".", ",")
    if chance.random() < 0.3:
        written = changed_text(written, chance, MARKS)
    whole = written.encode(
        chance.choice(["utf-8", "utf-8", "utf-8-sig", "utf-16", "latin-1"]), "replace"
    )
    whole = gzip.compress(whole, 1) if chance.random() < 0.1 else whole
    return changed_bytes(whole, chance) if chance.random() < 0.2 else whole


@cache
def binary(kind):
    stream = io.BytesIO()
    time, pressure = np.arange(ROWS) * 0.1, np.linspace(0, 300, ROWS)
    if kind == "xlsx":
        book = Workbook()
        for row in [
            ["t", "P", "F"],
            *(
                [float(t), float(p), "1,5" if i == 9 else i]
                for i, (t, p) in enumerate(zip(time, pressure, strict=True))
            ),
        ]:
            book.active.append(row)
        book.active["D3"], book.active["D4"] = "=A3", "#REF!"
        book.active.merge_cells("D5:D9")
        book.create_sheet("second").append(["t", "P"])
        book.create_sheet("third").sheet_state = "hidden"
        book.save(stream)
    elif kind in OTHER_BOOKS:
        with TemporaryDirectory() as folder:
            rows = [["t", "P"], *zip(time.tolist(), pressure.tolist(), strict=True)]
            other_workbook(Path(folder) / f"a.{kind}", rows)
            return (Path(folder) / f"a.{kind}").read_bytes()
    elif kind == "lvm":
        return (HEAD + FIRST + FIRST).encode()
    elif kind == "npz":
        np.savez(stream, t=time, P=pressure, y=np.column_stack([time, pressure]), o=[None])
    elif kind == "parquet":
        columns = {"t": time, "P": pressure, "o": [None, "a"] * (ROWS // 2)}
        parquet.write_table(pa.table(columns), stream)
    elif kind == "4.mat":
        content = {"P": pressure, "t": time, "note": "text", "z": time + 1j}
        scipy.io.savemat(stream, content, format="4")
    elif kind in ("mat", "packed.mat"):
        write_v5(stream, do_compression=kind != "mat")
        if kind == "mat":
            stream.write(opaque_variable("log", "timetable"))
    elif kind == "hdf5":
        with h5py.File(stream, "w") as file:
            file["run/t"], file["run/P"] = time, pressure
            file.create_dataset(
                "run/F", data=pressure, chunks=(8,), compression="gzip", shuffle=True
            )
            file["run/packed"], file["run/text"] = time.astype(np.int16), ["a", "b"]
            said = {
                "units": "kPa",
                "scale_factor": 0.1,
                "_FillValue": np.int16(-1),
                "valid_range": [0.0, 9.0],
            }
            file["run/packed"].attrs.update(said)
            file["run/none"] = h5py.Empty("f8")
    else:
        with TdmsWriter(stream) as writer:
            said = {
                "wf_increment": 0.1,
                "wf_start_time": np.datetime64("2026-03-01"),
                "unit_string": "kPa",
            }
            writer.write_segment(
                [ChannelObject("run", "t", time, said), ChannelObject("run", "P", pressure, said)]
            )
    return stream.getvalue()


def changed_matlab(whole, chance, kind):
    """A MATLAB file with wrong types, sizes and parts of others in place of some; what is packed is
    changed before it is packed anew.
    """
    if kind == "packed.mat" and chance.random() < 0.7:
        parts, place = [], 128
        while place < len(whole):
            size = struct.unpack_from("<I", whole, place + 4)[0]
            parts.append(zlib.decompress(whole[place + 8 : place + 8 + size]))
            place += 8 + size
        victim = chance.randrange(len(parts))
        parts[victim] = changed_matlab(parts[victim], chance, "mat")
        packed = [zlib.compress(part, 1) for part in parts]
        return whole[:128] + b"".join(struct.pack("<II", 15, len(part)) + part for part in packed)
    changed = bytearray(whole)
    for _ in range(chance.choice([1, 1, 2, 4])):
        place = 4 * chance.randrange(len(changed) // 4)
        number = chance.choice(
            [
                *range(20),
                0xFFFFFFFF,
                0x7FFFFFFF,
                0x80000000,
                1 << 20,
                1 << 16 | 6,
                4 << 16 | 5,
                1000,
                10**9,
            ]
        )
        if chance.random() < 0.6:
            changed[place : place + 4] = struct.pack("<I", number)
        else:
            other, size = 8 * chance.randrange(len(changed) // 8), 8 * chance.randrange(1, 20)
            changed[place : place + chance.choice([0, size])] = changed[other : other + size]
    return changed_bytes(bytes(changed), chance) if chance.random() < 0.2 else bytes(changed)


CELLS_OF = ("xl/worksheets/sheet1.xml", "xl/worksheets/sheet2.xml", "content.xml")


def changed_members(whole, chance):
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(whole)) as old, zipfile.ZipFile(out, "w") as new:
        names = old.namelist()
        victim = chance.choice(
            [name for name in names if name in CELLS_OF or chance.random() < 0.2] or names
        )
        for name in names:
            content = old.read(name)
            if name == victim:
                written = content.decode()
                if chance.random() < 0.5:
                    parts = ["<c ", 'r="', "<v>", "</row>", "1", "sheet", "t=", "value", "cell"]
                    old_part = chance.choice(parts)
                    content = written.replace(
                        old_part,
                        chance.choice(["", "999999", "<!DOCTYPE a>", "&x;", '"', "-1"]),
                        chance.randrange(1, 4),
                    ).encode()
                else:
                    content = changed_bytes(content, chance)
            new.writestr(name, content)
    return out.getvalue()


MATLAB = tuple(
    (name,)
    for name in (
        "run.P",
        "run.sensor.F",
        "y[:,1]",
        "y[3:4]",
        "train[1].t",
        "runs[1].inner.eps",
        "cube[:,1,1]",
        "flags",
        "z",
        "run",
        "run.note",
        "log",
    )
)
FORMATS = {
    "csv": (("t", "P"), (0, 1), ("F",), ("zz",), (9,)),
    "xlsx": (("t", "P"), (0, 1), ("F",), ("zz",), (0, 3)),
    "mat": MATLAB,
    "4.mat": (("P", "t"), ("note",), ("z",)),
    "packed.mat": MATLAB,
    "hdf5": (
        ("run/P", "run/t"),
        ("run/F",),
        ("run",),
        ("no",),
        ("run/packed",),
        ("run/text",),
        ("run/none",),
    ),
    "tdms": (("run/P", "run/t"), ("no/P",)),
    **dict.fromkeys(OTHER_BOOKS, (("t", "P"), (0, 1))),
    "lvm": (("X_Value", "P"), ("Comment",), (0, 2)),
    "npz": (("t", "P"), ("y[:,1]",), ("o",)),
    "parquet": (("t", "P"), ("o",)),
}


def attempt(chance, number, folder):
    """Try a file of any format."""
    return attempt_of(
        chance.choice(["csv", "csv", "csv", "xlsx", *FORMATS]),
        chance,
        number,
        folder,
    )


def only(*kinds):
    """Return what tries files of some formats."""
    return lambda chance, number, folder: attempt_of(chance.choice(kinds), chance, number, folder)


def attempt_of(kind, chance, number, folder):
    """Write a file and read it; a table has finite rows, as many as its columns, or is refused."""
    reader = READERS["xlsx" if kind in OTHER_BOOKS else kind.rsplit(".", 1)[-1]]
    whole = text(chance) if kind == "csv" else binary(kind)
    if kind in ("xlsx", "ods") and chance.random() < 0.7:
        whole = changed_members(whole, chance)
    elif "mat" in kind and chance.random() < 0.7:
        whole = changed_matlab(whole, chance, kind)
    elif kind != "csv" and chance.random() < 0.95:
        whole = changed_bytes(whole, chance)
    path = folder / f"log.{kind}"
    path.write_bytes(whole)
    columns = chance.choice(FORMATS[kind])
    request = TableRequest(
        "log",
        columns,
        header=chance.choice([1, 1, 1, 0, 2]),
        skip_rows=chance.choice([0, 0, 0, 1, 3]),
        delimiter=chance.choice([",", ";", "tab", "whitespace"]),
        decimal=chance.choice([".", ".", ","]),
        encoding=chance.choice(["utf-8", "utf-8", "latin-1", "utf-16"]),
        sheet=chance.choice([None, None, "S*", "a"]) if reader.name == "xlsx" else None,
        root=chance.choice([None, None, "run", "train[*]"])
        if "mat" in kind or kind == "hdf5"
        else None,
        incomplete=chance.random() < 0.3,
    )
    if number % 5 == 0 and reader.peek is not None:
        with suppress(MapmoreError):
            list(reader.peek(path, 200))
    try:
        found = reader.read(path, request)
    except MapmoreError as error:
        return refused(error)
    for one in found:
        if any(
            len(values) != len(one.rows) or values.dtype != np.float64
            for values in one.columns.values()
        ):
            raise Fault(f"{kind}: columns of other lengths than the rows")
    return "read"


def warm(_folder):
    for kind in FORMATS:
        binary(kind)
    for reader in READERS.values():
        with suppress(MapmoreError):
            reader.read(Path("none"), TableRequest("log", (0,)))


TARGET = Target(
    "recordings",
    attempt,
    past=("read",),
    library="libhdf5",
    warm=warm,
)
BINARY = tuple(
    Target(
        name,
        only(*kinds),
        past=("read",),
        library=library,
        warm=warm,
    )
    for name, library, *kinds in (
        ("MATLAB files", None, "mat", "packed.mat", "4.mat"),
        ("workbooks", None, "xlsx", *OTHER_BOOKS),
        ("LabVIEW texts", None, "lvm"),
        ("NumPy archives", None, "npz"),
        ("Parquet files", None, "parquet"),
        ("TDMS files", None, "tdms"),
        ("HDF5 files", "libhdf5", "hdf5"),
    )
)
"""Formats one by one; but for HDF5 files, no input may end the process."""
