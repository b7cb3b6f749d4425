"""Figures as data: panels with what they draw, found by name, set side by side on a page, or each
by itself for a paper.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from importlib import import_module
from typing import Any, Literal

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_pgf import RendererPgf
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from mapmore_cli.domain import plugins
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.foreign import tex_label, tex_text, xml_text
from mapmore_cli.reporting.figures.style import figure_style, small
from mapmore_cli.reporting.inputs import SINGLE, FigureStyle, ReportInputs
from mapmore_cli.reporting.table import title_of

POINTS = 72
"""Points an inch. Figures have as many dots an inch, so that what is measured are points."""

LEGEND_ROOM, TITLE_ROOM = 0.45, 0.2
"""Inches above the panels, with a legend and without one."""

Values = Sequence[Any] | np.ndarray


@dataclass(frozen=True)
class Panel:
    """Axes below each other with one x axis: the smallest part of a figure that can stand by
    itself.

    - `key`: what tells it from the others of its figure, as a curve or a model; empty where it is
      the only one.
    - `draw`: draws on the given axes, from top to bottom.
    - `data`: the numbers that are drawn, by heading with unit, each `(n,)`.
    - `y_limits`: what each of the axes has to show, where that is not all that is drawn.
    """

    key: str
    draw: Callable[[Sequence[Axes]], None]
    x_label: str
    y_labels: tuple[str, ...]
    data: Mapping[str, Values]
    title: str = ""
    y_limits: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Grid:
    """How the panels of a figure stand on a page.

    - `columns`: panels side by side.
    - `width`, `height`: inches of the whole figure, and of one row of panels.
    - `stack`: relative heights of the axes of a panel, from top to bottom.
    - `common_x`, `common_y`: whether all panels have one x axis (else each its own); whether those
      of a row, or all, have one y axis.
    """

    columns: int = 1
    width: float = SINGLE
    height: float = 2.2
    stack: tuple[float, ...] = (1.0,)
    common_x: bool = False
    common_y: Literal["none", "row", "all"] = "none"


@dataclass(frozen=True)
class Drawing:
    """One figure.

    - `name`: stem of its file, as `fit`.
    - `caption`: what it shows, and what was left out of it.
    - `alt`: what one would tell somebody who cannot see it.
    - `legend`: handles of the legend above the panels.
    """

    name: str
    caption: str
    alt: str
    panels: tuple[Panel, ...]
    grid: Grid
    legend: tuple[Any, ...] = ()


def drawings(name: str, inputs: ReportInputs) -> list[Drawing]:
    """Return the figures that a spec calls so: none where there is nothing to draw, or several.

    They come from `draw` in the module of that name, or of the plug-in.
    """
    added = name in plugins.points("figures")
    module = plugins.load("figures", name) if added else import_module(f"{__package__}.{name}")
    figures: list[Drawing] = module.draw(inputs)
    return figures


def panel_of(name: str, inputs: ReportInputs, words: str) -> tuple[Drawing, Panel]:
    """Return the panel of a curve, a recording or a model, also of one that the page leaves out.

    - `words`: the panel's key, or what a user calls a curve: its level alone (`250`, `250 kPa` for
      `pressure=250`), or a log that was cut.

    Raises UsageError where there is no such panel; the message names those that there are.
    """
    ids = inputs.ids_of(words)
    for looked_in, keys in ((inputs, {words, *ids}), (replace(inputs, asked=ids), ids)):
        for drawing in drawings(name, looked_in) if keys else ():
            for panel in drawing.panels:
                if panel.key in keys:
                    return drawing, panel
    every = frozenset(
        [
            *(curve.id for curve in inputs.dataset.curves),
            *(recording.id for recording in inputs.dataset.recordings),
        ]
    )
    known = dict.fromkeys(
        panel.key
        for drawing in drawings(name, replace(inputs, asked=every))
        for panel in drawing.panels
    )
    names = ", ".join(filter(None, known))
    raise UsageError(
        f"no panel of this figure is called {words!r}",
        f"choose one of {names}" if names else "leave the panel out",
    )


@dataclass(frozen=True)
class RenderedFigure:
    """A figure as SVG; `width` in inches, `numbers` is the file of what it was drawn from, empty
    where there is none.
    """

    name: str
    caption: str
    svg: str
    width: float
    numbers: str = ""


def rendered(drawing: Drawing, style: FigureStyle | None = None) -> RenderedFigure:
    """All panels of a figure as one SVG."""
    with figure_style(style):
        figure = compose(drawing, style)
        return RenderedFigure(
            drawing.name,
            drawing.caption,
            to_svg(figure, drawing.name, drawing.alt),
            float(figure.get_figwidth()),
        )


def compose(
    drawing: Drawing, style: FigureStyle | None = None, panel: Panel | None = None
) -> Figure:
    """All panels of a figure in the grid of a page; or one `panel` alone, with the legend of the
    figure, as wide as the style says.
    """
    style = style or FigureStyle()
    panels, columns, width = (
        (drawing.panels, drawing.grid.columns, drawing.grid.width)
        if panel is None
        else ((panel,), 1, style.width)
    )
    grid, stack = drawing.grid, len(drawing.grid.stack)
    rows = math.ceil(len(panels) / columns)
    room = LEGEND_ROOM if drawing.legend else TITLE_ROOM
    figure = Figure(figsize=(width, room + rows * grid.height), dpi=POINTS)
    shared: Any = {"none": False, "row": "row", "all": True}[grid.common_y]
    every = figure.subplots(
        stack * rows,
        columns,
        height_ratios=[*grid.stack] * rows,
        sharex=grid.common_x,
        sharey=shared,
        squeeze=False,
    )
    places = [
        list(every[row * stack : (row + 1) * stack, column])
        for row in range(rows)
        for column in range(columns)
    ]
    for number, axes in enumerate(places):
        if number < len(panels):
            _fill(
                axes,
                panels[number],
                grid,
                style,
                first=number % columns == 0 or grid.common_y == "none",
                columns=columns,
            )
        else:
            for ax in axes:
                ax.remove()
    _hold(
        panels,
        places,
        columns if grid.common_y == "row" else len(panels) if grid.common_y == "all" else 1,
    )
    if drawing.legend:
        labels = [title_of(str(handle.get_label())) for handle in drawing.legend]
        figure.legend(
            list(drawing.legend),
            labels,
            loc="outside upper left",
            ncols=_legend_columns(labels, width),
        )
    figure.align_ylabels()
    ConstrainedLayoutEngine().execute(
        figure
    )  # once, so that the places are the same in every format
    return figure


def _fill(
    axes: Sequence[Axes], panel: Panel, grid: Grid, style: FigureStyle, *, first: bool, columns: int
) -> None:
    """Draw a panel; the y axes are labelled at the left of a row, the x axis below every panel."""
    top, bottom = axes[0], axes[-1]
    for ax in axes[1:]:
        if not grid.common_x:
            ax.sharex(top)
    for ax in axes:
        ax.tick_params(labelbottom=ax is bottom)
    bottom.locator_params(axis="x", nbins=5 if columns < 2 else 4)
    panel.draw(axes)
    if panel.title:
        top.set_title(title_of(panel.title))
    bottom.set_xlabel(panel.x_label, parse_math=style.is_own_label(panel.x_label))
    for ax, label in zip(axes, panel.y_labels, strict=True):
        if first:
            ax.set_ylabel(label, parse_math=style.is_own_label(label))


def _hold(panels: Sequence[Panel], places: Sequence[Sequence[Axes]], together: int) -> None:
    """Let the y axes show what their panels have to show: `together` panels in a row have their
    axes in common.
    """
    for start in range(0, len(panels), together):
        group = panels[start : start + together]
        for place in range(min(len(panel.y_limits) for panel in group)):
            low, high = (
                pick(panel.y_limits[place][end] for panel in group)
                for end, pick in ((0, min), (1, max))
            )
            margin = 0.06 * (high - low)
            places[start][place].set_ylim(low - margin, high + margin)


def _legend_columns(labels: Sequence[str], width: float) -> int:
    """As many entries side by side as fit, by the length of the longest, and rows of nearly one
    length.

    A letter is about half as wide as high.
    """
    size = small() / 72
    longest = max(len(label) for label in labels) * 0.55 * size + 4.2 * size
    rows = math.ceil(len(labels) / max(1, int(width / longest)))
    return math.ceil(len(labels) / rows)


SVG_PROLOGUE = '<?xml version="1.0" encoding="utf-8"?>\n'
DOTS_PER_INCH = 300

_PROLOGUE = re.compile(r"\A.*?(?=<svg\b)", re.DOTALL)
_GROUP_ID = re.compile(r'<g id="[^"]*"')


def to_svg(figure: Figure, name: str, alt: str) -> str:
    """Return an `<svg>` element that can stand in a page or in a file of its own.

    No date, no creator, and definitions named by a hash of their content, salted by the `name`.
    Groups lose their names (`axes_1`), which would repeat between the figures of one page.
    """
    text = io.StringIO()
    with rc_context({"svg.hashsalt": name}):
        figure.savefig(
            text,
            format="svg",
            metadata={"Date": None, "Creator": None, "Format": None, "Type": None},
        )
    svg = _GROUP_ID.sub("<g", _PROLOGUE.sub("", xml_text(text.getvalue(), "\n")))
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(xml_text(alt))}" ', 1)


def _pdf_file(figure: Figure, _name: str, alt: str) -> bytes:
    """Write a PDF: fonts are embedded as outlines that journals take (Type 42); neither a date nor
    the name of a program is written.
    """
    found = io.BytesIO()
    with rc_context({"pdf.fonttype": 42}):
        figure.savefig(
            found,
            format="pdf",
            metadata={"CreationDate": None, "Creator": None, "Producer": None, "Title": alt},
        )
    return found.getvalue()


def _png_file(figure: Figure, _name: str, alt: str) -> bytes:
    found = io.BytesIO()
    figure.savefig(
        found, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None, "Description": alt}
    )
    return found.getvalue()


class _Renderer(RendererPgf):
    """Needs no TeX: letters are measured by the fonts of the other formats. Names are escaped, so
    that TeX obeys none of them.
    """

    def get_text_width_height_descent(self, s, prop, ismath):  # type: ignore[no-untyped-def]
        return super(RendererPgf, self).get_text_width_height_descent(s, prop, ismath)

    def draw_text(self, gc, x, y, s, prop, angle, ismath=False, mtext=None):  # type: ignore[no-untyped-def]
        super().draw_text(
            gc, x, y, tex_label(s) if ismath else tex_text(s), prop, angle, ismath, mtext
        )  # type: ignore[no-untyped-call]


def to_pgf(figure: Figure) -> str:
    """Return a `pgfpicture` to be read with `\\input`; its letters are set in the fonts of the
    document.
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


WRITERS: Mapping[str, Callable[[Figure, str, str], bytes]] = {
    "svg": lambda figure, name, alt: (SVG_PROLOGUE + to_svg(figure, name, alt)).encode(),
    "pdf": _pdf_file,
    "png": _png_file,
    "pgf": lambda figure, _name, _alt: to_pgf(figure).encode(),
}
"""The bytes of a figure with its name and its description, by format; to be called within
`figure_style`.
"""
