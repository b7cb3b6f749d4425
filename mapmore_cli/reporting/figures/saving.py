"""Figures as files: SVG, PDF, PNG and PGF, byte for byte the same for the same figure."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping
from html import escape

from matplotlib import rc_context
from matplotlib.figure import Figure

from mapmore_cli.domain.foreign import xml_text
from mapmore_cli.reporting.figures.style import fonts_may_lack_glyphs

SVG_PROLOGUE = '<?xml version="1.0" encoding="utf-8"?>\n'
DOTS_PER_INCH = 300

_PROLOGUE = re.compile(r"\A.*?(?=<svg\b)", re.DOTALL)
_GROUP_ID = re.compile(r'<g id="[^"]*"')


def to_svg(figure: Figure, name: str, alt: str) -> str:
    """An `<svg>` element that can stand in a page or in a file of its own.

    No date, no creator, and definitions named by a hash of their content, salted by the `name`. Groups lose their names (`axes_1`), which
    would repeat between the figures of one page.
    """
    text = io.StringIO()
    with rc_context({"svg.hashsalt": name}), fonts_may_lack_glyphs():
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    svg = _GROUP_ID.sub("<g", _PROLOGUE.sub("", xml_text(text.getvalue(), "\n")))
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(xml_text(alt))}" ', 1)


def _svg_file(figure: Figure, name: str, alt: str) -> bytes:
    return (SVG_PROLOGUE + to_svg(figure, name, alt)).encode()


def _pdf_file(figure: Figure, _name: str, alt: str) -> bytes:
    """Fonts are embedded as outlines that journals take (Type 42); neither a date nor the name of a program is written."""
    found = io.BytesIO()
    with rc_context({"pdf.fonttype": 42}), fonts_may_lack_glyphs():
        figure.savefig(found, format="pdf", metadata={"CreationDate": None, "Creator": None, "Producer": None, "Title": alt})
    return found.getvalue()


def _png_file(figure: Figure, _name: str, alt: str) -> bytes:
    found = io.BytesIO()
    with fonts_may_lack_glyphs():
        figure.savefig(found, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None, "Description": alt})
    return found.getvalue()


def _pgf_file(figure: Figure, _name: str, _alt: str) -> bytes:
    from mapmore_cli.reporting.figures.pgf import to_pgf

    with fonts_may_lack_glyphs():
        return to_pgf(figure).encode()


WRITERS: Mapping[str, Callable[[Figure, str, str], bytes]] = {"svg": _svg_file, "pdf": _pdf_file, "png": _png_file, "pgf": _pgf_file}
"""The bytes of a figure with its name and its description, by format."""
