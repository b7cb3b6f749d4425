"""Tables in which something was changed: every number that is read is the one that the cell says,
or the table is refused.

What a cell says is found here again: by a parser of RFC 4180 and a regular expression of a number
in ASCII digits.
"""

import io
import math
import re
import sys
from datetime import datetime, time, timedelta
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
import pyarrow as pa
from driver import Fault, Target, changed_bytes, changed_text, refused
from openpyxl import Workbook
from openpyxl.cell.cell import ILLEGAL_CHARACTERS_RE
from pyarrow import parquet

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "storage" / "readers"))

from reading import other_workbook
from test_lvm_reader import HEAD

from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.pipeline.records import Sheet
from mapmore_cli.storage.readers import READERS, TableRequest

NAMES = ["t", "P", "F"]
HOSTILE = (
    *(
        "0:03:20",
        "12:00:00",
        "11:59:59 PM",
        "12:00:00:250",
        "03:20.5",
        "12:30",
        "2026-05-01 00:00:00",
        "01.05.2026",
        "5/1/2026",
    ),
    *(
        "TRUE",
        "false",
        '"20"1.2',
        '2"0',
        '"20""1"',
        "1_5",
        "0x1f",
        "1e5 N",
        "20 N",
        "5%",
        "inf",
        "-Infinity",
        "1e999",
        "1+2j",
        "2j",
    ),
    *(
        "\u0661\u0662",
        "\uff11\uff12",
        "1\u066b5",
        "\u00b2",
        "\u2212" + "5",
        "1,234.5",
        "1.234,5",
        "1 234",
        "1'234",
        "1\u00a0234",
    ),
    *("nan", "NA", "", " ", "--", "1d5", "1.2.3", "e5", "\x00", "3.5", " 7 ", "+1", ".5", "5."),
)
TYPED = (True, False, datetime(2026, 5, 1), time(0, 3, 20), timedelta(hours=3), 5, 2.5, None)
MARKS = " ,;\t\"'\n.eE+-_:/0123456789\u0661\uff12N"
DIGITS = "0123456789.-"
NOTHING = {"", "nan", "+nan", "-nan", "na", "n/a", "#n/a", "null", "none"}
INFINITE = re.compile(r"[+-]?inf(inity)?", re.I)


def said(cell, decimal=".", thousands=""):
    """The number in a cell, NaN where it says that there is none, and None where it is no number at
    all.
    """
    # a blank that does not end a line, before three digits, separates thousands in every country
    text, whole = (
        re.sub("(?<=[0-9])[\u00a0\u202f](?=[0-9]{3}(?![0-9]))", "", cell.strip()),
        "[0-9]+",
    )
    if text.lower() in NOTHING:
        return math.nan
    if INFINITE.fullmatch(text):
        return -math.inf if text.startswith("-") else math.inf
    if thousands:
        whole = rf"(?:[0-9]{{1,3}}(?:{re.escape(thousands)}[0-9]{{3}})+|[0-9]+)"
    point = re.escape(decimal)
    number = re.fullmatch(rf"([+-]?)((?:{whole})?)(?:{point}([0-9]*))?(?:[eE]([+-]?[0-9]+))?", text)
    if number is None or not (number[2] or number[3]):
        return None
    digits = number[2].replace(thousands, "") if thousands else number[2]
    return float(f"{number[1]}{digits or 0}.{number[3] or 0}e{number[4] or 0}")


def parsed(text, delimiter):
    """The records of a text; None for a field with damaged marks. Raises ValueError for a mark that
    is not closed.
    """
    place, record = 0, list[str | None]()
    while place < len(text):
        if text[place] == '"':
            found = re.compile(r'"((?:[^"]|"")*)"').match(text, place)
            if found is None:
                raise ValueError
            field = found[1].replace('""', '"')
            end = re.compile(rf"[^{re.escape(delimiter)}\r\n]*").match(text, found.end())
        else:
            end = re.compile(rf"[^{re.escape(delimiter)}\r\n]*").match(text, place)
            field = None if end is not None and '"' in end[0] else end and end[0]
        record.append(None if text[place] == '"' and end[0].strip() else field)
        place = end.end()
        if text[place : place + 1] == delimiter:
            place += 1
            if place < len(text) and text[place] not in "\r\n":
                continue
            record.append("")
        place += 2 if text[place : place + 2] == "\r\n" else 1
        yield record
        record = []


def changed(chance):
    """A table of a few rows, of which one cell or some were changed."""
    rows = [
        [f"{i / 10:.1f}", f"{chance.uniform(0, 600):.3f}", f"{chance.uniform(-9, 2000):.2f}"]
        for i in range(chance.choice([1, 2, 5, 12]))
    ]
    for _ in range(chance.choice([1, 1, 2])):
        row, place = chance.choice(rows), chance.choice([1, 2])
        row[place] = (
            chance.choice(HOSTILE)
            if chance.random() < 0.3
            else changed_text(row[place], chance, MARKS if chance.random() < 0.5 else DIGITS)
        )
    return rows


def compare(
    kind,
    rows,
    columns,
    decimal=".",
    thousands="",
):
    """Raises Fault where a number that was read is not the one that a cell says."""
    for place, name in ((1, "P"), (2, "F")):
        if len(columns[name]) != len(rows):
            raise Fault(f"{kind}: {len(columns[name])} rows of {rows}")
        for row, got in zip(rows, columns[name].tolist(), strict=True):
            cell = row[place] if place < len(row) else None
            expected = None if cell is None else said(cell, decimal, thousands)
            if expected is None or not (got == expected or (got != got and expected != expected)):
                raise Fault(f"{kind}: {cell!r} is read as {got!r}, and says {expected!r}")
    return "read"


def quoted(cell, delimiter, chance):
    if chance.random() < 0.1 or (
        chance.random() < 0.5 and any(mark in cell for mark in f'{delimiter}"\n')
    ):
        doubled = cell.replace('"', '""')
        return f'"{doubled}"'
    return cell


def of_text(chance, folder):
    delimiter, decimal, thousands = chance.choice(
        [
            (",", ".", ""),
            (",", ".", ""),
            (";", ",", ""),
            (";", ",", "."),
            (";", ".", ","),
            ("\t", ".", "'"),
        ]
    )
    rows = [
        [
            cell.replace(".", decimal) if decimal == "," and chance.random() < 0.9 else cell
            for cell in row
        ]
        for row in changed(chance)
    ]
    end = chance.choice(["\n", "\r\n"])
    text = "".join(
        delimiter.join(quoted(cell, delimiter, chance) for cell in row) + end for row in rows
    )
    if chance.random() < 0.3:
        text = changed_text(text, chance, MARKS)
    predicted = delimiter == "," and chance.random() < 0.4
    kind, label = ("predict", "table") if predicted else ("csv", "log")
    head = delimiter.join(NAMES) + end
    try:
        records = list(parsed(text, delimiter))
    except ValueError:
        records = None
    try:
        if predicted:
            sheet = Sheet(io.StringIO(head + text, newline=""), label, "P, F")
            block = list(sheet.rows)
            columns = sheet.values(block, sheet.places(["P", "F"]))
            records = records and [
                ["", "", ""] if sheet.is_blank(row) else record
                for row, record in zip(block, records, strict=True)
            ]
        else:
            path = folder / "log.csv"
            path.write_text(head + text, encoding="utf-8", newline="")
            asked = {
                "delimiter": "tab" if delimiter == "\t" else delimiter,
                "decimal": decimal,
                "thousands": thousands or None,
            }
            request = TableRequest(label, ("P", "F"), clocks=frozenset({"t"}), **asked)
            columns = READERS["csv"].read(path, request)[0].columns
            records = records and [
                record for record in records if len(record) > 1 or (record[0] or "").strip()
            ]
    except MapmoreError as error:
        return f"{kind} {refused(error)}"
    if records is None:
        raise Fault(f"{kind}: a quotation mark is left open in {text!r}")
    return f"{kind} {compare(f'{kind} {text!r}', records, columns, decimal, thousands)}"


def of_book(chance, folder):
    """Cells of a workbook are texts, numbers, or typed; only numbers are numbers."""
    book, rows = Workbook(), changed(chance)
    book.active.append(NAMES)
    expected = []
    for row in rows:
        cells = [
            float(cell)
            if chance.random() < 0.7 and re.fullmatch(r"-?[0-9]+\.[0-9]+", cell)
            else cell
            for cell in row
        ]
        if chance.random() < 0.1:
            cells[chance.choice([1, 2])] = chance.choice(TYPED)
        if any(isinstance(one, str) and ILLEGAL_CHARACTERS_RE.search(one) for one in cells):
            continue  # which no workbook holds
        book.active.append(cells)
        texts = [
            f"{float(one):.16g}"
            if isinstance(one, int | float) and not isinstance(one, bool)
            else one
            for one in cells
        ]
        expected.append(
            ["" if one is None else one if isinstance(one, str) else None for one in texts]
        )
    path = folder / "log.xlsx"
    book.save(path)
    try:
        columns = READERS["xlsx"].read(path, TableRequest("log", ("P", "F")))[0].columns
    except MapmoreError as error:
        return f"xlsx {refused(error)}"
    return f"xlsx {compare('xlsx', expected, columns)}"


def of_other_book(chance, folder):
    """Cells of an .xls or .ods file are texts or numbers."""
    rows = changed(chance)
    if any(ILLEGAL_CHARACTERS_RE.search(cell) for row in rows for cell in row):
        rows = [["0", "1.5", "2.5"]]
    cells = [
        [float(one) if re.fullmatch(r"-?[0-9]+\.[0-9]+", one) else one for one in row]
        for row in rows
    ]
    path = folder / chance.choice(["log.xls", "log.ods"])
    escaped = path.suffix == ".ods"
    other_workbook(
        path,
        [
            NAMES,
            *(
                [escape(one) if escaped and isinstance(one, str) else one for one in row]
                for row in cells
            ),
        ],
    )
    try:
        columns = READERS["xlsx"].read(path, TableRequest("log", ("P", "F")))[0].columns
    except MapmoreError as error:
        return f"{path.suffix[1:]} {refused(error)}"
    return f"{path.suffix[1:]} {compare(path.suffix, rows, columns)}"


def of_lvm(chance, folder):
    """Cells of a LabVIEW text, whose last line may have no end."""
    rows, end = changed(chance), chance.choice(["\n", "\n", ""])
    if any(mark in cell for row in rows for cell in row for mark in "\t\r\n"):
        rows = [["0", "1.5", "2.5"]]
    lines = ["\t".join(row) for row in [["X_Value", *NAMES[1:]], *rows]]
    path = folder / "log.lvm"
    body = "\n".join(lines)
    path.write_text(f"{HEAD}\nChannels\t2\n***End_of_Header***\n{body}{end}", "utf-8", newline="")
    try:
        tables = READERS["lvm"].read(path, TableRequest("log", ("P", "F")))
    except MapmoreError as error:
        return f"lvm {refused(error)}"
    if not end:  # a NUL is then padding, which the gate behind the reader reports
        rows[-1][-1] = rows[-1][-1].rstrip("\0\x1a")
    return f"lvm {compare('lvm', rows, tables[0].columns)}"


def of_arrays(chance, folder):
    """Arrays in files whose bytes were changed: checksums tell, or every value is as it was; what
    says how they are to be read has none in Parquet, where PyArrow's own reader is asked.
    """
    arrays = {name: np.array([chance.uniform(-9, 9) for _ in range(40)]) for name in NAMES}
    kind, stream = chance.choice(["npz", "parquet"]), io.BytesIO()
    if kind == "npz":
        np.savez(stream, **arrays)
    else:
        parquet.write_table(pa.table(arrays), stream, write_page_checksum=True)
    path = folder / f"log.{kind}"
    path.write_bytes(changed_bytes(stream.getvalue(), chance))
    try:
        columns = READERS[kind].read(path, TableRequest("log", ("P", "F")))[0].columns
    except MapmoreError as error:
        return f"{kind} {refused(error)}"
    if all(np.array_equal(columns[name], arrays[name]) for name in columns):
        return f"{kind} read"
    if kind == "parquet":
        table = parquet.read_table(path, columns=["P", "F"])
        if all(
            np.array_equal(columns[name], table[name].to_numpy(), equal_nan=True)
            for name in columns
        ):
            return "parquet read as its footer says"
    raise Fault(f"{kind}: other values than were written")


KINDS = ("csv", "predict", "xlsx", "xls", "ods", "lvm", "npz", "parquet")
WAYS = {0: of_book, 1: of_other_book, 2: of_lvm, 3: of_arrays}


def attempt(chance, number, folder):
    """Write a table, or take it as `predict` does, and read it."""
    return WAYS.get(number % 10, of_text)(chance, folder)


TARGET = Target(
    "tables",
    attempt,
    past=tuple(f"{kind} read" for kind in KINDS),
)
