"""Searches of drafts try two families here, whatever the clock says: what is tested is what a draft
says of the data.
"""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _quick(quick_families): ...
