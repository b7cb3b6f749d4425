"""The tables of docs/export.md are what their commands print."""

import shutil

import pytest
from agreement import POINTS, agreement
from common import OCTAVE
from inverse_agreement import inversion
from page_tables import DOCS, numbers, page_table
from replay import MEASURED, READERS, SIMULATED, TABLES, replayed
from test_shipped_studies import STUDIES

from mapmore_cli.storage.artefacts import read_model

PAGE, CONFIGS = DOCS / "export.md", DOCS.parent / "configs"
LIMIT = 1e-12
M2_NANOSECONDS = 50.0
LARGEST_ERROR = 1e-6


def test_every_shipped_study_agrees_by_the_page():
    rows = page_table("agreement", PAGE)
    assert 60 < sum(int(row["studies"]) for row in rows.values()) <= len(STUDIES), (
        "tests/exporting/agreement.py makes the rows"
    )
    for kind, row in rows.items():
        assert float(row["points each"]) == POINTS, kind
        assert float(row["largest relative difference"]) <= LIMIT, kind


@pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler here")
@pytest.mark.parametrize(
    "study", [pytest.param("peano-static", marks=pytest.mark.long), "dmsp-20-400-sections"]
)
def test_a_study_made_anew_is_what_the_page_says(mapmore, tmp_path, study):
    """One without memory and one with; at fewer points, so that the difference is below the page's
    or as rounding has it.
    """
    (config,) = (path for path in STUDIES if path.stem == study)
    mapmore("fuse", config, "--runs", tmp_path, "-q", code=0)
    model = read_model(tmp_path / study / "model.h5")
    found = agreement(study, model, 1500)
    assert found.kind in page_table("agreement", PAGE)
    assert found.worst <= LIMIT
    if study in page_table("inverse", PAGE):
        inverse = inversion(study, model, n=300)
        assert inverse.error < LARGEST_ERROR
        assert inverse.missed == 0


REPLAYED = [
    SIMULATED[0],
    *(pytest.param(study, marks=pytest.mark.long) for study in (*SIMULATED[1:], *MEASURED)),
]


@pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler here")
@pytest.mark.parametrize("study", REPLAYED)
def test_held_out_recordings_replayed_by_others(mapmore, tmp_path, study, request):
    """Tables differ by their grid, as the page says; everything else by rounding alone."""
    if study in MEASURED:
        request.getfixturevalue("measured_data")
    name = study.partition("/")[2]
    mapmore("fuse", CONFIGS / f"{study}.yaml", "--runs", tmp_path, "-q", code=0)
    row = numbers(page_table("replays", PAGE)[name])
    here = {
        reader: read for reader, read in READERS.items() if reader != "MATLAB by Octave" or OCTAVE
    }
    samples, found = replayed(tmp_path / name, here)
    assert samples == row["samples"]
    answered = {reader for reader, worst in found.items() if worst is not None}
    assert answered == {*row} & {*here}
    for reader in answered:
        assert (
            found[reader] == pytest.approx(row[reader], rel=0.06)
            if reader in TABLES
            else max(found[reader], row[reader]) < 1e-10
        )


def test_the_sentence_of_replays_follows_from_its_table():
    rows = [numbers(row) for row in page_table("replays", PAGE).values()]
    assert (
        max(
            row[reader]
            for row in rows
            for reader in READERS
            if reader in row and reader not in TABLES
        )
        < 1e-11
    )
    off = [row[reader] for row in rows for reader in TABLES if reader in row]
    said = f"differ by {min(off):.2f} % to {max(off):.2f} %"
    assert said in PAGE.read_text(encoding="utf-8")
