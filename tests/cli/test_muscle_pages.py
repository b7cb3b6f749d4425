"""docs/wrist.md and docs/muscle-like.md say what their studies say: each table that is quick to
make is made anew and compared.
"""

import re
from pathlib import Path

import muscle_tables
import pytest
from page_tables import DOCS, numbers, page_table

from mapmore_cli.study.loader import load

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


def test_the_splits_begin_with_what_the_study_says(runs):
    found = muscle_tables.scores(muscle_tables.run("muscle-like/muscle-like-16cm", runs))
    row = numbers(page_table("splits", MUSCLE_LIKE)["blocks of 8 s"])
    for model, score in found.items():
        assert row[f"{model}, RMSE"] == pytest.approx(score.rmse, rel=0.01)


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


def test_every_study_of_both_folders_is_named_on_its_page_or_made_for_it():
    for folder, page in (("wrist", WRIST), ("muscle-like", MUSCLE_LIKE)):
        studies = sorted(
            path for path in (CONFIGS / folder).glob("*.yaml") if not path.name.startswith("_")
        )
        told = (
            page.read_text()
            + (DOCS / "muscle_tables.py").read_text()
            + "".join(path.read_text() for path in studies)
        )
        for path in studies:
            assert load(path).spec.name == path.stem
            assert path.stem in told.replace(f"name: {path.stem}", "") or "{length}cm" in told, (
                path.stem
            )
