"""Figures of the page that no run draws: lines over a common axis, one journal column wide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.scores import OWN
from mapmore_cli.reporting.figures.saving import to_svg
from mapmore_cli.reporting.figures.style import BLACK, figure_style, level_colours, model_styles
from mapmore_cli.reporting.inputs import SINGLE

MEASURED = "measured"
HEIGHT = 1.6
"""Inches of a panel."""


@dataclass(frozen=True)
class Panel:
    """Axes with a label, and the lines on them by name, each as places and values, `(n,)`; what is called measured is black, or dots."""

    label: str
    lines: Mapping[str, tuple[Array, Array]]


def lines(name: str, panels: Sequence[Panel], x_label: str, *, ordered: bool = False) -> str:
    """An `<svg>` of panels below each other. `ordered` lines come in pairs, dots and the model of one level, from pale to dark."""
    with figure_style():
        figure = Figure(figsize=(SINGLE, 0.5 + HEIGHT * len(panels) * (1.5 if ordered else 1.0)), layout="constrained")
        every = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
        for axes, panel in zip(every, panels, strict=True):
            axes.set_ylabel(panel.label)
            models = [model for model in panel.lines if not model.endswith(MEASURED)]
            styles = model_styles(models if OWN in models else ["", *models])  # the first look is that of mapmore
            colours = dict(zip(models, level_colours(len(models)), strict=False)) if ordered else {}
            for model, (x, y) in panel.lines.items():
                if model.endswith(MEASURED):
                    dots = {"linestyle": "none", "marker": ".", "markersize": 3} if ordered else {"linewidth": 0.9}
                    axes.plot(x, y, color=colours.get(model.removesuffix(f", {MEASURED}"), BLACK), label=model, **dots)
                else:
                    style = styles[model]
                    look = {"color": colours[model]} if ordered else {"color": style.colour, "linestyle": style.dashes}
                    axes.plot(x, y, label=model, **look)
        every[-1].set_xlabel(x_label)
        if not ordered:
            figure.legend(*every[0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
        return to_svg(figure, name, f"{name}: {', '.join(panel.label for panel in panels)} over {x_label}")
