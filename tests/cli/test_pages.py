"""Tables of pages that are files of their own, and sentences that quote their cells."""

import math
import re
from pathlib import Path
from statistics import fmean

import pytest
import yaml
from cells import BLOCK, DOCS, MARK, pages, read_rows, with_cells
from page_tables import block_of, numbers, page_table
from pages import in_full

from mapmore_cli.study.loader import load

ROWS = 15
"""What a table of a page may have at most."""


def test_every_table_file_has_its_page_and_every_excerpt_its_file():
    asked = set()
    for page in sorted(DOCS.glob("*.md")):
        for _, name, kept, text, _ in BLOCK.findall(page.read_text(encoding="utf-8")):
            if kept:
                rows = read_rows(page, name)[1:]
                place = f"tables/{page.stem}/{name}.csv"
                assert f"[All {len(rows)} rows]({place})" in text
                assert int(kept) < len(rows)
                asked.add(place)
    assert asked == {path.relative_to(DOCS).as_posix() for path in (DOCS / "tables").rglob("*.csv")}


def test_the_site_shows_every_row():
    page = DOCS / "intervals.md"
    text = in_full(page.read_text(encoding="utf-8"), page.name)
    for row in read_rows(page, "families"):
        assert f"| {' | '.join(row)} |" in text
    assert (
        page.read_text(encoding="utf-8").count("<!-- table families")
        == text.count("<!-- table families")
        == 1
    )


def test_the_worked_spec_is_one(tmp_path):
    (tmp_path / "spec.yaml").write_text(block_of(DOCS / "memory.md"))
    assert load(tmp_path / "spec.yaml").spec.has_memory


def test_the_tables_of_pages_are_short():
    pages = [
        page.read_text(encoding="utf-8") for page in (DOCS.parent / "README.md", *DOCS.glob("*.md"))
    ]
    evidence = [match[4] for page in pages for match in BLOCK.finditer(page)]
    assert max(len(re.findall(r"^\|", block, re.MULTILINE)) - 2 for block in evidence) <= ROWS, (
        "`<!-- table NAME 0 -->` puts a table into its own file (docs/pages.py)"
    )


def of_file(name):
    """The rows of a file beside this one, by page."""
    return yaml.safe_load(Path(__file__).with_name(name).read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.stem)
def test_sentences_quote_the_cells_that_their_marks_name(page):
    """`docs/cells.py` writes them; a mark at the beginning of a line would end its paragraph."""
    text = page.read_text(encoding="utf-8")
    assert with_cells(text, page) == text, "`python docs/cells.py` writes the numbers of sentences"
    assert text.count("<!-- / -->") == len(MARK.findall(text)), f"{page}: a mark is not closed"
    assert not re.search(rf"^{MARK.pattern}", text, re.MULTILINE)


TABLE = [["run", "held out", "error [N]"], ["a", "1", "2.5"], ["a", "2", "3.25"], ["b", "1", "–"]]


@pytest.mark.parametrize(
    ("mark", "shown"),
    [
        ("cell t; a, 2; error", "3.25"),
        ("cell t; a, 2; error [N]; .1f", "3.2"),
        ("cell\nt; b;\nerror", "–"),
        ("least t; error", "2.5"),
        ("greatest t; error; .0f", "3"),
        ("sum t; error; .1f", "5.8"),
        ("mean t; error; .2f", "2.88"),
        ("count t; run; a", "2"),
        ("excess t; a, 1; error; .0f", "150"),
        ("less t; a, 1; error; .0f", "-150"),
    ],
)
def test_a_mark_names_a_cell(mark, shown, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "".join(f"| {' | '.join(row)} |\n" for row in [TABLE[0], ["---"] * 3, *TABLE[1:]]).join(
            ("<!-- table t -->\n", "<!-- end -->\n")
        )
    )
    assert with_cells(f"It is <!-- {mark} -->old<!-- / --> N.", page) == (
        f"It is <!-- {mark} -->{shown}<!-- / --> N."
    )
    with pytest.raises(LookupError, match=r"page\.md: <!-- cell t; .*2 rows are called 'a'"):
        with_cells("<!-- cell t; a; error --><!-- / -->", page)


CLAIMS = [(page, claim) for page, claims in of_file("claims.yaml").items() for claim in claims]
TAKEN = {"least": min, "greatest": max, "mean": fmean}


def number_of(cell, page):
    """A number of a table, or what is taken over a column or a row."""
    if isinstance(cell, list):
        table, row, column = cell
        return numbers(page_table(table, page)[row])[column]
    if not isinstance(cell, dict):
        return float(cell)
    if "row" in cell:
        table, row = cell["row"]
        return min(
            x for key, x in numbers(page_table(table, page)[row]).items() if key not in cell["but"]
        )
    table, column = cell["column"]
    rows = {
        name: numbers(row)
        for name, row in page_table(table, page).items()
        if name != cell.get("but")
    }
    return TAKEN[cell["over"]](
        [
            row[column]
            for name, row in rows.items()
            if column in row and name.startswith(cell.get("of", ""))
        ]
    )


@pytest.mark.parametrize(("page", "claim"), CLAIMS, ids=str)
def test_tables_keep_what_pages_claim(page, claim):
    path = DOCS / f"{page}.md"
    number, times = number_of(claim["number"], path), claim.get("times", 1)
    assert number >= times * number_of(claim.get("least", -math.inf), path)
    assert number <= times * number_of(claim.get("most", math.inf), path)
