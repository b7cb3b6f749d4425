"""What holds for every reader: it is one file, tells of what is no file of its kind, and no table
is read twice where it is remembered.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reading import refusal

import mapmore_cli
from mapmore_cli.storage import tables
from mapmore_cli.storage.readers import READERS, RawTable, Reader, TableRequest
from mapmore_cli.storage.tables import read_with, remembered

TEXT_OF_BARS = '''
"""Tables whose fields are set apart by bars."""

from mapmore_cli.storage.readers.csv import read_csv
from mapmore_cli.storage.tables import Reader, Top
from dataclasses import replace


def read_bars(path, request):
    return read_csv(path, replace(request, delimiter="|"))


def peek_bars(path, most):
    rows = [line.split("|") for line in path.read_text().splitlines()[:most]]
    return [Top(rows, lambda cell: cell.replace(".", "").isdigit())]


READER = Reader("bars", read_bars, suffixes=(".bar",), keys=("header",), peek=peek_bars)
'''


def test_one_new_file_adds_a_format(tmp_path: Path) -> None:
    shutil.copytree(
        Path(mapmore_cli.__file__).parent,
        tmp_path / "mapmore_cli",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    (tmp_path / "mapmore_cli/storage/readers/bars.py").write_text(TEXT_OF_BARS)
    rows = "".join(f"{i / 100}|150|{1.5 * i}\n" for i in range(40))
    (tmp_path / "log.bar").write_text(f"strain|pressure|force\n{rows}")
    code = """
from pathlib import Path
from mapmore_cli.spec.schema import json_schema
from mapmore_cli.annexes.drafting.preview import preview
from mapmore_cli.ingestion.files import unique_ids
assert "'bars'" in str(json_schema())
assert preview(Path("log.bar")).columns == ("strain", "pressure", "force")
print(*unique_ids(["log.bar"]))
from mapmore_cli.spec.sections.logs import Logs
columns = {"time": {"column": "strain"}}
print(Logs.model_validate({"files": ["log.bar"], "reader": "bars", "columns": columns}).reader)
try:
    Logs.model_validate({"files": ["log.bar"], "reader": "bars", "columns": columns,
        "decimal": ","})
except ValueError as error:
    assert "no use for `decimal`" in str(error), error
else:
    raise AssertionError("the key was taken")
"""
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    assert done.stdout.split() == ["log", "bars"]


def test_no_two_readers_claim_a_suffix() -> None:
    suffixes = [suffix for reader in READERS.values() for suffix in reader.suffixes]
    assert len(set(suffixes)) == len(suffixes)
    assert all(suffix.startswith(".") and suffix == suffix.lower() for suffix in suffixes)


@pytest.mark.parametrize("reader", READERS)
def test_a_file_that_vanished(tmp_path: Path, reader: str) -> None:
    refusal(["cannot be read: No such file"], reader, tmp_path / "gone", 0, header=0)


@pytest.mark.parametrize(
    "content", [b"", b"t,F\n0,1\n", bytes(600), b"\x7fELF" * 100, b"\xd0\xcf\x11\xe0" + bytes(600)]
)
@pytest.mark.parametrize("reader", [name for name in READERS if name != "csv"])
def test_a_file_of_another_kind(tmp_path: Path, reader: str, content: bytes) -> None:
    (tmp_path / "a").write_bytes(content)
    assert refusal([], reader, tmp_path / "a", "g/c").startswith("a.")


@pytest.mark.parametrize(
    ("reader", "module", "library"),
    [("xlsx", "openpyxl", "openpyxl"), ("tdms", "nptdms", "npTDMS")],
)
def test_a_library_that_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reader: str, module: str, library: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    refusal(
        [
            f"a.{reader}: ",
            f"needs {library}, which is not installed",
            "pip install 'mapmore[formats]'",
        ],
        reader,
        tmp_path / "a",
        "t",
    )


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
        (again,) = read_with(
            reader, path.parent / "." / "a.csv", replace(ASKED, columns=("F",), label="rig/a.csv")
        )
    assert len(asked) == 1
    assert again.label == "rig/a.csv"
    assert list(again.columns) == ["F"]
    np.testing.assert_array_equal(again.columns["F"], [10, 20])


@pytest.mark.parametrize(
    "change",
    [
        {"columns": ("x",)},
        {"columns": ("P", "x")},
        {"incomplete": True},
        {"missing": frozenset({"-"})},
    ],
)
def test_what_was_not_read_that_way_is_read(reads: Reads, change: dict[str, object]) -> None:
    reader, path, asked = reads
    with remembered():
        read_with(reader, path, ASKED)
        (other,) = read_with(reader, path, replace(ASKED, **change))
    assert len(asked) == 2
    assert set(other.columns) == set(replace(ASKED, **change).columns)


def test_nothing_is_kept_outside_or_beyond_its_room(
    reads: Reads, monkeypatch: pytest.MonkeyPatch
) -> None:
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
