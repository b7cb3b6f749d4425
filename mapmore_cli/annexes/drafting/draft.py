"""A spec under way, and how it is shown: as YAML whose comments say what decided, and as a page."""

from __future__ import annotations

import json
import math
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.foreign import printable
from mapmore_cli.spec.yaml_loader import escaped, tag_of

if TYPE_CHECKING:
    from mapmore_cli.domain.results import Search

TAIL = "# report: {formats: [html, pdf, tex]}  # for a paper: panels as PDF, tables for LaTeX"
HEAD = (
    "# Started by `mapmore init`. Look first at what is marked CHECK, "
    "then run `mapmore check` on this file."
)
WIDEST = 132
_BLOCKS = {
    ("data",),
    *(("data", key) for key in ("files", "columns", "derive", "keep")),
    ("segment",),
    ("dictionary",),
    ("validate",),
}
_BARE = re.compile(r"[A-Za-z_]\w*", re.ASCII)

Column = str | int
"""How a spec names a column: by its title or address, or by its place."""

Raw = Mapping[Column, Sequence[Array]]
"""Values of every column, one array `(n,)` for each file."""

Loc = tuple[str | int, ...]


@dataclass(frozen=True)
class NamedColumn:
    """The column of a quantity, its unit, and what decided this: a title, or a person.

    The quantity is `value * scale + offset` in `unit`, which is empty where a person said none.
    """

    column: Column
    unit: str = ""
    why: str = "as you said"
    sure: bool = True
    scale: float = 1.0
    offset: float = 0.0

    def as_spec(self) -> dict[str, Any]:
        """Return the column as the spec describes it."""
        usual = {"unit": ("", "1"), "scale": (1.0,), "offset": (0.0,)}
        told = {key: getattr(self, key) for key in usual}
        changed = {key: value for key, value in told.items() if value not in usual[key]}
        return {"column": self.column, **changed}


@dataclass(frozen=True)
class Note:
    """What decided a thing; what is not `sure` is marked for the user to look at."""

    why: str
    sure: bool = True

    def __str__(self) -> str:
        why = " ".join(printable(self.why).split())  # titles of columns hold whatever a file does
        return f"# {'' if self.sure else 'CHECK: '}{why}"


@dataclass(frozen=True)
class Draft:
    """Sections as the YAML will hold them, with numbers in the model's units, and why they were
    chosen.

    `files` counts the recordings' files, `raw` has the values of all columns of some of them, and
    `found` is where its structure comes from.
    """

    spec: dict[str, Any]
    notes: dict[Loc, Note] = field(default_factory=dict)
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

    @property
    def output(self) -> str:
        """What the model predicts."""
        target = self.spec["target"]
        return str(target["column"]) if isinstance(target, dict) else "force"

    @property
    def open(self) -> dict[Loc, Note]:
        """What is not sure."""
        return {loc: note for loc, note in self.notes.items() if not note.sure}

    def with_data(self, key: str, value: Any, why: str | None = None, sure: bool = True) -> Draft:
        """Return the draft with a key of `data` added or replaced."""
        return replace(self, spec={**self.spec, "data": {**self.data, key: value}}).noted(
            ("data", key), why, sure
        )

    def with_section(self, key: str, value: Any, why: str | None = None) -> Draft:
        """Return the draft with a section added or replaced."""
        return replace(self, spec={**self.spec, key: value}).noted((key,), why)

    def without(self, *keys: str) -> Draft:
        """Return the draft without some sections, or keys of `data` as `data.levels`, and what was
        said about them.
        """
        spec = {key: value for key, value in self.spec.items() if key not in keys}
        spec["data"] = {key: value for key, value in self.data.items() if f"data.{key}" not in keys}
        notes = {
            loc: note
            for loc, note in self.notes.items()
            if loc[0] not in keys and ".".join(map(str, loc[:2])) not in keys
        }
        return replace(self, spec=spec, notes=notes)

    def noted(self, loc: Loc, why: str | None, sure: bool = True) -> Draft:
        """Return the draft with a note about one of its places; none for None."""
        return self if why is None else replace(self, notes={**self.notes, loc: Note(why, sure)})

    def text(self) -> str:
        """Return the draft as YAML, with its notes."""
        return "\n".join([HEAD, *_yaml_lines(self.spec, (), self.notes), TAIL, ""])


def _yaml_lines(
    value: Mapping[str, Any] | Sequence[Any], loc: Loc, notes: Mapping[Loc, Note]
) -> Iterator[str]:
    margin = "  " * len(loc)
    # what stands in columns is easier to compare
    width = 1 + max(map(len, value)) if isinstance(value, Mapping) and len(loc) > 1 else 0
    for key, child in value.items() if isinstance(value, Mapping) else enumerate(value):
        here = (*loc, key)
        is_block = here in _BLOCKS and child
        head = (
            f"{margin}-"
            if isinstance(key, int)
            else f"{margin}{key + ':':<{0 if is_block else width}}"
        )
        line, rest = head if is_block else f"{head} {_flow(child)}", []
        # a flow that goes on further in; its texts have single blanks
        if loc == ("dictionary",) and len(line) > WIDEST:
            line, *rest = textwrap.wrap(
                line,
                WIDEST,
                subsequent_indent=f"{margin}    ",
                break_long_words=False,
                break_on_hyphens=False,
            )
        yield from (
            *_noted(line, notes.get(here)),
            *rest,
            *(_yaml_lines(child, here, notes) if is_block else ()),
        )


def _noted(line: str, note: Note | None) -> list[str]:
    """Return the line with its note behind it, or above it where both do not fit."""
    if note is None:
        return [line]
    if len(line) + len(str(note)) + 2 <= WIDEST:
        return [f"{line}  {note}"]
    margin = " " * (len(line) - len(line.lstrip()))
    return [
        *textwrap.wrap(str(note), WIDEST, initial_indent=margin, subsequent_indent=f"{margin}# "),
        line,
    ]


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


# The page
# --------------------------------------------------------------------------------------------------

POINTS, WIDTH, HEIGHT = 300, 200, 60  # of a thumbnail


def draft_page(draft: Draft) -> str:
    """Return the page of a draft as HTML: every column with its course, what it was taken for, and
    what is open; all texts are escaped.
    """
    from mapmore_cli.reporting.table import environment

    used = {entry["column"]: name for name, entry in draft.data["columns"].items()}
    drawn = {name: draft.raw[column] for column, name in used.items() if column in draft.raw}
    up = drawn.get(draft.output, ())
    pairs = [
        {"thumbnail": _thumbnail(across, up), "text": f"{name} across, {draft.output} up"}
        for name, across in drawn.items()
        if name not in ("time", draft.output) and list(map(len, across)) == list(map(len, up))
    ]
    page = environment().get_template("guesses.html")
    return page.render(
        name=draft.name,
        files=draft.files,
        drawn=len(next(iter(draft.raw.values()), ())),
        questions=[f"{'.'.join(map(str, loc))}: {note.why}" for loc, note in draft.open.items()],
        columns=[_column_row(draft, column, used.get(column)) for column in draft.raw],
        pairs=pairs,
        tried=[] if draft.found is None else _as_rows(draft.found),
        left_out="" if draft.found is None else draft.found.left_out,
        sources=[
            entry if isinstance(entry, str) else _flow(entry) for entry in draft.data["files"]
        ],
    )


def _column_row(draft: Draft, column: Column, name: str | None) -> dict[str, Any]:
    values = draft.raw[column]
    note = draft.notes.get(("data", "columns", name or ""), Note(""))
    unit = draft.data["columns"][name].get("unit", "") if name else ""
    return {
        "column": column,
        "thumbnail": _thumbnail(None, values),
        "range": range_of(values),
        "guess": f"{name} in {unit}" if unit else name or "left out",
        "why": note.why,
    }


def _as_rows(found: Search) -> list[dict[str, Any]]:
    """Return what was tried, the one that is taken first, then by its error; what could not be
    fitted last.
    """
    ranked = sorted(
        found.tried, key=lambda one: (one is not found.found, bool(one.failure), one.excess)
    )
    return [
        {
            "words": one.words,
            "parameters": "" if one.failure else str(one.parameters),
            "error": one.failure or f"{100 * one.error:.2g} %",
            "parts": "" if math.isnan(one.parts) else f"{100 * one.parts:.2g} %",
        }
        for one in ranked
    ]


def _thumbnail(across: Sequence[Array] | None, up: Sequence[Array]) -> Any:
    """Return columns of all recordings as a small SVG, the second over the first, or over its
    samples for None.
    """
    from markupsafe import Markup

    y = _scaled(np.concatenate(up))
    x = np.linspace(0, 1, len(y)) if across is None else _scaled(np.concatenate(across))
    rows = np.linspace(0, len(y) - 1, min(POINTS, len(y))).astype(int)
    places = zip(WIDTH * x[rows], HEIGHT - HEIGHT * y[rows], strict=True)
    path = "M" + " L".join(f"{a:.1f} {b:.1f}" for a, b in places)
    box = f'viewBox="-2 -2 {WIDTH + 4} {HEIGHT + 4}" preserveAspectRatio="none" aria-hidden="true"'
    return Markup(f'<svg class="thumbnail" {box}><path d="{path}"/></svg>')


def _scaled(values: Array) -> Array:
    span = float(np.ptp(values)) or 1.0
    return np.asarray((values - values.min()) / span)


def range_of(values: Sequence[Array], unit: str = "1") -> str:
    """Return from where to where values go, in words."""
    low, high = min(one.min() for one in values), max(one.max() for one in values)
    return f"{low:.4g} to {high:.4g}{'' if unit == '1' else f' {unit}'}"
