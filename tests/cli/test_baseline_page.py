"""A row of docs/baselines.md that shipped data give; `docs/baseline_tables.py` makes all of
them.
"""

from pathlib import Path

import baseline_tables
import pytest
from cli_samples import PROJECT, held_out
from page_tables import DOCS, numbers, page_table


@pytest.mark.long
def test_the_page_says_what_a_gaussian_process_gets(tmp_path, document):
    pytest.importorskip("sklearn")
    printed = numbers(page_table("baselines", DOCS / "baselines.md")["peano-static"])
    names = ("sarosi", "gaussian_process")
    against = f"validate.against=[{', '.join(names)}]"
    spec = PROJECT / "configs" / "m2" / "peano-static.yaml"
    scores = held_out(document("validate", spec, "--runs", tmp_path, "-q", "--set", against))
    for name in ("mapmore", *names):
        assert 100 * scores[name]["nrmse"] == pytest.approx(printed[name], rel=0.02)


@pytest.mark.parametrize("study", ["m1/peano-m1-static", "m1/peano-m1-hysteresis"])
def test_polynomials_beside_the_studies_of_papers(study, tmp_path):
    """One that pieces win and one that they lose; every study has its row, and the note counts
    them.
    """
    page, names = DOCS / "baselines.md", baseline_tables.POLYNOMIALS
    rows = {name: numbers(row) for name, row in page_table("polynomials", page).items()}
    assert [*rows] == [Path(path).name for path in baseline_tables.studies_of_papers()]
    found = baseline_tables.beside(study, tmp_path)
    row = rows[Path(study).name]
    for model in ("mapmore", *names):
        assert found[model] == pytest.approx(row[model], rel=0.01)
    ahead = sum(min(row[name] for name in names) < row["mapmore"] for row in rows.values())
    assert f"ahead of mapmore in {ahead} of {len(rows)} studies" in page.read_text()
