"""The table of docs/search.md: its note follows from its rows; `docs/search_tables.py` makes
them.
"""

import re
from pathlib import Path

import pytest
import search_tables
from pages import run, scores

from mapmore_cli.domain.scores import OWN
from mapmore_cli.spec.loader import load

PAGE = Path(__file__).parents[2] / "docs" / "search.md"


@pytest.mark.parametrize(
    "path", sorted((PAGE.parent / "search").glob("*.yaml")), ids=lambda path: path.stem
)
def test_a_minimal_spec_of_the_page_says_nothing_of_a_structure(path):
    spec = load(path).spec
    assert spec.model.type == "auto"
    assert spec.name == path.stem
    assert not spec.dictionary


@pytest.mark.parametrize(
    "study", ["dmsp-20-88-static", pytest.param("peano-static", marks=pytest.mark.long)]
)
def test_what_is_found_for_the_muscles_of_the_demo_is_as_good_as_the_page_says(study, tmp_path):
    against = (
        f"validate.against=[{', '.join(('sarosi', 'sarosi_hinged', 'kerscher', 'polynomial_2'))}]"
    )
    files = run(f"m2/{study}", tmp_path, *search_tables.BARE, against)
    errors = {model: score.nrmse for model, score in scores(files).items()}
    own = errors.pop(OWN)
    ratio = own / min(errors[model] for model in errors if model != "repeatability")
    assert ratio <= 1.1
    said = re.search(
        r"`make demo`, without their settings: (\d\.\d+) .DMSP. and (\d\.\d+) .Peano. times",
        PAGE.read_text(encoding="utf-8"),
    )
    assert ratio == pytest.approx(float(said[1 + (study == "peano-static")]), abs=0.03)
