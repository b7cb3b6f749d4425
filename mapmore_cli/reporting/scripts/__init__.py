"""Provide the scripts of pages, each with the hash by which a page allows this script and no
others.

The scripts are modules that import each other. A page that is opened from a file cannot load
modules, so the modules of a page are joined to one script.
"""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Iterable
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files

_IMPORT = re.compile(r'^import \{[^}]*\}\s+from "\./([a-z]+\.js)";\n', re.MULTILINE)


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


def joined(*names: str) -> str:
    """Return modules as one script, each after the modules that it imports. Their top-level names
    must be different, because they share one scope.
    """
    texts: dict[str, str] = {}

    def add(name: str) -> None:
        text = text_of(name)
        for imported in _IMPORT.findall(text):
            if imported not in texts:
                add(imported)
        texts[name] = re.sub(r"^export ", "", _IMPORT.sub("", text), flags=re.MULTILINE)

    for name in names:
        add(name)
    return "\n".join(['(() => {\n"use strict";', *texts.values(), "})();"])


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
