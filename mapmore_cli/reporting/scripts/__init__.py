"""Provide the scripts of pages. Each has a hash, so that a page allows its own scripts and no
others.
"""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Iterable
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files

EVERYWHERE = ("elements.js", "tables.js")
"""The scripts of every page, in their order."""

BEFORE, BEHIND = (
    ("uplot.js", "widgets.js", "joining.js", "pieces.js", "fixed.js", "running.js"),
    ("explore.js",),
)
"""Scripts of "Explore" before and after the code of the models, in order."""


@dataclass(frozen=True)
class Script:
    """A JavaScript script that stands in a page, and is no module."""

    text: str

    @property
    def allowed(self) -> str:
        """Hash by which the Content-Security-Policy of a page allows this script."""
        return f"'sha256-{b64encode(sha256(self.text.encode()).digest()).decode()}'"


def text_of(name: str) -> str:
    """Return the text of a file in this folder."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def scripts(texts: Iterable[str]) -> tuple[Script, ...]:
    """Return texts as scripts of a page. Raises ValueError for a text that would end the script
    element early.
    """
    made = tuple(Script(f"\n{text.strip()}\n") for text in texts)
    for one in made:
        if "</script" in one.text.lower() or "<!--" in one.text:
            raise ValueError("a script holds `</script` or `<!--`, which would end it on a page")
    return made


def json_text(value: object) -> str:
    """Return JSON for a script element of a page. Characters that could end the element are
    escaped.
    """
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")
