"""Files read as a spec asks for them, under the name `a.SUFFIX`; and refusals with all that they
have to say.
"""

import zipfile
from contextlib import contextmanager
from struct import pack

import h5py
import numpy as np
import pytest
import scipy.io

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import READERS, TableRequest

SUFFIXES = {"hdf5": "h5"}


def tables_of(reader, path, *columns, **request):
    """The recordings of a file."""
    return READERS[reader].read(
        path, TableRequest(f"a.{SUFFIXES.get(reader, reader)}", columns, **request)
    )


def table_of(reader, path, *columns, **request):
    """The one recording of a file."""
    (table,) = tables_of(reader, path, *columns, **request)
    return table


def csv_table(path, content, *columns, **request):
    """What is read of some text."""
    path.write_bytes(content)
    return table_of("csv", path, *columns, **request)


@contextmanager
def refused(*parts, error=DataError):
    """An error is raised whose message and remedy have all of the `parts`."""
    with pytest.raises(error) as caught:
        yield caught
    message = str(caught.value)
    assert all(part in message for part in parts), message


def refusal(parts, reader, path, *columns, **request):
    """The message of the error with which a file is refused, which has all of the `parts`."""
    with refused(*parts) as caught:
        tables_of(reader, path, *columns, **request)
    return str(caught.value)


def workbook(path, **sheets):
    """A workbook of sheets with such rows, which can be changed further."""
    made = pytest.importorskip("openpyxl").Workbook()
    made.remove(made.active)
    for title, rows in sheets.items():
        sheet = made.create_sheet(title)
        for row in rows:
            sheet.append(row)
    made.save(path)
    return made


ODS = """<office:document-content xmlns:office="urn:oasis:names:tc:opendocument:xmlns:office:1.0"
xmlns:table="urn:oasis:names:tc:opendocument:xmlns:table:1.0"
xmlns:text="urn:oasis:names:tc:opendocument:xmlns:text:1.0"><office:body><office:spreadsheet>
<table:table table:name="a">{}</table:table></office:spreadsheet></office:body>
</office:document-content>"""


def other_workbook(path, rows):
    """A workbook of the sheet `a` as an older Excel or LibreOffice writes it."""
    if path.suffix == ".xls":
        book = pytest.importorskip("xlwt").Workbook()
        sheet = book.add_sheet("a")
        for row, cells in enumerate(rows):
            for column, cell in enumerate(cells):
                sheet.write(row, column, cell)
        book.save(str(path))
        return
    content = "".join(
        f"<table:table-row>{''.join(map(ods_cell, row))}</table:table-row>" for row in rows
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        archive.writestr("META-INF/manifest.xml", "<manifest/>")
        archive.writestr("content.xml", ODS.format(content))


def ods_cell(cell):
    kind = '"string"' if isinstance(cell, str) else f'"float" office:value="{cell}"'
    return f"<table:table-cell office:value-type={kind}><text:p>{cell}</text:p></table:table-cell>"


def xlsb_record(kind, *numbers, value=b""):
    """A record of an .xlsb that begins with numbers of four bytes."""
    content = pack(f"<{len(numbers)}I", *numbers) + value
    head = bytes([kind]) if kind < 128 else bytes([kind & 127 | 128, kind >> 7])
    return head + bytes([len(content)]) + content


def element(kind, content):
    """An element of a MATLAB file of version 5."""
    return np.array([kind, len(content)], "<u4").tobytes() + content + b"\0" * (-len(content) % 8)


def opaque_variable(name, of_class):
    """An object as MATLAB lays it out in a file of version 7: only what a reader sees before the
    contents.
    """
    words = b"".join(element(1, word.encode()) for word in (name, "MCOS", of_class))
    numbers = element(6, np.array([13, 0], "<u4").tobytes())
    numbers += element(5, np.array([1, 1], "<i4").tobytes()) + element(1, b"")
    numbers += element(6, np.array([0xDD000000], "<u4").tobytes())
    flags = element(6, np.array([17, 0], "<u4").tobytes())
    return element(14, flags + words + element(14, numbers))


def timetable_of_73(path):
    """A file of version 7.3 with the object `log`."""
    with h5py.File(path, "w") as file:
        numbers = np.array([[0xDD000000, 2, 1, 1, 1, 1]], dtype=np.uint32)
        log = file.create_dataset("log", data=numbers)
        log.attrs["MATLAB_class"], log.attrs["MATLAB_object_decode"] = b"timetable", np.int32(3)


def opaque_mat(path, name, of_class, x):
    """A file with such an object, and the numbers `x`."""
    scipy.io.savemat(path, {"x": x})
    path.write_bytes(path.read_bytes() + opaque_variable(name, of_class))
    return path
