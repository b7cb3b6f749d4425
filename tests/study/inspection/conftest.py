"""Searches of drafts end early here: what is tested is what a draft says of the data."""

from __future__ import annotations

import pytest

from mapmore_cli.study.drafting import proof


@pytest.fixture(autouse=True)
def _short_searches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proof, "BUDGET", 0.5)
