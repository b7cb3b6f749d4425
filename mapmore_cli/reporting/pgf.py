"""Write figures for LaTeX. Their texts are set in the fonts of the document that includes them."""

from __future__ import annotations

import io

from matplotlib.backends.backend_pgf import RendererPgf
from matplotlib.figure import Figure

from mapmore_cli.domain.foreign import tex_label, tex_text


class _Renderer(RendererPgf):
    """Renderer that does not call TeX to measure the size of texts. It uses the size that texts
    have in the other file formats. Special characters of TeX are escaped, so that no text is
    executed as a TeX command.
    """

    def get_text_width_height_descent(self, s, prop, ismath):  # type: ignore[no-untyped-def]
        return super(RendererPgf, self).get_text_width_height_descent(s, prop, ismath)

    def draw_text(  # type: ignore[no-untyped-def]
        self, gc, x, y, s, prop, angle, ismath=False, mtext=None
    ):
        super().draw_text(
            gc, x, y, tex_label(s) if ismath else tex_text(s), prop, angle, ismath, mtext
        )  # type: ignore[no-untyped-call]


def to_pgf(figure: Figure) -> str:
    """Return a figure as LaTeX source (a `pgfpicture`) for `\\input`. Its texts are set in the
    fonts of the document.
    """
    text = io.StringIO()
    width, height = figure.get_size_inches()
    text.write("% \\usepackage{pgf} in the preamble, then \\input this file\n")
    text.write("\\begingroup\n\\makeatletter\n\\begin{pgfpicture}\n")
    text.write(
        f"\\pgfpathrectangle{{\\pgfpointorigin}}{{\\pgfqpoint{{{width:f}in}}{{{height:f}in}}}}\n"
        f"\\pgfusepath{{use as bounding box, clip}}\n"
    )
    figure.draw(_Renderer(figure, text))  # type: ignore[no-untyped-call]
    text.write("\\end{pgfpicture}\n\\makeatother\n\\endgroup\n")
    return text.getvalue()
