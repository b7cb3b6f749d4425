"""docs/spec.md has every key."""

from __future__ import annotations

from pathlib import Path

from mapmore_cli.spec.reference import page
from mapmore_cli.spec.schema import json_schema

PAGE = Path(__file__).parents[2] / "docs" / "spec.md"


def test_the_page_is_up_to_date() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert page(text) == text, "run `make schema`"


def test_every_key_is_on_the_page() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for section in json_schema()["$defs"].values():
        for key in section.get("properties", {}):
            assert f"| `{key}` |" in text
