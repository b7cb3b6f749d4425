"""What every reader says of a file that is not there, or not what its name says, and of a library that is missing."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from reading import refusal

from mapmore_cli.storage.readers import READERS


@pytest.mark.parametrize("reader", READERS)
def test_a_file_that_vanished(tmp_path: Path, reader: str) -> None:
    refusal(["cannot be read: No such file"], reader, tmp_path / "gone", 0, header=0)


@pytest.mark.parametrize("content", [b"", b"t,F\n0,1\n", bytes(600), b"\x7fELF" * 100, b"\xd0\xcf\x11\xe0" + bytes(600)])
@pytest.mark.parametrize("reader", [name for name in READERS if name != "csv"])
def test_a_file_of_another_kind(tmp_path: Path, reader: str, content: bytes) -> None:
    (tmp_path / "a").write_bytes(content)
    assert refusal([], reader, tmp_path / "a", "g/c").startswith("a.")


@pytest.mark.parametrize(("reader", "module", "library"), [("xlsx", "openpyxl", "openpyxl"), ("tdms", "nptdms", "npTDMS")])
def test_a_library_that_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reader: str, module: str, library: str) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    refusal([f"a.{reader}: ", f"needs {library}, which is not installed", "pip install 'mapmore[formats]'"], reader, tmp_path / "a", "t")
