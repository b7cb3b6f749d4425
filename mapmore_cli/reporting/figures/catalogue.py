"""The figures by the names that a spec uses: each is the function `draw` of the module of its name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.scores import FIGURES
from mapmore_cli.reporting.figures.drawing import Drawing, Panel, compose, find_panel
from mapmore_cli.reporting.figures.saving import to_svg
from mapmore_cli.reporting.figures.style import figure_style
from mapmore_cli.reporting.inputs import FigureStyle, ReportInputs


def drawings(name: str, inputs: ReportInputs) -> list[Drawing]:
    """Return the figures behind a name: none where there is nothing to draw (no segments), or several (two variables)."""
    found: list[Drawing] = import_module(f"{__package__}.{name}").draw(inputs)
    return found


def panel_of(name: str, inputs: ReportInputs, words: str) -> tuple[Drawing, Panel]:
    """Return the panel of a curve, a recording or a model, also of one that the page leaves out.

    - `words`: the panel's key, or what a user calls a curve: its level alone (`250`, `250 kPa` for `pressure=250`), or a log that was cut.

    Raises UsageError where there is no such panel; the message names those that there are.
    """
    ids = inputs.ids_of(words)
    if found := find_panel(drawings(name, inputs), (words, *ids)):
        return found
    if ids and (found := find_panel(drawings(name, replace(inputs, asked=ids)), ids)):
        return found
    all_ids = frozenset([curve.id for curve in inputs.dataset.curves] + [recording.id for recording in inputs.dataset.recordings])
    every = (panel.key for drawing in drawings(name, replace(inputs, asked=all_ids)) for panel in drawing.panels)
    names = ", ".join(key for key in dict.fromkeys(every) if key)
    raise UsageError(f"no panel of this figure is called {words!r}", f"choose one of {names}" if names else "leave the panel out")


@dataclass(frozen=True)
class RenderedFigure:
    """A figure as SVG; `width` in inches, `numbers` is the file of what it was drawn from, empty where there is none."""

    name: str
    caption: str
    svg: str
    width: float
    numbers: str = ""


def rendered(drawing: Drawing, style: FigureStyle | None = None) -> RenderedFigure:
    """All panels of a figure as one SVG."""
    with figure_style(style):
        figure = compose(drawing, style)
        return RenderedFigure(drawing.name, drawing.caption, to_svg(figure, drawing.name, drawing.alt), float(figure.get_figwidth()))


def rendered_by_section(found: Sequence[tuple[str, RenderedFigure]]) -> dict[str, list[RenderedFigure]]:
    """Figures with the names that the spec has for them, by the section of the page, in its order."""
    sections: dict[str, list[RenderedFigure]] = {}
    for name, section in FIGURES.items():
        sections.setdefault(section, []).extend(figure for of, figure in found if of == name)
    return sections
