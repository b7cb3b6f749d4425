"""The table of docs/search.md: its note follows from its rows; `docs/search_tables.py` makes
them.
"""

from pathlib import Path

import pytest

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
