"""Figures as files: SVG, PDF, PNG and PGF, byte for byte the same for the same figure."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping
from html import escape

from matplotlib import rc_context
from matplotlib.backends.backend_pgf import RendererPgf
from matplotlib.figure import Figure

from mapmore_cli.domain.foreign import tex_label, tex_text, xml_text
from mapmore_cli.reporting.figures.style import fonts_may_lack_glyphs

SVG_PROLOGUE = '<?xml version="1.0" encoding="utf-8"?>\n'
DOTS_PER_INCH = 300

_PROLOGUE = re.compile(r"\A.*?(?=<svg\b)", re.DOTALL)
_GROUP_ID = re.compile(r'<g id="[^"]*"')


def to_svg(figure: Figure, name: str, alt: str) -> str:
    """Return an `<svg>` element that can stand in a page or in a file of its own.

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
    """Write a PDF: fonts are embedded as outlines that journals take (Type 42); neither a date nor the name of a program is written."""
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

    with fonts_may_lack_glyphs():
        return to_pgf(figure).encode()


WRITERS: Mapping[str, Callable[[Figure, str, str], bytes]] = {"svg": _svg_file, "pdf": _pdf_file, "png": _png_file, "pgf": _pgf_file}
"""The bytes of a figure with its name and its description, by format."""


class _Renderer(RendererPgf):
    """Needs no TeX: letters are measured by the fonts of the other formats. Names are escaped, so that TeX obeys none of them."""

    def get_text_width_height_descent(self, s, prop, ismath):  # type: ignore[no-untyped-def]
        return super(RendererPgf, self).get_text_width_height_descent(s, prop, ismath)

    def draw_text(self, gc, x, y, s, prop, angle, ismath=False, mtext=None):  # type: ignore[no-untyped-def]
        super().draw_text(gc, x, y, tex_label(s) if ismath else tex_text(s), prop, angle, ismath, mtext)  # type: ignore[no-untyped-call]


def to_pgf(figure: Figure) -> str:
    """Return a `pgfpicture` to be read with `\\input`; its letters are set in the fonts of the document."""
    text = io.StringIO()
    width, height = figure.get_size_inches()
    text.write("% \\usepackage{pgf} in the preamble, then \\input this file\n")
    text.write("\\begingroup\n\\makeatletter\n\\begin{pgfpicture}\n")
    text.write(
        f"\\pgfpathrectangle{{\\pgfpointorigin}}{{\\pgfqpoint{{{width:f}in}}{{{height:f}in}}}}\n\\pgfusepath{{use as bounding box, clip}}\n"
    )
    figure.draw(_Renderer(figure, text))  # type: ignore[no-untyped-call]
    text.write("\\end{pgfpicture}\n\\makeatother\n\\endgroup\n")
    return text.getvalue()
