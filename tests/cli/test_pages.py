"""The tables of pages that are files of their own."""

from __future__ import annotations

import re

import pytest
from page_tables import block_of
from pages import BLOCK, DOCS, in_full, read_rows

from mapmore_cli.spec.loader import load

WORDS, ROWS = 25_100, 15
"""What the documentation may have at most: in all, and in a table of a page."""


def test_every_table_file_has_its_page_and_every_excerpt_its_file() -> None:
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


def test_the_site_shows_every_row() -> None:
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


def test_the_documentation_is_short() -> None:
    pages = [
        page.read_text(encoding="utf-8") for page in (DOCS.parent / "README.md", *DOCS.glob("*.md"))
    ]
    assert sum(len(page.split()) for page in pages) <= WORDS, (
        "`<!-- table NAME 0 -->` puts a table into its own file (docs/pages.py)"
    )
    evidence = [match[4] for page in pages for match in BLOCK.finditer(page)]
    assert max(len(re.findall(r"^\|", block, re.MULTILINE)) - 2 for block in evidence) <= ROWS
