"""docs/file-format.md follows the declarations."""

from __future__ import annotations

import re
from pathlib import Path

from mapmore_cli.storage.artefacts.describe import described
from mapmore_cli.storage.artefacts.files import FORMAT_VERSION, KINDS

PAGE = Path(__file__).parents[2] / "docs" / "file-format.md"


def test_page_is_up_to_date() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert described(text) == text, "run: python -m mapmore_cli.storage.artefacts.describe docs/file-format.md"
    assert f"format {FORMAT_VERSION}" in text


def test_every_link_has_its_heading() -> None:
    text = PAGE.read_text(encoding="utf-8")
    headings = {heading.lower() for heading in re.findall(r"^#+ (\w+)$", text, re.MULTILINE)}
    assert set(re.findall(r"\]\(#(\w+)\)", text)) <= headings


def test_every_kind_is_described() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for kind in KINDS:
        assert f"kind `{kind.name}`" in text
        assert f"[{kind.schema.type.__name__}](#" in text
