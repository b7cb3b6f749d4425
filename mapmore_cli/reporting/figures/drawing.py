"""Define figures as data, and draw them. A figure consists of panels, each with a function that
draws it. Figures are found by name; all panels of a figure are drawn together for a page, or one
panel is drawn alone for a paper.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from html import escape
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from mapmore_cli.domain import plugins
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.foreign import xml_text
from mapmore_cli.reporting.figures.panels import Key, titles
from mapmore_cli.reporting.figures.style import PLAIN, figure_style
from mapmore_cli.reporting.inputs import SINGLE, FigureStyle, ReportInputs
from mapmore_cli.reporting.table import title_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS = 72
"""Points per inch. Figures have the same number of dots per inch, so that lengths which Matplotlib
measures in dots are lengths in points.
"""

DOUBLE = 7.16
"""Width of two columns of a journal page, inches."""

LEGEND_SCALE = 1.4
"""Size of the markers in a legend relative to their size in the panels, if the legend is made from
what is drawn.
"""

BESIDE = 0.5
"""Width in inches that the labels of a y axis take."""

Values = Sequence[Any] | np.ndarray


@dataclass(frozen=True, eq=False)
class Panel:
    """Panel of a figure: the smallest part that can be shown alone. It has one or more axes below
    each other that share the x axis.

    - `key`: name that no other panel of the figure has, for example the name of a curve or a model;
      empty if the figure has no other panel.
    - `draw`: function that draws on the given axes, from top to bottom.
    - `data`: the numbers that are drawn, by heading with unit, (n,) each; empty if they are not
      written beside the figure.
    """

    key: str
    draw: Callable[..., None]
    x_label: str
    y_labels: tuple[str, ...]
    data: Mapping[str, Values] = field(default_factory=dict)
    title: str = ""

    @property
    def reach(self) -> str:
        """Sentence with the smallest and the largest number of each column."""
        columns = ((name, np.asarray(values)) for name, values in self.data.items())
        known = ((name, x[np.isfinite(x)]) for name, x in columns if x.dtype.kind == "f")
        words = [f"{name} {x.min():.3g} to {x.max():.3g}" for name, x in known if len(x)]
        return f"{title_of(self.title)}: {', '.join(words)}.".removeprefix(": ")


@dataclass(frozen=True)
class Layout:
    """Arrangement of the panels of a figure on a page.

    - `height`: height of one row of panels, inches.
    - `stack`: relative heights of the axes of a panel, from top to bottom.
    - `columns`: number of panels side by side; 0 means up to three (two if there are four panels).
    - `width`: width of the whole figure, inches; 0 means one column of a journal page for one
      panel, and two columns for several.
    - `common_x`: True if all panels share the x axis.
    - `common_y`: panels that share the y axis: `none`, the panels of a `row`, or `all`.
    - `projection`: `3d` for axes with three dimensions.
    """

    height: float = 2.2
    stack: tuple[float, ...] = (1.0,)
    columns: int = 0
    width: float = 0.0
    common_x: bool = False
    common_y: Literal["none", "row", "all"] = "none"
    projection: Literal["3d"] | None = None


@dataclass(frozen=True)
class Drawing:
    """One figure.

    - `name`: stem of its file name, for example `fit`.
    - `caption`: what it shows, and what is left out.
    - `legend`: entries of the legend above the panels; by default, everything that is drawn with a
      label.
    """

    name: str
    caption: str
    panels: tuple[Panel, ...]
    grid: Layout
    legend: Sequence[Key] = ()

    @property
    def alt(self) -> str:
        """Description for somebody who cannot see the figure: the caption, and the ranges of the
        numbers in every panel.
        """
        return " ".join([self.caption, *(panel.reach for panel in self.panels if panel.data)])


def drawings(name: str, inputs: ReportInputs) -> list[Drawing]:
    """Return the figures that a spec requests by this name; an empty list if there is nothing to
    draw.

    The module of the same name, from mapmore or from a plugin, makes the figures in its function
    `draw`.
    """
    module = _modules().get(name)
    if module is None:
        return []
    try:
        figures: list[Drawing] = module.draw(inputs)
        if not module.__name__.startswith("mapmore_cli."):
            # drawn here once, because a figure of a plug-in may fail only when it is drawn
            for drawing in figures:
                compose(drawing, inputs.style)
    except Exception as fault:
        if plugins.blamed(fault) is None:
            raise
        plugins.leave_plugin_out("figures", name, fault)
        return []
    return figures


@cache
def _modules() -> dict[str, ModuleType]:
    """Return the modules of this package and of plugins, by name. A module with the name of a
    figure draws this figure; the other modules only provide functions.
    """
    assert __package__ is not None
    return {part.name: part.value for part in plugins.parts("figures", ModuleType, __package__)}


def panel_of(name: str, inputs: ReportInputs, words: str) -> tuple[Drawing, Panel]:
    """Return the panel of a curve, a recording or a model, together with its figure, even if the
    page does not show this panel.

    - `words`: key of the panel. For a curve, its level is enough (`250` or `250 kPa` for
      `pressure=250`). For a recording that was cut from a log, the name of the log is enough.

    Raises UsageError for an unknown panel; the message names the known ones.
    """
    ids, dataset = inputs.ids_of(words), inputs.dataset
    every = [curve.id for curve in dataset.curves] + [
        recording.id for recording in dataset.recordings
    ]
    known: dict[str, None] = {}
    for asked in (inputs.asked, ids, frozenset(every)):
        for drawing in drawings(name, replace(inputs, asked=asked)):
            for panel in drawing.panels:
                if panel.key in {words, *ids}:
                    return drawing, panel
                known[panel.key] = None
    names = ", ".join(filter(None, known))
    raise UsageError(
        f"no panel of this figure is called {words!r}",
        f"choose one of {names}" if names else "leave the panel out",
    )


NARROW = 3.5
"""Largest width in inches of a panel that is still readable on a screen of 400 pixels."""


@dataclass(frozen=True)
class RenderedFigure:
    """Figure as SVG.

    - `width`: width of the figure, inches.
    - `columns`: number of panels side by side. On a narrow screen, these panels are placed below
      each other.
    - `numbers`: the data from which the figure was drawn, as CSV.
    """

    name: str
    caption: str
    svg: str
    width: float
    columns: int = 1
    numbers: str = ""

    @property
    def is_wide(self) -> bool:
        """Return True if a panel is wider than a narrow screen, so that a reader must scroll it
        there.
        """
        return self.width / self.columns > NARROW


def render_figure(drawing: Drawing, style: FigureStyle = PLAIN) -> RenderedFigure:
    """Draw all panels of a figure as one SVG."""
    with figure_style(style):
        figure = compose(drawing, style)
        return RenderedFigure(
            drawing.name,
            drawing.caption,
            to_svg(figure, drawing.name, drawing.alt),
            float(figure.get_figwidth()),
        )


class Arrangement(NamedTuple):
    """The panels of a figure with their headings, the number of panels side by side, and their
    total width in inches.
    """

    panels: tuple[Panel, ...]
    headings: list[str]
    columns: int
    width: float


def arranged(
    drawing: Drawing, style: FigureStyle, panel: Panel | None = None, width: float | None = None
) -> Arrangement:
    """Return the arrangement of all panels of a figure on a page. If a `panel` is given, return the
    arrangement of this panel alone, in the width that the style defines.

    A `width`, in inches, limits the width of all panels together, so that fewer panels than usual
    may stand side by side.
    """
    grid, panels = drawing.grid, drawing.panels if panel is None else (panel,)
    columns = min(grid.columns or (2 if len(panels) == 4 else 3), len(panels))
    if panel is not None:
        width = style.width
    elif width is not None:
        columns = min(columns, max(1, int(columns * width / DOUBLE)))
    width = width or grid.width or (SINGLE if len(panels) == 1 else DOUBLE)
    names = [title_of(drawn.title) for drawn in drawing.panels]
    headings = titles(names, int((width / columns - BESIDE) / _letter(style.size - 1)))
    headings_of_panels = [headings[drawing.panels.index(drawn)] for drawn in panels]
    return Arrangement(panels, headings_of_panels, columns, width)


def _letter(size: float) -> float:
    """Return the mean width, in inches, of a letter of a font with this size in points."""
    return 0.55 * size / POINTS


def legend_columns(labels: Sequence[str], width: float, size: float) -> int:
    """Return how many entries of a legend are placed side by side in a `width` in inches, with a
    font size in points. The longest label determines the largest possible number. A smaller number
    is returned if this makes the rows of entries more equal.
    """
    most = max(1, int(width / (_letter(size) * (max(map(len, labels)) + 7.6))))
    return math.ceil(len(labels) / math.ceil(len(labels) / most))


def compose(
    drawing: Drawing,
    style: FigureStyle = PLAIN,
    panel: Panel | None = None,
    width: float | None = None,
) -> Figure:
    """Draw all panels of a figure as they are arranged on a page. If a `panel` is given, draw this
    panel alone, with the legend of the figure, in the width that the style defines.

    A `width`, in inches, limits the width of all panels together, so that fewer panels than usual
    may stand side by side.
    """
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    grid, stack = drawing.grid, len(drawing.grid.stack)
    panels, headings, columns, width = arranged(drawing, style, panel, width)
    rows = math.ceil(len(panels) / columns)
    figure = Figure(figsize=(width, rows * grid.height), dpi=POINTS)
    every = figure.subplots(
        stack * rows,
        columns,
        height_ratios=[*grid.stack] * rows,
        sharex=grid.common_x,
        sharey=grid.common_y,
        squeeze=False,
        subplot_kw={"projection": grid.projection},
    )
    of_panels = every.reshape(rows, stack, columns).swapaxes(1, 2).reshape(-1, stack)
    for drawn, heading, axes in zip(panels, headings, of_panels, strict=False):
        _fill([*axes], drawn, heading, grid, style, columns)
    for ax in of_panels[len(panels) :].flat:
        ax.remove()
    handles = [key.artist() for key in drawing.legend] or _labelled(figure)
    figure.set_figheight(rows * grid.height + (0.45 if handles else 0.2))
    if handles:
        labels = [title_of(str(handle.get_label())) for handle in handles]
        ncols = legend_columns(labels, width, style.size - 1)
        scale = 1.0 if drawing.legend else LEGEND_SCALE
        figure.legend(handles, labels, loc="outside upper left", ncols=ncols, markerscale=scale)
    figure.align_ylabels()
    # the layout is computed only here, so that all file formats have the same positions
    ConstrainedLayoutEngine().execute(figure)
    return figure


def _fill(
    axes: Sequence[Axes], panel: Panel, title: str, grid: Layout, style: FigureStyle, columns: int
) -> None:
    """Draw a panel, with its title above it and the label of its x axis below it."""
    top, bottom = axes[0], axes[-1]
    for ax in axes:
        if ax is not top and not grid.common_x:
            ax.sharex(top)
        ax.tick_params(labelbottom=ax is bottom)
    bottom.locator_params(axis="x", nbins=5 if columns < 2 else 4)
    panel.draw(*axes)
    for ax, label in zip(axes, panel.y_labels, strict=False):
        spec = ax.get_subplotspec()
        if (spec is not None and spec.is_first_col()) or grid.common_y == "none":
            ax.set_ylabel(label, parse_math=style.is_own_label(label))
    top.set_title(title)
    bottom.set_xlabel(panel.x_label, parse_math=style.is_own_label(panel.x_label))


def _labelled(figure: Figure) -> list[Any]:
    """Return the entries of the legend: everything that is drawn with a label, each label once."""
    handles: dict[str, Any] = {}
    for ax in figure.axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    return [*handles.values()]


SVG_PROLOGUE = '<?xml version="1.0" encoding="utf-8"?>\n'
DOTS_PER_INCH = 300

_PROLOGUE = re.compile(r"\A.*?(?=<svg\b)", re.DOTALL)
_GROUP_ID = re.compile(r'<g id="(?:(map)|[^"]*)"')


def to_svg(figure: Figure, name: str, alt: str) -> str:
    """Return an `<svg>` element for a page or for a separate file. `alt` is its description.

    The element contains no date and no creator. Definitions are named by a hash of their content
    and of the `name`, so that the same figure always gives the same text. Names of groups
    (`axes_1`) are removed, because they would repeat between the figures of a page. A group with
    the name `map` gets the class `map` instead, so that a dark page does not invert its colours.
    """
    from matplotlib import rc_context

    text = io.StringIO()
    with rc_context({"svg.hashsalt": name}):
        figure.savefig(
            text,
            format="svg",
            metadata={"Date": None, "Creator": None, "Format": None, "Type": None},
        )
    svg_text = _PROLOGUE.sub("", xml_text(text.getvalue(), "\n"))
    svg = _GROUP_ID.sub(lambda group: '<g class="map"' if group[1] else "<g", svg_text)
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(xml_text(alt))}" ', 1)


def to_bytes(figure: Figure, suffix: str, name: str, alt: str) -> bytes:
    """Return the contents of a file with a figure, in the format with this `suffix`. `name` is the
    name of the figure, and `alt` is its description. Call this function in the context
    `figure_style`.

    Neither a date nor the name of a program is written. The fonts of a PDF are embedded as Type 42,
    which journals accept.
    """
    if suffix == "svg":
        return (SVG_PROLOGUE + to_svg(figure, name, alt)).encode()
    if suffix == "pgf":
        # imported only if needed, because this takes a third of the time of all imports for figures
        from mapmore_cli.reporting.pgf import to_pgf

        return to_pgf(figure).encode()
    from matplotlib import rc_context

    unsaid = dict.fromkeys(("CreationDate", "Creator", "Producer"))
    metadata: dict[str, Any] = (
        {**unsaid, "Title": alt} if suffix == "pdf" else {"Software": None, "Description": alt}
    )
    file = io.BytesIO()
    with rc_context({"pdf.fonttype": 42}):
        figure.savefig(file, format=suffix, dpi=DOTS_PER_INCH, metadata=metadata)
    return file.getvalue()
