"""Errors over the size of what was measured: where along the range a model fails."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mapmore_cli.domain.arrays import Array
from mapmore_cli.reporting.figures.drawing import Drawing
from mapmore_cli.reporting.figures.panels import columns_for, width_for
from mapmore_cli.reporting.figures.style import (
    LIGHT,
    SOME_DOTS,
    ModelStyle,
    axis_label,
    beyond_scale,
    hold_scale,
    model_styles,
    zero_line,
)
from mapmore_cli.reporting.figures.thinning import cloud
from mapmore_cli.reporting.inputs import ReportInputs

DOTS = 600


@dataclass(frozen=True)
class ErrorPanel:
    """Predicted minus measured over the measured value, for one model: training and held-out samples, each sorted by the measured value."""

    model: str
    train: tuple[Array, Array]
    held_out: tuple[Array, Array]

    @property
    def failed(self) -> bool:
        """True where the model gave no prediction at all."""
        return not np.isfinite(np.concatenate([self.train[1], self.held_out[1]])).any()


def error_panels(inputs: ReportInputs) -> list[ErrorPanel]:
    """All samples of the dataset, pooled, one panel a model."""
    curves = inputs.dataset.curves
    measured = np.concatenate([curve.columns[inputs.dataset.target] for curve in curves])
    held_out = np.concatenate([curve.held_out for curve in curves])
    order = np.argsort(measured, kind="stable")
    train, validate = order[~held_out[order]], order[held_out[order]]
    panels = []
    for model, of_curves in inputs.validation.predictions.items():
        error = np.concatenate(of_curves) - measured
        panels.append(ErrorPanel(model, (measured[train], error[train]), (measured[validate], error[validate])))
    return panels


def draw_errors(ax: Axes, panel: ErrorPanel, style: ModelStyle) -> None:
    """Training samples as pale dots under the held-out ones in the model's colour; both thinned so that the extremes remain."""
    zero_line(ax)
    for (measured, error), colour, size in ((panel.train, LIGHT, 1.6), (panel.held_out, style.colour, 2.2)):
        if np.isfinite(error).any():
            rows = cloud(measured, error, DOTS)
            ax.plot(measured[rows], error[rows], linestyle="none", marker=style.marker, markersize=size, markeredgewidth=0, color=colour)
    if panel.failed:
        ax.text(0.5, 0.6, "failed", transform=ax.transAxes, ha="center")


def _tell_beyond(ax: Axes, panel: ErrorPanel, unit: str) -> None:
    """Write how large the errors are that the panel does not show."""
    largest = np.nanmax(np.abs(np.concatenate([panel.train[1], panel.held_out[1]])))
    ax.text(0.98, 0.98, f"beyond the scale: up to {largest:.3g} {unit}", transform=ax.transAxes, ha="right", va="top", fontsize=7)


def error_figures(inputs: ReportInputs) -> list[Drawing]:
    """One panel a model, all with the same axes."""
    panels, styles = error_panels(inputs), model_styles([*inputs.lines, *inputs.models])
    columns = columns_for(len(panels))
    rows = math.ceil(len(panels) / columns)
    figure = Figure(figsize=(width_for(len(panels)), 0.4 + 1.75 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for number, ax in enumerate(axes.flat):
        if number >= len(panels):
            ax.remove()
            continue
        draw_errors(ax, panels[number], styles[panels[number].model])
        ax.set_title(panels[number].model)
        ax.tick_params(labelbottom=True)
        ax.set_xlabel(axis_label(inputs.target, "measured"))
        if number % columns == 0:
            ax.set_ylabel(f"Error ({inputs.target.unit})")
    if inputs.far_off:
        near = [error for panel in panels if panel.model not in inputs.far_off for _, error in (panel.train, panel.held_out)]
        hold_scale(axes[0, 0], near)
        for ax, panel in zip(axes.flat, panels, strict=False):
            if panel.model in inputs.far_off:
                _tell_beyond(ax, panel, inputs.target.unit)
    held_out = any(len(panel.held_out[0]) for panel in panels)
    dots = "pale dots are training samples, coloured ones were held out" if held_out else "all samples are training samples"
    thinned = max(len(measured) for measured, _ in (panels[0].train, panels[0].held_out)) > DOTS
    what = f"Error (predicted minus measured) over the measured {inputs.target.name}"
    models = ", ".join(panel.model for panel in panels)
    caption = f"{what}, all curves pooled; {dots}.{SOME_DOTS if thinned else ''}{beyond_scale(inputs.far_off)}"
    return [Drawing("error", caption, f"{what} for {models}.", figure)]
