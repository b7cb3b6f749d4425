"""The figures by the names that a spec uses."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from matplotlib import rc_context, rcdefaults

from mapmore_cli.reporting.figures.drawing import Drawing, to_svg
from mapmore_cli.reporting.figures.errors import error_figures
from mapmore_cli.reporting.figures.fit import fit_figures
from mapmore_cli.reporting.figures.loops import loop_figures
from mapmore_cli.reporting.figures.motion import motion_figures
from mapmore_cli.reporting.figures.scores import nrmse_figures
from mapmore_cli.reporting.figures.segments import segment_figures
from mapmore_cli.reporting.figures.style import RC
from mapmore_cli.reporting.figures.terms import terms_figures
from mapmore_cli.reporting.figures.traces import data_figures
from mapmore_cli.reporting.figures.training import training_figures
from mapmore_cli.reporting.inputs import ReportInputs


def _fit_figures(inputs: ReportInputs) -> list[Drawing]:
    """Over time where curves are recordings of motion, and as loops where the model has memory; else over the in-curve quantity."""
    if inputs.has_memory:
        return [*loop_figures(inputs), *motion_figures(inputs)]
    return motion_figures(inputs) if inputs.over_time else [*fit_figures(inputs), *training_figures(inputs)]


FIGURES: Mapping[str, Callable[[ReportInputs], list[Drawing]]] = {
    "data": data_figures,
    "fit": _fit_figures,
    "error": error_figures,
    "nrmse": nrmse_figures,
    "segments": segment_figures,
    "terms": terms_figures,
}


@contextmanager
def figure_style() -> Iterator[None]:
    """The report's style over Matplotlib's own defaults: a user's matplotlibrc must not change a report."""
    with rc_context():
        rcdefaults()
        with rc_context(RC):
            yield


@dataclass(frozen=True)
class RenderedFigure:
    """A figure as SVG; `width` in inches."""

    name: str
    caption: str
    svg: str
    width: float


def rendered_figures(inputs: ReportInputs, names: Sequence[str]) -> dict[str, list[RenderedFigure]]:
    """The figures behind each name, in the order of the page; a name may have none (no segments) or several (two variables)."""
    with figure_style():
        return {name: [rendered(drawing) for drawing in draw(inputs)] for name, draw in FIGURES.items() if name in names}


def rendered(drawing: Drawing) -> RenderedFigure:
    """A drawing as SVG; call it within `figure_style`."""
    return RenderedFigure(drawing.name, drawing.caption, to_svg(drawing), float(drawing.figure.get_figwidth()))
