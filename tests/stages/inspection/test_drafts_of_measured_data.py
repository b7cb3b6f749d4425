"""The table of what `init` proposes for measured data holds: quick folders are tried here, `docs/drafted_tables.py` tries all."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[3] / "docs"


@pytest.mark.parametrize("name", ["festo_datasheet", "benchmarks"])
def test_the_page_says_what_is_proposed(measured_data: Path, name: str) -> None:
    spec = importlib.util.spec_from_file_location("drafted_tables", DOCS / "drafted_tables.py")
    assert spec is not None
    assert spec.loader is not None
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    page = (DOCS / "init-and-check.md").read_text(encoding="utf-8")
    rows = tables.rows_of(measured_data / name)
    assert rows
    for row in rows:
        assert row in page
