"""The texts of the documentation: no link is dead, and no page that is made from the program is
older than the program.
"""

import json
import re
import unicodedata
from pathlib import Path

import generated
import pytest

from mapmore_cli.reporting.order import FIGURES

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted(
    page
    for folder in ("", "docs", "docs/gallery", "docs/papers", "docs/papers/published", "datasets")
    for page in (ROOT / folder).glob("*.md")
)
CODE = re.compile(r"^ *(```+).*?^ *\1 *$|`[^`\n]+`", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def anchors(page):
    """The anchors of a page's headings, as a forge makes them."""
    text = CODE.sub(lambda found: "" if "\n" in found[0] else found[0], page.read_text("utf-8"))
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    plain = (re.sub(r"\[([^]]*)\]\([^)]*\)|[`*]", r"\1", heading) for heading in headings)
    return {
        re.sub(r"[^\w\- ]", "", unicodedata.normalize("NFC", text).lower()).replace(" ", "-")
        for text in plain
    }


@pytest.mark.parametrize("page", PAGES, ids=[str(page.relative_to(ROOT)) for page in PAGES])
def test_no_link_is_dead(page):
    dead = []
    for link in LINK.findall(CODE.sub("", page.read_text("utf-8"))):
        path, _, anchor = link.partition("#")
        target = page if not path else page.parent / path
        if ":" in path:
            continue
        if not target.exists() or (anchor and anchor not in anchors(target)):
            dead.append(link)
    assert not dead


def test_every_figure_of_a_run_is_explained():
    text = (ROOT / "docs" / "how-good.md").read_text("utf-8")
    section = text.split("## What the other figures show")[1].split("\n## ")[0]
    assert re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE) == list(FIGURES)


def test_generated_texts_are_as_the_program_makes_them():
    stale = [
        path.name
        for path, text in generated.texts().items()
        if not path.is_file() or path.read_text("utf-8") != text
    ]
    assert not stale, "run `make generated`"


def test_the_notebook_and_its_page_hold_the_same_outputs():
    cells = json.loads((ROOT / "docs" / "notebook.ipynb").read_text("utf-8"))["cells"]
    page, pictures = generated.markdown(cells)
    assert (ROOT / "docs" / "notebook.md").read_text("utf-8") == page
    assert all((ROOT / "docs" / "figures" / name).is_file() for name in pictures)
    assert sum(bool(cell.get("outputs")) for cell in cells) >= 6


def pages_linked(page):
    """The pages of the documentation that a page links to."""
    links = LINK.findall(CODE.sub("", page.read_text("utf-8")))
    targets = ((page.parent / link.partition("#")[0]).resolve() for link in links)
    return {target for target in targets if target.suffix == ".md" and target.is_file()}


def test_every_page_is_at_most_two_links_away_from_home_and_readme_links_to_it():
    docs = ROOT / "docs"
    first = pages_linked(docs / "index.md")
    second = set().union(*map(pages_linked, first))
    site = {page for page in PAGES if docs in page.parents and "papers" not in page.parts}
    assert docs / "index.md" in pages_linked(ROOT / "README.md")
    assert sorted(page.name for page in site - first - second - {docs / "index.md"}) == []
    menu = (docs / "site" / "mkdocs.yml").read_text("utf-8")
    assert [page.name for page in site if page.parent == docs and page.name not in menu] == []


def test_evidence_links_to_a_page_that_says_how():
    menu = (ROOT / "docs" / "site" / "mkdocs.yml").read_text("utf-8")
    how, evidence = menu.split("  - Trust:\n")
    names = re.compile(r": ([\w-]+\.md)$", re.MULTILINE)
    instructions = {ROOT / "docs" / name for name in names.findall(how)}
    without = [
        name
        for name in names.findall(evidence)
        if not pages_linked(ROOT / "docs" / name) & instructions
    ]
    assert without == []
