"""The table of docs/search.md: its note follows from its rows; `docs/search_tables.py` makes
them.
"""

import re
from pathlib import Path

import pytest
from pages import DOCS, run, scores

from mapmore_cli.domain.scores import OWN
from mapmore_cli.study.loader import load

PAGE = Path(__file__).parents[2] / "docs" / "search.md"


@pytest.mark.parametrize(
    "path", sorted((PAGE.parent / "search").glob("*.yaml")), ids=lambda path: path.stem
)
def test_a_minimal_spec_of_the_page_says_nothing_of_a_structure(path):
    spec = load(path).spec
    assert spec.model.type == "auto"
    assert spec.name == path.stem
    assert not spec.dictionary


@pytest.mark.long  # the tutorial searches the recordings of the first
@pytest.mark.parametrize(
    ("study", "nrmse"),
    [
        ("peano-found", {"m2_settings": 0.0091, "sarosi": 0.0144}),
        ("dmsp-20-88-found", {"m2_settings": 0.0170, "sarosi": 0.0092}),
    ],
)
def test_what_is_found_in_the_demo_is_as_good_as_the_best_and_as_the_page_says(
    study, nrmse, tmp_path
):
    assert f"configs/m2/{study}.yaml" in (DOCS.parent / "Makefile").read_text(encoding="utf-8")
    files = run(f"m2/{study}", tmp_path)
    errors = {model: score.nrmse for model, score in scores(files).items()}
    for model, error in nrmse.items():
        assert errors[model] == pytest.approx(error, abs=1e-4)
    own, papers = errors.pop(OWN), errors.pop("m2_settings")
    ratio = own / min(errors.values())
    assert ratio <= 1.001
    assert own <= papers
    said = re.search(
        r"(\d\.\d+) times \(DMSP\) and (\d\.\d+) times \(Peano\)",
        PAGE.read_text(encoding="utf-8"),
    )
    assert ratio == pytest.approx(float(said[1 + study.startswith("peano")]), abs=0.03)
