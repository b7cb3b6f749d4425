"""How the searches of the sections of models of motion went: the lowest error so far, iteration by
iteration (P section 2.2).
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.annexes.motion.body import FALL, MotionFit
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import BLACK, DOUBLE, GREY, key, plain_logarithm, shortened
from mapmore_cli.reporting.inputs import ReportInputs

SIDE_BY_SIDE = 3


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return a panel for each model of motion, a line for each of its sections; none where there is
    no such model.
    """
    panels = [
        _panel(inputs, name, fit) for name, fit in inputs.fits.items() if isinstance(fit, MotionFit)
    ]
    if not panels:
        return []
    handles = (key("section", color=BLACK), key("of a falling input", color=GREY, linestyle="--"))
    caption = (
        "Lowest RMSE of every section over its own training samples, after so many iterations "
        "(of least squares: simulations). Where the "
        "sections share a state, before they were joined."
    )
    alt = f"Convergence of the searches of {len(panels)} models of motion."
    return [
        Drawing(
            "convergence",
            caption,
            alt,
            tuple(panels),
            Grid(min(SIDE_BY_SIDE, len(panels)), DOUBLE),
            handles,
        )
    ]


def _panel(inputs: ReportInputs, name: str, fit: MotionFit) -> Panel:
    unit = inputs.target.unit
    points = [(search, step) for search in fit.searches for step in range(len(search.history))]
    data: dict[str, Values] = {
        "section": [search.section for search, _ in points],
        "iteration": [step for _, step in points],
        f"lowest RMSE [{unit}]": [float(search.history[step]) for search, step in points],
    }
    return Panel(
        name,
        lambda axes: _draw_on(axes[0], fit),
        "Iteration",
        (f"Lowest RMSE ({unit})",),
        data,
        shortened(name, 24),
    )


def _draw_on(ax: Axes, fit: MotionFit) -> None:
    for section, search in zip(fit.model.sections, fit.searches, strict=True):
        falls = section.direction == FALL
        best = np.maximum(
            search.history, np.finfo(np.float64).tiny
        )  # an exact fit has no place on a logarithmic axis
        ax.plot(
            best, color=GREY if falls else BLACK, linestyle="--" if falls else "-", linewidth=0.7
        )
    plain_logarithm(ax.yaxis)
