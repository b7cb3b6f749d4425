"""docs/file-format.md and the reference of stored types follow the declarations."""

from __future__ import annotations

import re
from pathlib import Path

from mapmore_cli.storage.artefacts import FORMAT_VERSION, KINDS
from mapmore_cli.storage.artefacts.layout import described

PAGE = (Path(__file__).parents[2] / "docs" / "file-format.md").read_text(encoding="utf-8")
HEADINGS = set(re.findall(r"^### (\w+)$", described(), re.MULTILINE))


def test_every_link_has_its_heading() -> None:
    assert set(re.findall(r"\]\(#(\w+)\)", described())) <= {heading.lower() for heading in HEADINGS}


def test_every_kind_is_on_the_page() -> None:
    assert f"format {FORMAT_VERSION}" in PAGE
    for kind in KINDS:
        assert f"kind `{kind.name}`" in PAGE
        assert f"`{kind.type.__name__}`" in PAGE
        assert kind.type.__name__ in HEADINGS
