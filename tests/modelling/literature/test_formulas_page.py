"""docs/formulas.md names every formula; the reference has what each says of itself."""

from __future__ import annotations

from pathlib import Path

from mapmore_cli.modelling import literature

PAGE = Path(__file__).resolve().parents[3] / "docs" / "formulas.md"


def test_every_formula_is_on_the_page_and_in_the_reference() -> None:
    page, text = PAGE.read_text(encoding="utf-8"), literature.reference()
    for name in literature.names():
        assert f"`{name}`" in page
        assert f"### {name}\n" in text
        assert f"- source: {literature.get(name).reference}\n" in text
