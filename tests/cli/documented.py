"""The commands that the documentation shows."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs" / "examples").iterdir()))
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"(?:\s*|\s*- run: |.*\$\()(mapmore .*)")


def commands(page: Path) -> Iterator[list[str]]:
    """The words of every command in the blocks of a page, or in a script, without `mapmore` and without what the shell does."""
    text = page.read_text(encoding="utf-8")
    lines = [line for _, block in FENCE.findall(text) for line in block.splitlines()] if page.suffix == ".md" else text.splitlines()
    for line in lines:
        if found := COMMAND.fullmatch(line.replace("\t", " ")):
            yield words(found[1])


def words(command: str) -> list[str]:
    """A line of a shell as arguments: without comment, pipe, redirection and command substitution."""
    lexer = shlex.shlex(command.rstrip(")"), posix=True, punctuation_chars="|<>;&")
    lexer.whitespace_split, lexer.commenters = True, "#"
    found: list[str] = []
    for word in lexer:
        if word and set(word) <= set("|<>;&"):
            break
        found.append(word)
    return found[1:]
