from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from reading import csv_table, refusal

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import SourceColumn

GOOD = b"t,P,F\n0,80,1.5\n1,81,2.5\n"


def test_empty_cells_are_missing_and_blank_lines_keep_the_count(tmp_path: Path) -> None:
    raw = csv_table(tmp_path / "a", b"t,F\n\n1,2\n \n3,\n4, nan \n5,inf", "F")
    np.testing.assert_array_equal(raw.columns["F"], [2, np.nan, np.nan, np.inf])
    np.testing.assert_array_equal(raw.rows, [3, 5, 6, 7])


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
    (tmp_path / "a").write_bytes(content)
    message = refusal(parts, "csv", tmp_path / "a", *columns, header=header)
    assert message.startswith("a.csv")
    assert message.isprintable() or message.replace("\n", "").isprintable()
    assert len(message) < 300


def test_every_cut_of_a_gz_file_is_noticed(tmp_path: Path) -> None:
    whole = gzip.compress(GOOD, mtime=0)
    for end in range(2, len(whole)):
        with pytest.raises(DataError, match="damaged"):
            csv_table(tmp_path / "a", whole[:end], "t")
