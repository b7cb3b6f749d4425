"""Figures as `pgfpicture`, for TeX. By itself, for Matplotlib's part of it takes long to load."""

from __future__ import annotations

import io
import re

from matplotlib.backends.backend_pgf import RendererPgf
from matplotlib.figure import Figure

from mapmore_cli.reporting.table import latex_text

_MATHS = re.compile(r"(\$[^$]*\$)")


class _Renderer(RendererPgf):
    """Needs no TeX: letters are measured by the fonts of the other formats. Names are escaped, so that TeX obeys none of them."""

    def get_text_width_height_descent(self, s, prop, ismath):  # type: ignore[no-untyped-def]
        return super(RendererPgf, self).get_text_width_height_descent(s, prop, ismath)

    def draw_text(self, gc, x, y, s, prop, angle, ismath=False, mtext=None):  # type: ignore[no-untyped-def]
        super().draw_text(gc, x, y, _tex(s, bool(ismath)), prop, angle, ismath, mtext)  # type: ignore[no-untyped-call]


def _tex(text: str, maths: bool) -> str:
    """Text for TeX, in which formulas between dollars are left as they are where the text may have some."""
    if not maths:
        return latex_text(text)
    return "".join(part if place % 2 else latex_text(part) for place, part in enumerate(_MATHS.split(text)))


def to_pgf(figure: Figure) -> str:
    """A `pgfpicture` to be read with `\\input`; its letters are set in the fonts of the document."""
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
