"""Blocks of lines are parsed at once where they are in order: with the result, or the error, of reading record by record."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from reading import csv_table

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import TableRequest
from mapmore_cli.storage.readers.csv import Layout, values_of_lines, values_of_records

PLAIN = "0 1.5 -2e-3 .5 1. +7 1e400 1e-400 9007199254740993 0.1000000000000000055511151231257827 nan -inf".split()  # noqa: SIM905
ODD = ["", " ", "1 5", "1\x0b", "\xa03\xa0", *'1_5 NA x 1,5 1.5.2 0x1p3 １ "2" "2 2" "a,b" 1e #1 1j Infinity'.split()]  # noqa: SIM905
CELLS = st.one_of(st.sampled_from(PLAIN), st.sampled_from(PLAIN), st.floats().map(repr), st.sampled_from(ODD), st.text(max_size=3))


def outcome(path: Path, content: bytes, *columns: int, **request: Any) -> list[list[float]] | str:
    try:
        table = csv_table(path, content, *columns, **request)
    except DataError as error:
        return str(error)
    return [table.rows.tolist(), *(table.columns[column].view(np.int64).tolist() for column in columns)]


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    lines=st.lists(st.one_of(st.lists(st.sampled_from(PLAIN), min_size=2, max_size=2), st.lists(CELLS, max_size=4)), max_size=12),
    end=st.sampled_from(["\n", "\r\n", "\r", "\n\n", "\r\r\n"]),
    asked=st.fixed_dictionaries(
        {
            "delimiter": st.sampled_from([",", ";", "tab", "whitespace", "|"]),
            "decimal": st.sampled_from([".", ","]),
            "header": st.integers(0, 2),
            "incomplete": st.booleans(),
        }
    ),
    chunk=st.integers(1, 5),
    block=st.integers(1, 40),
)
def test_blocks_give_what_records_give(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lines: list[list[str]], end: str, asked: dict[str, Any], chunk: int, block: int
) -> None:
    mark = {"tab": "\t", "whitespace": "  "}.get(asked["delimiter"], asked["delimiter"])
    rows = [mark.join(["a", "b"])] * asked["header"] + [mark.join(cells).replace(".", asked["decimal"]) for cells in lines]
    content = end.join(rows).encode("utf-8", "ignore")
    with monkeypatch.context() as patch:
        patch.setattr("mapmore_cli.storage.readers.csv.CHUNK", chunk)
        patch.setattr("mapmore_cli.storage.tables.lines.BLOCK", block)
        at_once = outcome(tmp_path / "a", content, 1, 0, **asked)
        patch.setattr("mapmore_cli.storage.readers.csv.values_of_lines", lambda *_: None)
        one_by_one = outcome(tmp_path / "a", content, 1, 0, **asked)
    assert at_once == one_by_one


@pytest.mark.parametrize(
    ("text", "dialect"),
    [
        pytest.param("1,2,x\n3.5,-4e2,y\n", {}, id="text beside the wanted columns"),
        pytest.param('"1","2","x"\n"3.5","-4e2","y"\n', {}, id="quoted"),
        pytest.param(" 1 , 2 ,x\r\n3.5,-4e2,y\r\n", {}, id="blanks"),
        pytest.param("1,0;2,0;3\n3,5;-4e2;3\n", {"delimiter": ";", "decimal": ","}, id="commas"),
        pytest.param(" 1  2 3\n3.5\t-4e2 3\n", {"delimiter": "whitespace"}, id="whitespace"),
    ],
)
def test_ordinary_lines_are_read_at_once(text: str, dialect: dict[str, str]) -> None:
    """Else nobody would notice that every file took twenty times as long."""
    request = TableRequest("a.csv", ("b", "a"), **dialect)  # type: ignore[arg-type]
    values = values_of_lines(text.splitlines(keepends=True), Layout(3, (1, 0), ("b", "a")), request)
    assert values is not None
    assert values.tolist() == [[2, 1], [-400, 3.5]]


def test_one_odd_line_costs_its_chunk_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mapmore_cli.storage.readers.csv.CHUNK", 10)
    slow = []

    def noted(records: Any, *rest: Any) -> Any:
        slow.extend(row for row, _ in records)
        return values_of_records(records, *rest)

    monkeypatch.setattr("mapmore_cli.storage.readers.csv.values_of_records", noted)
    cells = [f"{i}" for i in range(100)]
    cells[37] = ""
    table = csv_table(tmp_path / "a", ("t,F\n" + "".join(f"{i},{cell}\n" for i, cell in enumerate(cells))).encode(), "F")
    assert slow == list(range(32, 42))
    np.testing.assert_array_equal(table.columns["F"], [np.nan if i == 37 else i for i in range(100)])
    np.testing.assert_array_equal(table.rows, np.arange(2, 102))


def test_a_quoted_field_may_go_on_in_the_next_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mapmore_cli.storage.readers.csv.CHUNK", 2)
    table = csv_table(tmp_path / "a", b't,note\n1,a\n2,"b\nb\nb"\n3,c\n4,d\n5,e\n', "t")
    assert table.columns["t"].tolist() == [1, 2, 3, 4, 5]
    assert table.rows.tolist() == [2, 5, 6, 7, 8]


@pytest.mark.parametrize("suffix", ["", ".gz"])
def test_progress_is_told_in_bytes_of_the_file(tmp_path: Path, suffix: str) -> None:
    import gzip

    content = b"t\n" + b"1234567\n" * 100_000
    told: list[int] = []
    content = gzip.compress(content, mtime=0) if suffix else content
    csv_table(tmp_path / "a", content, "t", progress=told.append)
    assert len(told) > 3
    assert told == sorted(told)
    assert told[-1] == len(content)
