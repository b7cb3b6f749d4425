from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import READERS, RawTable, TableRequest
from mapmore_cli.storage.tables.table import SourceColumn

GOOD = b"t,P,F\n0,80,1.5\n1,81,2.5\n"


def read(path: Path, content: bytes, *columns: SourceColumn, header: int = 1, **dialect: Any) -> RawTable:
    path.write_bytes(content)
    (table,) = READERS["csv"].read(path, TableRequest("a.csv", columns, header, **dialect))
    return table


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    table=st.lists(st.tuples(st.floats(allow_infinity=False), st.floats(allow_infinity=False)), min_size=1, max_size=30),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
    quote=st.booleans(),
    bom=st.booleans(),
    zipped=st.booleans(),
    header=st.booleans(),
    blank=st.integers(0, 3),
)
def test_numbers_survive_every_dress_of_a_csv_file(
    tmp_path: Path, table: list[tuple[float, float]], end: str, quote: bool, bom: bool, zipped: bool, header: bool, blank: int
) -> None:
    def cell(value: float) -> str:
        return f'"{value!r}"' if quote else f" {value!r} "

    lines = ["x, y ,text"] * header + [f"{cell(x)},{cell(y)},hello" for x, y in table]
    content = (end.join(lines) + end * (1 + blank)).encode("utf-8-sig" if bom else "utf-8")
    raw = read(tmp_path / "a", gzip.compress(content) if zipped else content, *("y", 0) if header else (1, 0), header=header)
    expected = np.array(table)
    np.testing.assert_array_equal(raw.columns[0], expected[:, 0])
    np.testing.assert_array_equal(raw.columns["y" if header else 1], expected[:, 1])
    np.testing.assert_array_equal(raw.rows, np.arange(len(table)) + 1 + header)


def test_empty_cells_are_missing_and_blank_lines_keep_the_count(tmp_path: Path) -> None:
    raw = read(tmp_path / "a", b"t,F\n\n1,2\n \n3,\n4, nan \n5,inf", "F")
    np.testing.assert_array_equal(raw.columns["F"], [2, np.nan, np.nan, np.inf])
    np.testing.assert_array_equal(raw.rows, [3, 5, 6, 7])


def test_chunks_do_not_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mapmore_cli.storage.readers.csv.CHUNK", 7)
    raw = read(tmp_path / "a", "\n".join(f"{i},{i * i}" for i in range(50)).encode(), 1, header=False)
    np.testing.assert_array_equal(raw.columns[1], np.arange(50.0) ** 2)


TRUNCATED = gzip.compress(GOOD * 200)[:-20]
CORRUPT = gzip.compress(GOOD)[:-6] + b"\0\0\0\0\0\0"

HOSTILE: dict[str, tuple[bytes, bool, tuple[SourceColumn, ...], list[str]]] = {
    "text in a number column": (b"t,P\n0,80\n1,abc\n", True, ("P",), ["a.csv:row 3, column P: 'abc' is not a number"]),
    "text, no header": (b"0,80\n1,abc\n", False, (1,), ["a.csv:row 2, column 1: 'abc' is not a number"]),
    "header taken for data": (GOOD, False, (0,), ["row 1, column 0: 't' is not a number", "header"]),
    "Python's own numbers": (b"t\n1_5\n", True, ("t",), ["'1_5' is not a number"]),
    "too few fields": (b"t,P\n0,80\n1\n", True, ("P",), ["a.csv:row 3: too few fields: 1", "has 2", "cut off"]),
    "too many fields": (b"t,P\n0,80,9\n", True, ("P",), ["a.csv:row 2: too many fields: 3"]),
    "decimal comma": (b"t;F\n1,5;2,0\n", True, ("t",), ["no column 't'", "delimiter looks like a semicolon"]),
    "decimal comma, no header": (b"1,5;2,0\n", False, (1,), ["'5;2' is not a number", "delimiter looks like a semicolon"]),
    "tabs": (b"t\tF\n1\t2\n", True, ("F",), ["delimiter looks like a tab"]),
    "misspelt column": (b"time,Pressure\n0,1\n", True, ("Presure",), ["no column 'Presure'", "Did you mean 'Pressure'?", "time, Pressure"]),
    "other capitals": (b"T\n0\n", True, ("t",), ["Did you mean 'T'?"]),
    "column twice": (b"F,F\n0,1\n", True, ("F",), ["'F' stands 2 times", "index"]),
    "no such index": (GOOD, True, (3,), ["no column 3", "3 columns", "0 to 2"]),
    "name without header": (GOOD, False, ("t",), ["'t' is asked for by name", "header: true"]),
    "no header after all": (b"0,80\n1,81\n", True, ("t",), ["no column 't'", "first line holds numbers", "header: false"]),
    "empty file": (b"", True, ("t",), ["a.csv: the file is empty"]),
    "blank lines only": (b"\n\r\n  \n", True, ("t",), ["the file is empty"]),
    "header only": (b"t,P,F\n", True, ("t",), ["header but no data"]),
    "truncated gz": (TRUNCATED, True, ("t",), ["a.csv: the file is damaged", "get it again"]),
    "gz with a wrong checksum": (CORRUPT, True, ("t",), ["the file is damaged"]),
    "gz header alone": (b"\x1f\x8b", True, ("t",), ["the file is damaged"]),
    "binary": (bytes(range(256)), False, (0,), ["not a text file in UTF-8"]),
    "UTF-16": ("t,F\n1,2\n".encode("utf-16"), True, ("t",), ["not a text file in UTF-8"]),
    "latin-1 header": ("t,°C\n1,2\n".encode("latin-1"), True, ("t",), ["not a text file in UTF-8", "0xb0"]),
    "zero bytes": (b"\0" * 64, False, (0,), ["is not a number"]),
    "quotation mark never closed": (b't,F\n1,"2\n' + b"3,4\n" * 40_000, True, ("t",), ["quotation mark"]),
    "escape codes": (b"t\n\x1b[31mred\n", True, ("t",), [r"'\x1b[31mred' is not a number"]),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_files_give_one_clear_message(tmp_path: Path, case: str) -> None:
    content, header, columns, parts = HOSTILE[case]
    with pytest.raises(DataError) as caught:
        read(tmp_path / "a", content, *columns, header=header)
    message = str(caught.value)
    assert all(part in message for part in parts), message
    assert message.startswith("a.csv")
    assert message.isprintable() or message.replace("\n", "").isprintable()
    assert len(message) < 300


def test_every_cut_of_a_gz_file_is_noticed(tmp_path: Path) -> None:
    whole = gzip.compress(GOOD, mtime=0)
    for end in range(2, len(whole)):
        with pytest.raises(DataError, match="damaged"):
            read(tmp_path / "a", whole[:end], "t")


def test_file_that_vanished(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="cannot be read"):
        READERS["csv"].read(tmp_path / "gone.csv", TableRequest("gone.csv", (0,), header=0))
