"""The table of what `init` proposes for measured data holds: quick folders are tried here, `docs/drafted_tables.py` tries all."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

from mapmore_cli.storage.readers import reader_of
from mapmore_cli.study.drafting import proof
from mapmore_cli.study.drafting.groups import find_groups
from mapmore_cli.study.drafting.second_logs import second_of

DOCS = Path(__file__).parents[3] / "docs"
PAGE = (DOCS / "init-and-check.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["festo_datasheet", "pgm_mckibben", "festo_fmax_by_length"])
def test_the_page_says_what_is_proposed(measured_data: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proof, "BUDGET", 60.0)  # no structure is cut off on a busy machine
    spec = importlib.util.spec_from_file_location("drafted_tables", DOCS / "drafted_tables.py")
    assert spec is not None
    assert spec.loader is not None
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    rows = tables.rows_of(measured_data / name)
    assert rows
    for row in rows:
        assert row in PAGE


FOLDERS = sorted(set(re.findall(r"^\| `(\w+)` \| nothing \| `", PAGE, flags=re.MULTILINE)))


NOTES = ("ReadMe.txt", "Load Cell Calibration Equations.txt")
"""Files of text that are no recordings."""


def test_every_recording_is_in_a_study_of_the_page(measured_data: Path) -> None:
    """No file of a folder that the page names is left out; every study has a row, that of a hysteresis besides."""
    assert len(FOLDERS) >= 9
    for folder in (measured_data / name for name in FOLDERS):
        groups, left_out = find_groups(folder)
        groups = [group for group in groups if not any(file.name in NOTES for file in group.files)]
        assert all(any(note in remark for note in NOTES) for remark in left_out), folder
        beside = [group.beside for group in groups if group.beside is not None]
        assert {file for group in (*groups, *beside) for file in group.files} == {
            file for file in folder.rglob("*") if reader_of(file) and file.name not in NOTES
        }
        seconds = {second.files for group in groups if (second := second_of(group, groups)) is not None}
        rows = [line for line in PAGE.splitlines() if line.startswith(f"| `{folder.name}` | nothing | `") and "-hysteresis`" not in line]
        assert len(rows) == len(groups) - len(seconds), folder
        assert all("held out" in row or "training" in row for row in rows)
