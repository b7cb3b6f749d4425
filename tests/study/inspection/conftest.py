"""Searches of drafts try two families here, whatever the clock says: what is tested is what a draft says of the data."""

from __future__ import annotations

import pytest

from mapmore_cli.fitting import searching
from mapmore_cli.modelling.search.families import FAMILIES


@pytest.fixture(autouse=True)
def _quick_families(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(searching, "FAMILIES", {name: FAMILIES[name] for name in ("surface", "arx")})
