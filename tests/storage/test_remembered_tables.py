"""Tables that are remembered are those that were read, under the names that are asked for, and only within."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mapmore_cli.storage import tables
from mapmore_cli.storage.readers import READERS, RawTable, Reader, TableRequest
from mapmore_cli.storage.tables import read_with, remembered

Reads = tuple[Reader, Path, list[TableRequest]]
ASKED = TableRequest("a.csv", ("P", "F"))


@pytest.fixture
def reads(tmp_path: Path) -> Reads:
    """The reader of text, a file, and a list of what was really read."""
    (tmp_path / "a.csv").write_text("P,F,x\n1,10,5\n2,20,6\n")
    asked: list[TableRequest] = []

    def read(path: Path, request: TableRequest) -> list[RawTable]:
        asked.append(request)
        return READERS["csv"].read(path, request)

    return replace(READERS["csv"], read=read), tmp_path / "a.csv", asked


def test_a_table_is_read_once_and_named_as_asked(reads: Reads) -> None:
    reader, path, asked = reads
    with remembered():
        read_with(reader, path, ASKED)
        (again,) = read_with(reader, path.parent / "." / "a.csv", replace(ASKED, columns=("F",), label="rig/a.csv"))
    assert len(asked) == 1
    assert again.label == "rig/a.csv"
    assert list(again.columns) == ["F"]
    np.testing.assert_array_equal(again.columns["F"], [10, 20])


@pytest.mark.parametrize("change", [{"columns": ("x",)}, {"columns": ("P", "x")}, {"incomplete": True}, {"missing": frozenset({"-"})}])
def test_what_was_not_read_that_way_is_read(reads: Reads, change: dict[str, object]) -> None:
    reader, path, asked = reads
    with remembered():
        read_with(reader, path, ASKED)
        (other,) = read_with(reader, path, replace(ASKED, **change))
    assert len(asked) == 2
    assert set(other.columns) == set(replace(ASKED, **change).columns)


def test_nothing_is_kept_outside_or_beyond_its_room(reads: Reads, monkeypatch: pytest.MonkeyPatch) -> None:
    reader, path, asked = reads
    with remembered():
        read_with(reader, path, ASKED)
    read_with(reader, path, ASKED)
    read_with(reader, path, ASKED)
    assert len(asked) == 3
    monkeypatch.setattr(tables, "MOST_NUMBERS", 5)
    with remembered():
        read_with(reader, path, ASKED)
        read_with(reader, path, ASKED)
    assert len(asked) == 5


def test_a_tree_is_read_anew_for_other_arrays(reads: Reads) -> None:
    """There the shortest of the wanted arrays ends the table."""
    reader, path, asked = reads
    with remembered():
        for columns in (("P", "F"), ("F",), ("P", "F")):
            read_with(replace(reader, keys=("root",)), path, replace(ASKED, columns=columns))
    assert len(asked) == 2
