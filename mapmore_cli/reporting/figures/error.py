"""Errors over the size of what was measured: where along the range a model fails."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.reporting.figures import panels, style
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.style import ModelStyle
from mapmore_cli.reporting.inputs import ReportInputs


def draw(inputs: ReportInputs) -> list[Drawing]:
    """One panel a model, all with the same axes: all samples pooled."""
    curves, unit = inputs.dataset.curves, inputs.target.unit
    measured = np.concatenate([curve.columns[inputs.dataset.target] for curve in curves])
    held_out = np.concatenate([curve.held_out for curve in curves])
    order = np.argsort(measured, kind="stable")
    x, held_out = measured[order], held_out[order]
    styles = style.model_styles([*inputs.lines, *inputs.models], inputs.style.palette)
    drawn = []
    for model in inputs.shown:
        error = (np.concatenate(inputs.validation.predictions[model]) - measured)[order]
        words = "" if np.isfinite(error).any() else "failed"
        if model in inputs.far_off:
            words = f"beyond the scale: up to {np.nanmax(np.abs(error)):.3g} {unit}"
        data = {
            f"measured {inputs.target.name} [{unit}]": x,
            f"error [{unit}]": error,
            "data": np.where(held_out, "validate", "train"),
        }
        on = partial(
            draw_errors, x=x, error=error, held_out=held_out, look=styles[model], words=words
        )
        labels = (inputs.axis_label(inputs.target, "measured"), (f"Error ({unit})",))
        drawn.append(Panel(model, on, *labels, data, model))
    dots = (
        "pale dots are training samples, coloured ones were held out"
        if held_out.any()
        else "all samples are training samples"
    )
    what = f"Error (predicted minus measured) over the measured {inputs.target.name}"
    caption = (
        f"{what}, all curves pooled; {dots}.{panels.SOME_DOTS if len(x) > panels.DOTS else ''}"
        f"{panels.beyond_scale(inputs.far_off)}"
    )
    grid = Layout(1.75, common_x=True, common_y="all")
    return [Drawing("error", caption, tuple(drawn), grid)]


def draw_errors(
    ax: Axes, x: Array, error: Array, held_out: BoolArray, look: ModelStyle, words: str
) -> None:
    """Draw training samples as pale dots under the held-out ones in the model's colour.

    `words` say why the axes show no dots, or not all of them.
    """
    panels.zero_line(ax)
    for rows, colour, size in ((~held_out, style.LIGHT, 1.6), (held_out, look.colour, 2.2)):
        dots = {"color": colour, "markersize": size, "marker": look.marker}
        panels.draw_dots(ax, x[rows], error[rows], 2 * panels.DOTS, sets_scale=not words, **dots)
    if words:
        ax.text(0.98, 0.98, words, transform=ax.transAxes, ha="right", va="top")
