"""The figures by the names that a spec uses: each is the function `draw` of the module of its name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module

from mapmore_cli.domain.page import FIGURES
from mapmore_cli.reporting.figures.drawing import Drawing, compose
from mapmore_cli.reporting.figures.saving import to_svg
from mapmore_cli.reporting.figures.style import figure_style
from mapmore_cli.reporting.inputs import FigureStyle, ReportInputs


def drawings(name: str, inputs: ReportInputs) -> list[Drawing]:
    """The figures behind a name: none where there is nothing to draw (no segments), or several (two variables)."""
    found: list[Drawing] = import_module(f"{__package__}.{name}").draw(inputs)
    return found


@dataclass(frozen=True)
class RenderedFigure:
    """A figure as SVG; `width` in inches."""

    name: str
    caption: str
    svg: str
    width: float


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
