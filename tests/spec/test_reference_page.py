"""docs/spec.md has every key."""

from __future__ import annotations

from pathlib import Path
from typing import get_type_hints

from mapmore_cli.domain.scores import METRICS, Score
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


def test_every_number_of_a_score_is_a_metric() -> None:
    assert list(METRICS) == [name for name, kind in get_type_hints(Score).items() if kind in (int, float)]
