"""Runs of drafts search one family here: what is tested is what a draft says of the data."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _quick(quick_families): ...
