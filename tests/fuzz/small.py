"""Small files that are made to take long: each declares, repeats or packs far more than it holds.
Every one is read, looked at as `init` does, or refused within ten seconds of processor time.
"""

import gzip
import io
import os
import sys
import zipfile
import zlib
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import scipy.io
from driver import Fault, Target, refused
from pyarrow import parquet

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "storage" / "readers"))

from reading import ODS, workbook
from test_lvm_reader import FIRST, HEAD

from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.storage.readers import READERS, TableRequest

LONGEST, SMALL = 10.0, 20_000  # seconds, bytes


def count(chance):
    """A number of rows, columns or elements, from few to more than there can be."""
    return chance.choice([1, 3, 100, 10**4, 10**6, 2**20, 10**7, 10**9, 2**31, 10**12])


def zipped(path, **members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def npz(chance, path):
    kind = chance.choice(["<U0", "|S0", "|V0", "|S1", "<U1", "|i1", "<f8", "<c16"])
    described = chance.choice([repr(kind), f"[('F', '{kind}'), ('G', '<f8')]"])
    shape = tuple(count(chance) for _ in range(chance.choice([1, 1, 2, 3])))
    if chance.random() < 0.2:
        shape = (0, *shape)
    header = f"{{'descr': {described}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    header += b" " * (-(len(header) + 11) % 64) + b"\n"
    content = bytes(chance.choice([0, 8, 10**4, 10**7])).replace(
        b"\0", chance.choice([b"1", b"\0"])
    )
    magic = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little")
    zipped(path, **{"F.npy": magic + header + content})


def xlsx(chance, path):
    book = workbook(path, a=[["t", "F"], *([i, i] for i in range(9))])
    book.save(path)
    far = chance.choice(["A1048576", "XFD1", "XFD1048576", "C500000", "ZZ9999", "B3"])
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    sheet = parts["xl/worksheets/sheet1.xml"].decode()
    match chance.randrange(4):
        case 0:
            sheet = sheet.replace('ref="A1:B10"', f'ref="A1:{far}"')
        case 1:
            row = "".join(letter for letter in far if letter.isdigit())
            sheet = sheet.replace(
                "</sheetData>", f'<row r="{row}"><c r="{far}"><v>1</v></c></row></sheetData>'
            )
        case 2:
            ranges = f'<mergeCell ref="A1:{far}"/>' * chance.choice([1, 1000, 100_000])
            sheet = sheet.replace("</sheetData>", f"</sheetData><mergeCells>{ranges}</mergeCells>")
        case _:
            row = '<row><c><f>1</f></c><c t="e"><v>#N/A</v></c></row>'
            sheet = sheet.replace("</sheetData>", row * chance.choice([9, 10**5]) + "</sheetData>")
    zipped(path, **parts | {"xl/worksheets/sheet1.xml": sheet})


def ods(chance, path):
    value = chance.choice(
        [
            "",
            'office:value-type="float" office:value="1"',
            'table:formula="of:=1/0"',
            'table:number-rows-spanned="1000000" table:number-columns-spanned="1000"',
        ]
    )
    cell = f'<table:table-cell table:number-columns-repeated="{count(chance)}" {value}/>'
    row = f'<table:table-row table:number-rows-repeated="{count(chance)}">{cell}</table:table-row>'
    mime = "application/vnd.oasis.opendocument.spreadsheet"
    text = ODS.format(row * chance.choice([1, 2, 10**4]))
    zipped(path, **{"mimetype": mime, "META-INF/manifest.xml": "<manifest/>", "content.xml": text})


def hdf5(chance, path):
    kind = chance.choice(["f8", "i1", "S1", "S1000", h5py.string_dtype(), "f8,f8"])
    shape = tuple(min(count(chance), 2**40) for _ in range(chance.choice([1, 1, 2])))
    with h5py.File(path, "w") as file, suppress(ValueError, OSError):
        chunks = tuple(min(length, 10**4) for length in shape) if chance.random() < 0.5 else None
        file.create_dataset("F", shape, kind, chunks=chunks)


def parquet_file(chance, path):
    n = min(count(chance), 3 * 10**6)
    column = chance.choice([pa.nulls(n), pa.array(np.zeros(n)), pa.array(np.zeros(n, "i1"))])
    if chance.random() < 0.3:
        column = column.cast(pa.decimal128(5, 2))
    parquet.write_table(pa.table({"F": column}), path)


def mat(chance, path):
    stream, n = io.BytesIO(), min(count(chance), 10**6)
    value = chance.choice([np.zeros(n, "i1"), np.zeros(min(n, 10**4), object), "1" * n])
    scipy.io.savemat(stream, {"F": value}, do_compression=True)
    whole = stream.getvalue()
    if chance.random() < 0.5:  # another size is declared
        part = bytearray(zlib.decompress(whole[136:]))
        part[32:36] = (count(chance) & 0xFFFFFFFF).to_bytes(4, "little")
        packed = zlib.compress(bytes(part))
        whole = whole[:132] + len(packed).to_bytes(4, "little") + packed
    path.write_bytes(whole)


def text(chance, path):
    """Lines that are packed a thousandfold."""
    rows = chance.choice(["1,2\n", "1\n", ",,,,\n", "\n", '"\n', "1" * 10**5 + "\n", "a,b\n"])
    content = "t,F\n" + rows * (chance.choice([10, 10**6, 8 * 10**6]) // len(rows))
    path.write_bytes(gzip.compress(content.encode()))


def lvm(chance, path):
    rows = chance.choice(["0.1\t1\t2\n", "***End_of_Header***\n", "Channels\t1\n", FIRST])
    content = HEAD + FIRST + rows * (chance.choice([10, 10**5, 4 * 10**6]) // len(rows))
    path.write_bytes(gzip.compress(content.encode()))


MAKERS = {
    "npz": npz,
    "xlsx": xlsx,
    "ods": ods,
    "hdf5": hdf5,
    "parquet": parquet_file,
    "mat": mat,
    "csv": text,
    "lvm": lvm,
}
FREQUENT = ("npz", "hdf5", "mat")  # the others take a hundred times as long to make or to read


def processor_time():
    return sum(os.times()[:4])


def attempt(chance, _number, folder):
    """Make a file of some format, and read it, or look at it."""
    kind = chance.choice([*MAKERS, *FREQUENT * 3])
    path = folder / f"log.{kind}"
    MAKERS[kind](chance, path)
    size = path.stat().st_size
    if size > SMALL:
        return "not small"
    reader = READERS["xlsx" if kind == "ods" else kind]
    column = chance.choice(["F", 0] if reader.by_index else ["F"])
    request = TableRequest(
        "log",
        (column,),
        incomplete=chance.random() < 0.5,
        header=chance.choice([0, 1]),
        clocks=frozenset([column] if chance.random() < 0.2 else []),
    )
    begun = processor_time()
    try:
        list(reader.peek(path, 200)) if chance.random() < 0.3 else reader.read(path, request)
        outcome = "read"
    except MapmoreError as error:
        outcome = refused(error)
    if (took := processor_time() - begun) > LONGEST:
        raise Fault(f"{kind} of {size} bytes: {took:.0f} s")
    return outcome


TARGET = Target("small files", attempt, past=("read",), longest=20)
