"""Provide the JavaScript of pages. A page allows only scripts whose hash it contains, so each
script has its hash.

The scripts are modules that import each other. A page that is opened from a file cannot load
modules, so the modules of a page are joined into one script.
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
    """JavaScript that is part of a page. It is a plain script and no module."""

    text: str

    @property
    def allowed(self) -> str:
        """Hash of this script, by which the Content-Security-Policy of a page allows it."""
        return f"'sha256-{b64encode(sha256(self.text.encode()).digest()).decode()}'"


def text_of(name: str) -> str:
    """Return the text of a file in the folder of this module."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def joined(*names: str) -> str:
    """Join modules into one script. A module stands after the modules that it imports. The names at
    the top level of all modules must be different, because they share one scope.
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
    """Return texts as scripts for a page. Raises ValueError for a text that would end the HTML
    element `script` too early.
    """
    made = tuple(Script(f"\n{text.strip()}\n") for text in texts)
    for script in made:
        if "</script" in script.text.lower() or "<!--" in script.text:
            raise ValueError(
                "a script contains `</script` or `<!--`, which would end the HTML element `script` "
                "too early"
            )
    return made


def json_text(value: object) -> str:
    """Return a value as JSON for the HTML element `script` of a page. Characters that could end the
    element are escaped.
    """
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")
