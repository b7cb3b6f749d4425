"""Texts that come from files, made harmless where they are shown: names, notes and titles can hold anything."""

from __future__ import annotations

import re

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")
"""What a terminal obeys instead of showing it, all but tabs and line feeds; and marks that turn the order of letters."""

_FORMULA = ("=", "+", "@", "\t", "\r")
"""How cells begin that a spreadsheet computes. A minus is none of them: it begins terms and equations."""


def printable(text: str) -> str:
    """The text with its control characters as escapes: `\\x1b` for the one that begins commands to a terminal."""
    return _CONTROL.sub(lambda match: match[0].encode("unicode_escape").decode("ascii"), text)


def csv_cell(text: str) -> str:
    """The text as a cell of a CSV table; one that a spreadsheet would take for a formula begins with an apostrophe."""
    return f"'{text}" if text.startswith(_FORMULA) else text
