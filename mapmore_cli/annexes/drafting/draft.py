"""A spec under way, and how it is shown: as YAML with a comment beside every guess, and as a page
to check the guesses by eye.
"""

from __future__ import annotations

import json
import math
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mapmore_cli.checking.evidence import scaled
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.foreign import printable
from mapmore_cli.spec.yaml_loader import escaped, tag_of

if TYPE_CHECKING:
    from mapmore_cli.domain.results import Search

TAIL = "# report: {formats: [html, pdf, tex]}  # for a paper: panels as PDF, tables for LaTeX"
HEAD = (
    "# Started by `mapmore init`. Every guess says why: look first at those marked CHECK, "
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
class Guess:
    """A quantity's column and unit, and why; `rivals` are the columns that come next, the likeliest
    first.

    The quantity is `value * scale + offset` in `unit`, which is empty where a person said none;
    `unwrap` is the number at which its encoder begins anew.
    """

    column: Column
    unit: str = ""
    why: str = "as you said"
    sure: bool = True
    scale: float = 1.0
    offset: float = 0.0
    unwrap: float | None = None
    rivals: tuple[Guess, ...] = field(default=(), compare=False)

    @classmethod
    def of_spec(cls, entry: Mapping[str, Any]) -> Guess:
        """Return a column as a person would say it, of its description in a spec."""
        return cls(
            entry["column"],
            entry.get("unit", ""),
            scale=float(entry.get("scale", 1)),
            offset=float(entry.get("offset", 0)),
        )

    def as_spec(self) -> dict[str, Any]:
        """Return the column as the spec describes it."""
        unit, scale = (
            ("" if self.unit == "1" else self.unit),
            (0 if self.scale == 1 else self.scale),
        )
        told = {"unit": unit, "scale": scale, "offset": self.offset, "unwrap": self.unwrap}
        return {"column": self.column, **{key: value for key, value in told.items() if value}}


@dataclass(frozen=True)
class Note:
    """Why something was guessed; what is not `sure` is marked for the user to look at."""

    why: str
    sure: bool = True

    def __str__(self) -> str:
        why = " ".join(printable(self.why).split())  # titles of columns hold whatever a file does
        return f"# {'' if self.sure else 'CHECK: '}{why}"


@dataclass(frozen=True)
class Draft:
    """Sections as the YAML will hold them, with numbers in the model's units, and why they were
    chosen.

    `rivals` are the columns that come next for each quantity, `files` counts the recordings' files,
    `raw` has the values of all columns of some of them, `found` is where its structure comes from.
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

    def with_section(
        self, key: str, value: Any, why: str | None = None, sure: bool = True
    ) -> Draft:
        """Return the draft with a section added or replaced."""
        return replace(self, spec={**self.spec, key: value}).noted((key,), why, sure)

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
        return "\n".join([HEAD, *_lines(self.spec, (), self.notes), TAIL, ""])


def _lines(
    value: Mapping[str, Any] | Sequence[Any], loc: Loc, notes: Mapping[Loc, Note]
) -> Iterator[str]:
    margin = "  " * len(loc)
    width = (
        1 + max(map(len, value)) if isinstance(value, Mapping) and len(loc) > 1 else 0
    )  # what stands in columns is easier to compare
    for key, child in value.items() if isinstance(value, Mapping) else enumerate(value):
        here = (*loc, key)
        is_block = here in _BLOCKS and child
        head = (
            f"{margin}-"
            if isinstance(key, int)
            else f"{margin}{key + ':':<{0 if is_block else width}}"
        )
        line, rest = head if is_block else f"{head} {_flow(child)}", []
        if (
            loc == ("dictionary",) and len(line) > WIDEST
        ):  # a flow that goes on further in; its texts have single blanks
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
            *(_lines(child, here, notes) if is_block else ()),
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


def guesses_page(draft: Draft) -> str:
    """Return the page of a draft as HTML: every column with its course, what it was taken for, and
    what is open; all texts are escaped.
    """
    from mapmore_cli.reporting.table import environment

    used = {entry["column"]: name for name, entry in draft.data["columns"].items()}
    drawn = {name: draft.raw[column] for column, name in used.items() if column in draft.raw}
    up = drawn.get(draft.output, ())
    return (
        environment()
        .get_template("guesses.html")
        .render(
            name=draft.name,
            files=draft.files,
            drawn=len(next(iter(draft.raw.values()), ())),
            questions=[
                f"{'.'.join(map(str, loc))}: {note.why}" for loc, note in draft.open.items()
            ],
            columns=[_row(draft, column, used.get(column)) for column in draft.raw],
            pairs=[
                {"thumbnail": _thumbnail(across, up), "text": f"{name} across, {draft.output} up"}
                for name, across in drawn.items()
                if name not in ("time", draft.output)
                and [len(one) for one in across] == [len(one) for one in up]
            ],
            tried=[] if draft.found is None else _tried(draft.found),
            left_out="" if draft.found is None else draft.found.left_out,
            sources=[
                entry if isinstance(entry, str) else _said(entry) for entry in draft.data["files"]
            ],
        )
    )


def _row(draft: Draft, column: Column, name: str | None) -> dict[str, Any]:
    values = draft.raw[column]
    row = {"column": column, "thumbnail": _thumbnail(None, values), "range": range_of(values)}
    if name is None:
        return {**row, "guess": "left out", "why": "", "rival": ""}
    unit = draft.data["columns"][name].get("unit", "")
    why = (
        draft.notes["data", "columns", name].why if ("data", "columns", name) in draft.notes else ""
    )
    rival = next((f"column {one.column}: {one.why}" for one in draft.rivals.get(name, ())), "")
    return {**row, "guess": f"{name}{f' in {unit}' if unit else ''}", "why": why, "rival": rival}


def _tried(found: Search) -> list[dict[str, Any]]:
    """Return what was tried, the one that is taken first, then by its error; what could not be
    fitted last.
    """
    return [
        {
            "words": one.words,
            "parameters": "" if one.failure else str(one.parameters),
            "error": one.failure or f"{100 * one.error:.2g} %",
            "parts": "" if math.isnan(one.parts) else f"{100 * one.parts:.2g} %",
        }
        for one in sorted(
            found.tried, key=lambda one: (one is not found.found, bool(one.failure), one.excess)
        )
    ]


def _said(entry: dict[str, Any]) -> str:
    return (
        f"{entry['path']}: "
        f"{', '.join(f'{name} {value}' for name, value in entry.get('set', {}).items())}"
    )


def _thumbnail(across: Sequence[Array] | None, up: Sequence[Array]) -> Any:
    """Return columns of all recordings as a small SVG, the second over the first, or over its
    samples for None.
    """
    from markupsafe import Markup

    y = np.concatenate(scaled(up))
    x = np.linspace(0, 1, len(y)) if across is None else np.concatenate(scaled(across))
    rows = np.linspace(0, len(y) - 1, min(POINTS, len(y))).astype(int)
    places = zip(WIDTH * x[rows], HEIGHT - HEIGHT * y[rows], strict=True)
    path = "M" + " L".join(f"{a:.1f} {b:.1f}" for a, b in places)
    box = f'viewBox="-2 -2 {WIDTH + 4} {HEIGHT + 4}" preserveAspectRatio="none" aria-hidden="true"'
    return Markup(f'<svg class="thumbnail" {box}><path d="{path}"/></svg>')


def range_of(values: Sequence[Array], unit: str = "1") -> str:
    """From where to where values go, in words."""
    low, high = min(one.min() for one in values), max(one.max() for one in values)
    return f"{low:.4g} to {high:.4g}{'' if unit == '1' else f' {unit}'}"
