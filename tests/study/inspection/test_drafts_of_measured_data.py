"""The table of what `init` proposes for measured data holds: quick folders are tried here, `docs/drafted_tables.py` tries all."""

from __future__ import annotations

from pathlib import Path

import drafted_tables
import pytest
from pages import read_rows

from mapmore_cli.fitting import searching
from mapmore_cli.modelling.search.families import FAMILIES
from mapmore_cli.storage.readers import reader_of
from mapmore_cli.study.drafting import proof
from mapmore_cli.study.drafting.groups import find_groups, second_of

ROWS = [tuple(row) for row in read_rows(drafted_tables.PAGE, "drafts")[1:]]


@pytest.mark.parametrize("name", [pytest.param("festo_datasheet", marks=pytest.mark.long), "pgm_mckibben", "festo_fmax_by_length"])
def test_the_page_says_what_is_proposed(measured_data: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(searching, "FAMILIES", FAMILIES)
    monkeypatch.setattr(proof, "BUDGET", 60.0)  # no structure is cut off on a busy machine
    rows = drafted_tables.rows_of(measured_data / name)
    assert rows
    assert [row for row in ROWS if row[0] == name] == rows


FOLDERS = sorted({folder for folder, said, spec, *_ in ROWS if said == "nothing" and spec != "-"})


NOTES = ("ReadMe.txt", "Load Cell Calibration Equations.txt", "peer_sysidentpy.json")
"""Files that are no recordings."""


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
        rows = [row for row in ROWS if row[:2] == (folder.name, "nothing") and not row[2].endswith("-hysteresis")]
        assert len(rows) == len(groups) - len(seconds), folder
        assert all("held out" in row[8] or "training" in row[8] for row in rows)
