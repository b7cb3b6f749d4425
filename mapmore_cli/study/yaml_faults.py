"""Explain in plain words why a text is no YAML, and say what to do."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from typing import NoReturn

import yaml

from mapmore_cli.study.diagnostics import fail
from mapmore_cli.study.tree import Position, SourceText

DEEPEST = 40
"""Largest depth of nesting that is read; a spec needs ten."""

_PLAINER = (  # for each message of PyYAML, its meaning in plain words and the remedy
    (
        "cannot start any token",
        "a character that is not allowed here",
        "quote the text, and indent with spaces instead of tabs",
    ),
    (
        "mapping values are not allowed here",
        "a `:` that is not allowed here",
        "put a text that contains `: ` in quotes, or correct the indentation",
    ),
    ("could not find expected ':'", "a key without `:`", "write `key: value`"),
    (
        "expected <block end>",
        "the indentation does not match the lines above, or a bracket is missing",
        "align the keys of one mapping",
    ),
    ("expected ',' or", "a `,` or a closing bracket is missing", "close every `[` and `{`"),
    (
        "but found another document",
        "a second document starts here",
        "one file holds one spec: remove the `---`",
    ),
    (
        "found undefined alias",
        "an alias without its anchor",
        "define it above with `&name`, or quote a text that begins with `*`",
    ),
    (
        "found duplicate anchor",
        "an anchor that is defined twice",
        "give the second one another name",
    ),
    (
        "levels deep",
        f"nested more than {DEEPEST} levels deep",
        "reduce the nesting; a spec needs ten levels",
    ),
    ("found unexpected end of stream", "the text ends within quotes", "close the quotes"),
)


def position_at(source: SourceText, offset: int) -> Position:
    """Return the place of a character of the text, as line and column that count from 1."""
    before = source.text[:offset]
    return Position(source, before.count("\n") + 1, len(before) - before.rfind("\n"))


_MARKS = (" #", "[", "]", "{", ": ")

_BEGIN = r"[^\s'\"\[{&*!|>]|\[[^\]]*\][ \t]*(?=\w)"

_VALUE = re.compile(
    rf"[\w'\"<]:[ \t]+(?P<text>(?:{_BEGIN})(?:\[[^\]]*\]?|[^,{{}}\[]|\{{[^}}]*\}})*)"
)
"""Pattern of an unquoted value after its key, including the brackets in it."""


def _unquoted_text(lines: Iterable[str]) -> str | None:
    """Return the first value in some lines that must be quoted because it contains a special
    character, for example `P [kPa]`; None if there is none.
    """
    texts = (match["text"].strip() for line in lines for match in _VALUE.finditer(line))
    return next((text for text in texts if any(mark in text for mark in _MARKS)), None)


def explain_fault(error: Exception, source: SourceText) -> NoReturn:
    """Raise a SpecError that states PyYAML's complaint in plainer words, with its place."""
    if isinstance(error, yaml.reader.ReaderError):
        at = position_at(source, error.position)
        fail(
            at,
            f"the text contains the control character #x{int(error.character):04x}",
            "give the path of a spec, which is plain text; this seems to be a data file",
        )
    context = getattr(error, "context_mark", None)
    mark = getattr(error, "problem_mark", None) or context
    at = Position(source, mark.line + 1, mark.column + 1) if mark else Position(source, 1, 1)
    complaint = (
        f"{getattr(error, 'context', None) or ''} {getattr(error, 'problem', None) or ''}".strip()
    )
    begin, end = (context or mark).line if mark else 0, at.line
    if (text := _unquoted_text(source.text.splitlines()[begin:end])) is not None:
        marks = next(mark for mark in _MARKS if mark in text)
        fail(
            at,
            f"not valid YAML: `{text}` has `{marks.strip()}` in it, which means something in YAML",
            f"put it in quotes: `{json.dumps(text, ensure_ascii=False)}`",
        )
    for phrase, message, remedy in _PLAINER:
        if phrase in complaint:
            fail(at, f"not valid YAML: {message}", remedy)
    fail(at, f"not valid YAML: {complaint}")
