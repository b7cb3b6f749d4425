"""A spec under way, and its text: YAML with a comment beside every guess."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from mapmore_cli.domain.foreign import printable
from mapmore_cli.spec.yaml_loader import escaped, tag_of

if TYPE_CHECKING:
    from mapmore_cli.domain.results import Search
    from mapmore_cli.study.drafting.columns import Guess, Raw

TAIL = "# report: {formats: [html, pdf, tex]}  # for a paper: panels as PDF, tables for LaTeX"
HEAD = ("Started by `mapmore init`. Every guess says why: look first at those marked CHECK, then run `mapmore check` on this file.",)


@dataclass(frozen=True)
class Draft:
    """Sections as the YAML will hold them, with numbers in the model's units, and why they were chosen.

    `rivals` are the columns that come next for each quantity, `files` counts the recordings' files, `raw` has the values of all columns of
    some of them, `found` is where its structure comes from.
    """

    spec: dict[str, Any]
    notes: dict[Loc, Note] = field(default_factory=dict)
    rivals: Mapping[str, tuple[Guess, ...]] = field(default_factory=dict)
    files: int = field(default=0, compare=False)
    raw: Raw = field(default_factory=dict, repr=False, compare=False)
    found: Search | None = field(default=None, repr=False, compare=False)

    @property
    def name(self) -> str:
        """Name of the study."""
        return str(self.spec["name"])

    @property
    def data(self) -> dict[str, Any]:
        """The `data` section."""
        section: dict[str, Any] = self.spec["data"]
        return section

    def with_data(self, key: str, value: Any, why: str | None = None, sure: bool = True) -> Draft:
        """Return the draft with a key of `data` added or replaced."""
        return replace(self, spec={**self.spec, "data": {**self.data, key: value}}).noted(("data", key), why, sure)

    def without(self, *sections: str) -> Draft:
        """Return the draft without some sections and what was said about them."""
        spec = {key: value for key, value in self.spec.items() if key not in sections}
        return replace(self, spec=spec, notes={loc: note for loc, note in self.notes.items() if loc[0] not in sections})

    def without_data(self, *keys: str) -> Draft:
        """Return the draft without some keys of `data` and what was said about them."""
        data = {key: value for key, value in self.data.items() if key not in keys}
        notes = {loc: note for loc, note in self.notes.items() if loc[:1] != ("data",) or len(loc) < 2 or loc[1] not in keys}
        return replace(self, spec={**self.spec, "data": data}, notes=notes)

    def with_section(self, key: str, value: Any, why: str | None = None, sure: bool = True) -> Draft:
        """Return the draft with a section added or replaced."""
        return replace(self, spec={**self.spec, key: value}).noted((key,), why, sure)

    def noted(self, loc: Loc, why: str | None, sure: bool = True) -> Draft:
        """Return the draft with a note about one of its places; none for None."""
        return self if why is None else replace(self, notes={**self.notes, loc: Note(why, sure)})

    def text(self) -> str:
        """Return the draft as YAML."""
        return to_yaml(self.spec, self.notes, HEAD)


WIDEST = 132
_BLOCKS = {
    ("data",),
    ("data", "files"),
    ("data", "columns"),
    ("data", "derive"),
    ("data", "keep"),
    ("segment",),
    ("dictionary",),
    ("validate",),
}
_BARE = re.compile(r"[A-Za-z_]\w*", re.ASCII)

Loc = tuple[str | int, ...]


@dataclass(frozen=True)
class Note:
    """Why something was guessed; what is not `sure` is marked for the user to look at."""

    why: str
    sure: bool = True

    def __str__(self) -> str:
        why = " ".join(printable(self.why).split())  # titles of columns hold whatever a file does
        return f"# {'' if self.sure else 'CHECK: '}{why}"


def to_yaml(spec: Mapping[str, Any], notes: Mapping[Loc, Note], head: tuple[str, ...]) -> str:
    """Return the spec with its notes, under comment lines of its own."""
    return "\n".join([*(f"# {line}" for line in head), *_mapping(spec, (), notes), TAIL, ""])


def _mapping(value: Mapping[str, Any], loc: Loc, notes: Mapping[Loc, Note]) -> Iterator[str]:
    width = max(len(key) for key in value) if len(loc) > 1 else 0  # what stands in columns is easier to compare
    for key, child in value.items():
        here = (*loc, key)
        if here in _BLOCKS and child:
            yield from _noted(f"{'  ' * len(loc)}{key}:", notes.get(here))
            yield from _mapping(child, here, notes) if isinstance(child, Mapping) else _list(child, here, notes)
        else:
            yield from _noted(f"{'  ' * len(loc)}{key + ':':<{width + 1}} {_flow(child)}", notes.get(here))


def _list(items: list[Any], loc: Loc, notes: Mapping[Loc, Note]) -> Iterator[str]:
    for place, item in enumerate(items):
        margin = "  " * len(loc)
        line = f"{margin}- {_flow(item)}"
        if loc == ("dictionary",) and len(line) > WIDEST:  # a flow that goes on further in; its texts have single blanks
            first, *rest = textwrap.wrap(line, WIDEST, subsequent_indent=f"{margin}    ", break_long_words=False, break_on_hyphens=False)
            yield from (*_noted(first, notes.get((*loc, place))), *rest)
            continue
        yield from _noted(line, notes.get((*loc, place)))


def _noted(line: str, note: Note | None) -> Iterator[str]:
    """Yield the line with its note behind it, or above it where both do not fit."""
    if note is None:
        yield line
    elif len(line) + len(str(note)) + 2 <= WIDEST:
        yield f"{line}  {note}"
    else:
        margin = " " * (len(line) - len(line.lstrip()))
        yield from textwrap.wrap(str(note), WIDEST, initial_indent=margin, subsequent_indent=f"{margin}# ")
        yield line


def _flow(value: Any) -> str:
    match value:
        case Mapping():
            return "{" + ", ".join(f"{key}: {_flow(item)}" for key, item in value.items()) + "}"
        case list() | tuple():
            return "[" + ", ".join(map(_flow, value)) + "]"
        case bool():
            return str(value).lower()
        case float():
            return f"{value:.10g}"
        case str():
            text = escaped(value)
            bare = _BARE.fullmatch(text) and tag_of(text) == "str"
            return text if bare else json.dumps(text, ensure_ascii=not text.isprintable())
        case _:
            return str(value)
