"""docs/wrist.md and docs/muscle-like.md say what their studies say: each table that is quick to
make is made anew and compared.
"""

import re
from pathlib import Path

import muscle_tables
import pytest
from page_tables import DOCS, numbers, page_table

WRIST, MUSCLE_LIKE = DOCS / "wrist.md", DOCS / "muscle-like.md"
CONFIGS = DOCS.parent / "configs"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder of runs whose pages, where a run needs another with its page, have no figures:
    nobody looks at them here.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mapmore_cli.reporting.figures.drawing.drawings", lambda _name, _inputs: [])
        yield tmp_path_factory.mktemp("runs")


def assert_shown(found, page):
    """The page has the same rows, and numbers that agree within their printed digits."""
    shown = page_table(found.name, page)
    keys = [re.sub(r" \[.*\]$", "", heading) for heading in found.headings[1:]]
    # several rows may begin with one model
    if len({row[0] for row in found.shown}) == len(found.rows):
        assert list(shown) == [row[0] for row in found.shown]
    for first, *cells in found.shown:
        if [row[0] for row in found.shown].count(first) > 1:
            continue
        for key, cell in zip(keys, cells, strict=True):
            if (value := numbers({key: cell})) and keys.count(key) == 1:
                assert numbers(shown[first])[key] == pytest.approx(
                    value[key], rel=0.02, abs=2e-4
                ), (first, key)


def test_the_wrist_page(runs):
    for name, table in muscle_tables.WRIST_TABLES.items():
        made = table(runs)
        assert made.name == name
        assert_shown(made, WRIST)


@pytest.mark.parametrize(
    "name", ["table-1", pytest.param("joint", marks=pytest.mark.long), "closed-valves"]
)
def test_the_muscle_like_page(name, runs):
    assert_shown(muscle_tables.MUSCLE_LIKE_TABLES[name](runs), MUSCLE_LIKE)


def test_the_measured_pair(runs, measured_data):
    """And MAPMORE's error is no larger than that of the best formula, from a spec of less than
    forty lines.
    """
    found = muscle_tables.MUSCLE_LIKE_TABLES["antagonist"](runs)
    assert_shown(found, MUSCLE_LIKE)
    errors = {row[0]: row[3] for row in found.rows}
    assert errors.pop("mapmore") <= min(errors.values())
    assert len((CONFIGS / "muscle-like" / "antagonist-pam.yaml").read_text().splitlines()) < 40


def test_a_k_was_inert():
    found = muscle_tables.inert_table(Path())
    assert_shown(found, WRIST)
    assert f"{muscle_tables.size_of_eq_3():.1f} times too small" in WRIST.read_text(
        encoding="utf-8"
    )
