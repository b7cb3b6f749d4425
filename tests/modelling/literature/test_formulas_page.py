"""docs/formulas.md is what the formulas say of themselves."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from mapmore_cli.modelling import literature

DOCS = Path(__file__).resolve().parents[3] / "docs"


def test_the_page_of_formulas_is_up_to_date() -> None:
    spec = importlib.util.spec_from_file_location("formulas_page", DOCS / "formulas_page.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    text = (DOCS / "formulas.md").read_text(encoding="utf-8")
    assert text == module.page(), "run `python docs/formulas_page.py`"
    for name in literature.names():
        assert f"### {name}\n" in text
