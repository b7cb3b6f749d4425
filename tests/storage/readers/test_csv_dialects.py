"""What loggers and spreadsheets write, one row for each dialect: the same three samples in every dress."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from reading import csv_table, refusal

from mapmore_cli.storage.readers.csv import DELIMITERS

EXPECTED = np.array([[0.0, 1.5], [0.5, -2000.25], [1.0, np.nan]])
NAMES: tuple[str | int, ...] = ("t", "F")
PLACES: tuple[str | int, ...] = (0, 1)

DIALECTS: dict[str, tuple[str, str, tuple[str | int, ...], dict[str, Any]]] = {
    "German spreadsheet": ("t;F\r\n0,0;1,5\r\n0,5;-2000,25\r\n1,0;\r\n", "utf-8", NAMES, {"delimiter": ";", "decimal": ","}),
    "its byte order mark": ("t;F\r\n0,0;1,5\r\n0,5;-2000,25\r\n1,0;\r\n", "utf-8-sig", NAMES, {"delimiter": ";", "decimal": ","}),
    "tabs": ("t\tF\n0\t1.5\n.5\t-2.00025e3\n1\t\n", "utf-8", NAMES, {"delimiter": "tab"}),
    "one tab": ("t\tF\n0\t1.5\n.5\t-2.00025e3\n1\t\n", "utf-8", NAMES, {"delimiter": "\t"}),
    "columns of blanks": ("   t      F\n 0.0    1.5\n 0.5  -2000.25\n 1.0  NaN\n", "utf-8", NAMES, {"delimiter": "whitespace"}),
    "blanks and commas": ("t F\n0,0 1,5\n0,5 -2000,25\n1,0 nan\n", "utf-8", NAMES, {"delimiter": "whitespace", "decimal": ","}),
    "tabs among blanks": ("\tt \t F\n0\t1.5\n\n.5 \t -2000.25\n1 n/a", "utf-8", NAMES, {"delimiter": "whitespace"}),
    "bars": ("t|F\n0|1.5\n.5|-2000.25\n1|NA\n", "utf-8", NAMES, {"delimiter": "|"}),
    "names and units": ("t,F\n(s),(N)\n0,1.5\n.5,-2000.25\n1,\n", "utf-8", NAMES, {"header": 2}),
    "names, units, blank": ("t,F\n(s),(N)\n\n0,1.5\n.5,-2000.25\n1,\n", "utf-8", NAMES, {"header": 3}),
    "preamble": ("Rig 7\n\nrun, by, hand, 4\nt,F\n0,1.5\n.5,-2000.25\n1,\n", "utf-8", NAMES, {"skip_rows": 3}),
    "preamble, no names": ("Rig 7\n#\n0,1.5\n.5,-2000.25\n1,\n", "utf-8", PLACES, {"skip_rows": 2, "header": 0}),
    "preamble, units": ("°µ\nt,F\ns,N\n0,1.5\n.5,-2000.25\n1,\n", "latin-1", NAMES, {"skip_rows": 1, "header": 2, "encoding": "latin-1"}),
    "old Mac": ("t,F\r0,1.5\r.5,-2000.25\r1,", "utf-8", NAMES, {}),
    "twice returned": ("t,F\r0,1.5\r\r.5,-2000.25\r\r1,\r\r", "utf-8", NAMES, {}),
    "returned and ended": ("t,F\r\r\n0,1.5\r\r\n.5,-2000.25\r\r\n1,\r\r\n", "utf-8", NAMES, {}),
    "quotation marks": ('"t","F"\n"0","1.5"\n"0.5","-2000.25"\n"1.0",""\n', "utf-8", NAMES, {}),
    "delimiter at the end": ("t,F\n0,1.5,\n.5,-2000.25,\n1,,\n", "utf-8", NAMES, {}),
    "UTF-16": ("t,F\n0,1.5\n.5,-2000.25\n1,\n", "utf-16", NAMES, {"encoding": "utf-16"}),
    "cp1252 header": ("t,F,°C – €\n0,1.5,\n.5,-2000.25,x\n1,,\n", "cp1252", NAMES, {"encoding": "cp1252"}),
    "header on the first record": ("t,F0,9\n0,1.5\n.5,-2000.25\n1,\n", "utf-8", PLACES, {"skip_rows": 1, "header": 0}),
    "closing remark": ("t,F\n0,1.5\n.5,-2000.25\n1,\nLogging end\n", "utf-8", NAMES, {"incomplete": True}),
    "half a record at the end": ("t,F\n0,1.5\n.5,-2000.25\n1,\n1.", "utf-8", NAMES, {"incomplete": True}),
}  # fmt: skip


@pytest.mark.parametrize("zipped", [False, True], ids=["plain", "gz"])
@pytest.mark.parametrize("name", DIALECTS)
def test_dialects(tmp_path: Path, name: str, zipped: bool) -> None:
    text, encoding, columns, dialect = DIALECTS[name]
    content = text.encode(encoding)
    table = csv_table(tmp_path / "a", gzip.compress(content) if zipped else content, *columns, **dialect)
    got = np.array([table.columns[column] for column in columns]).T
    np.testing.assert_array_equal(got[:3], EXPECTED)
    assert np.isnan(got[3:]).all()


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    values=st.lists(st.tuples(st.floats(allow_infinity=False), st.floats(allow_infinity=False)), min_size=1, max_size=20),
    dialect=st.fixed_dictionaries(
        {
            "delimiter": st.sampled_from([",", ";", "|", "\t", ":", "whitespace", "tab"]),
            "decimal": st.sampled_from([".", ","]),
            "skip_rows": st.integers(0, 3),
            "header": st.integers(0, 3),
        }
    ),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
    blank=st.integers(1, 4),
    flags=st.tuples(st.booleans(), st.booleans(), st.booleans()),
)
def test_numbers_and_their_rows_survive_every_dress(
    tmp_path: Path,
    values: list[tuple[float, float]],
    dialect: dict[str, Any],
    end: str,
    blank: int,
    flags: tuple[bool, bool, bool],
) -> None:
    delimiter, decimal, skipped, header = (dialect[key] for key in ("delimiter", "decimal", "skip_rows", "header"))
    quoted, bom, zipped = flags
    mark = {"whitespace": "   ", **DELIMITERS}.get(delimiter, delimiter)
    quote = '"' if (quoted and delimiter != "whitespace") or mark == decimal else ""

    def cell(value: float) -> str:
        return f"{quote}{value!r}{quote}".replace(".", decimal)

    lines = ["anything at all"] * skipped + [mark.join(["x", " y ", "text"])] * header
    lines += [mark.join([cell(x), cell(y), "hello"]) for x, y in values]
    content = (end.join(lines) + blank * end).encode("utf-8-sig" if bom else "utf-8")
    columns: tuple[str | int, ...] = ("y", 0) if header else (1, 0)
    table = csv_table(tmp_path / "dressed.csv", gzip.compress(content) if zipped else content, *columns, **dialect)
    np.testing.assert_array_equal(table.columns[0], [x for x, _ in values])
    np.testing.assert_array_equal(table.columns[columns[0]], [y for _, y in values])
    np.testing.assert_array_equal(table.rows, skipped + header + 1 + np.arange(len(values)))


WRONG: dict[str, tuple[bytes, dict[str, Any], list[str]]] = {
    "thousands or decimals": (b"t;F\n0;1.500\n", {"delimiter": ";", "decimal": ","}, ["a.csv:row 2, column F: '1.500'", 'decimal: "."']),
    "commas unannounced": (b"t;F\n0;1,5\n", {"delimiter": ";"}, ["a.csv:row 2, column F: '1,5' is not a number", 'decimal: ","']),
    "wrong delimiter": (b"t;F\n0;1\n", {}, ["delimiter looks like a semicolon", 'delimiter: ";"']),
    "wrong delimiter, tabs": (b"t\tF\n0\t1\n", {}, ["delimiter: tab"]),
    "closing remark": (b"t,F\n0,1\nLogging end\n", {}, ["a.csv:row 3: too few fields: 1", "missing: drop"]),
    "nothing after the skipped lines": (b"t,F\n0,1\n", {"skip_rows": 5}, ["the file is empty"]),
    "nothing after the header lines": (b"t,F\n0,1\n", {"header": 2}, ["header but no data"]),
    "not UTF-16": (b"t,F\n0,1\n", {"encoding": "utf-16"}, ["not a text file in UTF-16"]),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_wrong_dialects_are_named(tmp_path: Path, case: str) -> None:
    content, dialect, parts = WRONG[case]
    (tmp_path / "a").write_bytes(content)
    refusal(parts, "csv", tmp_path / "a", *NAMES, **dialect)
