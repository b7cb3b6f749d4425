"""What holds for every reader: it is one file, and tells of what is no file of its kind."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from reading import refusal

import mapmore_cli
from mapmore_cli.storage.readers import READERS

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


def test_one_new_file_adds_a_format(tmp_path):
    shutil.copytree(
        Path(mapmore_cli.__file__).parent,
        tmp_path / "mapmore_cli",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    (tmp_path / "mapmore_cli/storage/readers/bars.py").write_text(TEXT_OF_BARS)
    template = (
        Path(__file__).resolve().parents[3] / "docs/examples/plugin/mapmore_template/reader.py"
    )
    shutil.copy(template, tmp_path / "mapmore_cli/storage/readers/json_lines.py")
    records = "".join(f'{{"eps": {i / 100}, "P": 150, "who": "me", "F": {i}}}\n' for i in range(40))
    (tmp_path / "log.jsonl").write_text(records)
    rows = "".join(f"{i / 100}|150|{1.5 * i}\n" for i in range(40))
    (tmp_path / "log.bar").write_text(f"strain|pressure|force\n{rows}")
    code = """
from pathlib import Path
from mapmore_cli.study.schema import json_schema
from mapmore_cli.annexes.drafting.preview import preview
from mapmore_cli.ingestion.files import unique_ids
assert "'bars'" in str(json_schema())
assert preview(Path("log.bar")).columns == ("strain", "pressure", "force")
assert preview(Path("log.jsonl")).columns == ("eps", "P", "F")
print(*unique_ids(["log.bar"]))
from mapmore_cli.study.sections.logs import Logs
columns = {"time": {"column": "strain"}}
print(Logs.model_validate({"files": ["log.bar"], "reader": "bars", "columns": columns}).reader)
try:
    Logs.model_validate({"files": ["log.bar"], "reader": "bars", "columns": columns,
        "decimal": ","})
except ValueError as error:
    assert "cannot use `decimal`" in str(error), error
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


def test_no_two_readers_claim_a_suffix():
    suffixes = [suffix for reader in READERS.values() for suffix in reader.suffixes]
    assert len(set(suffixes)) == len(suffixes)
    assert all(suffix.startswith(".") and suffix == suffix.lower() for suffix in suffixes)


@pytest.mark.parametrize("reader", READERS)
def test_a_file_that_vanished(tmp_path, reader):
    refusal(["cannot be read: No such file"], reader, tmp_path / "gone", 0, header=0)


@pytest.mark.parametrize(
    "content", [b"", b"t,F\n0,1\n", bytes(600), b"\x7fELF" * 100, b"\xd0\xcf\x11\xe0" + bytes(600)]
)
@pytest.mark.parametrize("reader", [name for name in READERS if name != "csv"])
def test_a_file_of_another_kind(tmp_path, reader, content):
    (tmp_path / "a").write_bytes(content)
    assert refusal([], reader, tmp_path / "a", "g/c").startswith("a.")


@pytest.mark.parametrize(
    ("reader", "module", "library"),
    [
        ("xlsx", "python_calamine", "python-calamine"),
        ("tdms", "nptdms", "npTDMS"),
    ],
)
def test_a_library_that_is_missing(tmp_path, monkeypatch, reader, module, library):
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
