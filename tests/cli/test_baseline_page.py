"""A row of docs/baselines.md that shipped data give; `docs/baseline_tables.py` makes all of
them.
"""

from pathlib import Path

import baseline_tables
import pytest
from page_tables import DOCS, numbers, page_table


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
    assert f"{ahead} of {len(rows)} studies, the best of the three" in page.read_text()
