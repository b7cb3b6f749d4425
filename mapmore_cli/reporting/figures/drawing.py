"""A finished figure with the words that go with it, and how it is saved."""

from __future__ import annotations

import io
import re
import warnings
from dataclasses import dataclass
from html import escape

from matplotlib import rc_context
from matplotlib.figure import Figure

_PROLOGUE = re.compile(r"\A.*?(?=<svg\b)", re.DOTALL)
_GROUP_ID = re.compile(r'<g id="[^"]*"')


@dataclass(frozen=True)
class Drawing:
    """One figure.

    Attributes
    ----------
    name
        Stem of its file, as `fit`.
    caption
        What it shows, and what was left out of it.
    alt
        What one would tell somebody who cannot see it.
    """

    name: str
    caption: str
    alt: str
    figure: Figure


def to_svg(drawing: Drawing) -> str:
    """The figure as an `<svg>` element that can stand in a page or in a file of its own.

    Equal figures give equal bytes: no date, no creator, and definitions named by a salted hash of their content. Groups lose their names
    (`axes_1`), which would repeat between the figures of one page.
    """
    text = io.StringIO()
    with rc_context({"svg.hashsalt": drawing.name}), warnings.catch_warnings():
        # A character that the layout font lacks is still written as text, and drawn with the reader's fonts.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        drawing.figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    svg = _GROUP_ID.sub("<g", _PROLOGUE.sub("", text.getvalue()))
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(drawing.alt)}" ', 1)
