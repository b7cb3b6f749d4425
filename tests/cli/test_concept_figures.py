"""The pictures of the pages that explain mapmore are those of their numbers, and these are true."""

import re
import runpy

import markdown
import numpy as np
import pytest
from concept_figures import FIGURES, PICTURES, TABLES, fingerprint, read_numbers
from pages import DOCS

from mapmore_cli.reporting.table import to_markdown

SITE = runpy.run_path(str(DOCS / "site" / "formulas.py"))
QUICK = ("outer-level",)


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_not_older_than_its_numbers_and_what_draws_it(name):
    text = (FIGURES / f"{name}.svg").read_text(encoding="utf-8")
    assert fingerprint(name) in text, f"python docs/concept_figures.py {name}"


@pytest.mark.parametrize(
    "name",
    [
        name if name in QUICK else pytest.param(name, marks=pytest.mark.long)
        for name in PICTURES
        if read_numbers(name)
    ],
)
def test_the_numbers_of_a_picture_come_out_again(name, tmp_path):
    found = PICTURES[name].numbers(tmp_path)
    shown = read_numbers(name)
    assert list(found) == list(shown)
    for key, cells in shown.items():
        if key == "name":
            assert list(found[key]) == cells
        else:
            np.testing.assert_allclose(
                np.array(found[key], dtype=float),
                np.array(cells, dtype=float),
                rtol=2e-5,
                atol=2e-5 * max(map(abs, map(float, cells))),
            )


@pytest.mark.parametrize("name", TABLES)
def test_the_table_of_a_page_shows_the_numbers_of_the_picture(name):
    page, block, make = TABLES[name]
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    (shown,) = re.findall(rf"<!-- table {block} -->\n(.*?)<!-- end -->", text, re.DOTALL)
    assert shown == to_markdown(make(), str)


def test_every_formula_of_a_page_can_be_set():
    """Matplotlib raises an error for TeX that it does not know; code stays as it is."""
    pages = [path.read_text(encoding="utf-8") for path in sorted(DOCS.glob("*.md"))]
    html = [SITE["drawn"](markdown.markdown(SITE["marked"](page))) for page in pages]
    assert sum(page.count('class="formula"') for page in html) > 50
    assert not any('class="formula-' in page or "<style" in page for page in html)
    assert "span" not in SITE["marked"]("`$x$` costs 5 $ or\n```\n$ ls $HOME $x$\n```\n")
