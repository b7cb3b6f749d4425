"""Draw the searches for the sections of models of motion: the smallest error so far, iteration by
iteration (section 2.2 of Brown and Xie 2024).
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.annexes.motion.body import FALL, MotionFit
from mapmore_cli.reporting.figures.drawing import DOUBLE, Drawing, Layout, Panel
from mapmore_cli.reporting.figures.panels import key, plain_logarithm
from mapmore_cli.reporting.figures.style import BLACK, GREY
from mapmore_cli.reporting.inputs import ReportInputs

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return a panel for each model of motion, with a line for each of its sections; none if there
    is no such model.
    """
    fits = {name: fit for name, fit in inputs.fits.items() if isinstance(fit, MotionFit)}
    if not fits:
        return []
    unit = inputs.target.unit
    panels = []
    for name, fit in fits.items():
        sizes = [len(search.history) for search in fit.searches]
        data = {
            "section": np.repeat([search.section for search in fit.searches], sizes),
            "iteration": np.concatenate([np.arange(size) for size in sizes]),
            f"lowest RMSE [{unit}]": np.concatenate([search.history for search in fit.searches]),
        }
        labels = ("Iteration", (f"Lowest RMSE ({unit})",))
        on = partial(draw_searches, fit=fit)
        panels.append(Panel(name, on, *labels, data, name))
    handles = (key("section", color=BLACK), key("of a falling input", color=GREY, linestyle="--"))
    caption = (
        "Lowest RMSE of every section over its own training samples, by the number of iterations "
        "(for least squares, of simulations). If the "
        "sections share a state, it is the RMSE before they were joined."
    )
    grid = Layout(columns=3, width=DOUBLE)
    return [Drawing("convergence", caption, tuple(panels), grid, handles)]


def draw_searches(ax: Axes, fit: MotionFit) -> None:
    """Draw the smallest error so far of every section, iteration by iteration."""
    for section, search in zip(fit.model.sections, fit.searches, strict=True):
        colour, line = (GREY, "--") if section.direction == FALL else (BLACK, "-")
        # a logarithmic axis cannot show the error of an exact fit, which is zero
        best = np.maximum(search.history, np.finfo(np.float64).tiny)
        ax.plot(best, color=colour, linestyle=line, linewidth=0.7)
    plain_logarithm(ax, "y")
