"""Draw errors over the measured value, to show where in the range a model fails."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.reporting.figures import panels
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.style import LIGHT, ModelStyle
from mapmore_cli.reporting.inputs import ReportInputs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHARE = ("axes fraction", "axes fraction")


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return a figure with one panel for each model; all panels have the same axes. A panel shows
    the samples of all curves. Training samples are pale dots. Held-out samples are dots in the
    colour of the model, drawn on top of the pale dots.
    """
    target, unit, looks = inputs.target.name, inputs.target.unit, panels.looks_of(inputs)
    order = np.argsort(inputs.pooled(inputs.dataset.target), kind="stable")
    x = inputs.pooled(inputs.dataset.target)[order]
    held_out = inputs.pooled_held_out[order]

    def on(ax: Axes, error: Array, look: ModelStyle, words: str) -> None:
        """Draw the errors of a model. If some or all dots lie outside the axes or are missing,
        `words` is a remark with the reason, which is written into the panel.
        """
        panels.zero_line(ax)
        for rows, colour, size in ((~held_out, LIGHT, 1.6), (held_out, look.colour, 2.2)):
            dots = {"color": colour, "markersize": size, "marker": look.marker}
            panels.draw_dots(
                ax, x[rows], error[rows], 2 * panels.DOTS, sets_scale=not words, **dots
            )
        if words:
            panels.write_at(ax, words, (0.98, 0.98), (0, 0), xycoords=SHARE, ha="right", va="top")

    drawn = []
    for model in inputs.shown:
        error = inputs.errors_of(model)[order]
        words = "" if np.isfinite(error).any() else "failed"
        if model in inputs.far_off:
            words = f"beyond the scale: up to {np.nanmax(np.abs(error)):.3g} {unit}"
        data = {
            f"measured {target} [{unit}]": x,
            f"error [{unit}]": error,
            "data": np.where(held_out, "validate", "train"),
        }
        labels = (inputs.axis_label(inputs.target, "measured"), (f"Error ({unit})",))
        draw_errors = partial(on, error=error, look=looks[model], words=words)
        drawn.append(Panel(model, draw_errors, *labels, data, model))
    dots = (
        "pale dots are training samples, coloured ones were held out"
        if held_out.any()
        else "all samples are training samples"
    )
    caption = (
        f"Error (predicted minus measured) over the measured {target}, all curves pooled; {dots}."
        f"{panels.SOME_DOTS if len(x) > panels.DOTS else ''}{panels.beyond_scale(inputs.far_off)}"
    )
    grid = Layout(1.75, common_x=True, common_y="all")
    return [Drawing("error", caption, tuple(drawn), grid)]
