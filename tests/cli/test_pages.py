"""Tables of pages that are files of their own, and sentences that tell their cells."""

import math
import re
from pathlib import Path
from statistics import fmean

import pytest
import yaml
from page_tables import block_of, numbers, page_table
from pages import BLOCK, DOCS, in_full, read_rows

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


@pytest.mark.parametrize(
    ("page", "of_kind"),
    [
        ("memory", lambda spec: spec.has_memory),
        ("motion", lambda spec: spec.model.type == "state_space"),
    ],
)
def test_the_worked_spec_is_one(page, of_kind, tmp_path):
    (tmp_path / "spec.yaml").write_text(block_of(DOCS / f"{page}.md"))
    assert of_kind(load(tmp_path / "spec.yaml").spec)


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


SENTENCES = [(page, one) for page, rows in of_file("sentences.yaml").items() for one in rows]


def told(cell, page):
    """The text of a cell, or of what is taken over a column."""
    if isinstance(cell, list):
        table, row, column = cell
        return page_table(table, page)[row][column]
    ((way, place),) = cell.items()
    if way == "percent_above_one":
        return str(100 * (float(told(place, page)) - 1))
    table, column = place
    cells = [row[column] for row in page_table(table, page).values() if numbers(row).get(column)]
    return sorted(cells, key=float)[0 if way == "least" else -1]


@pytest.mark.parametrize(
    ("page", "sentence"), SENTENCES, ids=[f"{page}: {one['says']}" for page, one in SENTENCES]
)
def test_sentences_say_what_stands_in_the_tables(page, sentence):
    template, path = sentence["says"], DOCS / f"{page}.md"
    cells = [told(cell, path) for cell in sentence["of"]]
    values = [float(cell) for cell in cells] if "{:" in template else cells
    text = " ".join(path.read_text(encoding="utf-8").split())
    assert template.format(*values) in text


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
