"""The table of docs/search.md: its note follows from its rows; `docs/search_tables.py` makes
them.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import search_tables
from pages import read_rows, run, scores

from mapmore_cli.domain.scores import OWN
from mapmore_cli.spec.loader import load

PAGE = Path(__file__).parents[2] / "docs" / "search.md"


def test_the_note_of_the_table_follows_from_its_rows():
    note = (
        PAGE.read_text(encoding="utf-8")
        .partition("<!-- table search 0 -->")[2]
        .partition("<!-- end -->")[0]
    )
    headings, *lines = read_rows(PAGE, "search")
    rows = [dict(zip(headings, line, strict=True)) for line in lines]
    groups: dict[str, list[float]] = {}
    for row in rows:
        found, *others = (
            float(row[f"{name} [%]"]) for name in ("found", "best black box", "best simple model")
        )
        ratio = found / min(others)
        assert float(row["found / better of both"]) == pytest.approx(ratio, abs=0.02 + 0.01 * ratio)
        if abs(ratio - 1.5) > 0.01:
            assert bool(row["told on its page"]) == (ratio > 1.5)
        groups.setdefault(
            f"{row['kind']}s, "
            f"{'splits that were in sight' if row['in sight'] == 'yes' else 'new splits'}",
            [],
        ).append(ratio)
    assert len(groups) == 4
    for words, ratios in groups.items():
        line = next(line for line in note.splitlines() if line.startswith(f"{len(ratios)} {words}"))
        shares = [float(text) / 100 for text in re.findall(r"in (\d+)%", line)]
        for share, bound in zip(shares, (1.01, 1.2), strict=True):
            least, most = (
                sum(ratio <= bound + slack for ratio in ratios) / len(ratios)
                for slack in (-0.01, 0.01)
            )
            assert least - 0.005 <= share <= most + 0.005
    told = [row["told on its page"] for row in rows if row["told on its page"]]
    assert f"{len(told)}, of which {told.count('yes')} say so on their page." in note


@pytest.mark.parametrize(
    "path", sorted((PAGE.parent / "search").glob("*.yaml")), ids=lambda path: path.stem
)
def test_a_minimal_spec_of_the_page_says_nothing_of_a_structure(path):
    spec = load(path).spec
    assert spec.model.type == "auto"
    assert spec.name == path.stem
    assert not spec.dictionary


@pytest.mark.parametrize("study", ["dmsp-20-88-static", "peano-static"])
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
    assert said is not None
    assert ratio == pytest.approx(float(said[1 + (study == "peano-static")]), abs=0.03)
