"""Errors over the size of what was measured: where along the range a model fails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.domain.arrays import Array
from mapmore_cli.reporting.figures import style
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import ModelStyle
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import title_of

DOTS = 600
"""In a panel by itself; half as many where panels stand side by side, which are smaller."""


@dataclass(frozen=True)
class ModelErrors:
    """Predicted minus measured over the measured value, for one model: training and held-out
    samples, each sorted by the measured value.
    """

    model: str
    train: tuple[Array, Array]
    held_out: tuple[Array, Array]

    @property
    def failed(self) -> bool:
        """True where the model gave no prediction at all."""
        return not np.isfinite(np.concatenate([self.train[1], self.held_out[1]])).any()


def model_errors(inputs: ReportInputs) -> list[ModelErrors]:
    """All samples of the dataset, pooled, one panel a model."""
    curves = inputs.dataset.curves
    measured = np.concatenate([curve.columns[inputs.dataset.target] for curve in curves])
    held_out = np.concatenate([curve.held_out for curve in curves])
    order = np.argsort(measured, kind="stable")
    train, validate = order[~held_out[order]], order[held_out[order]]
    panels = []
    for model in inputs.shown:
        error = np.concatenate(inputs.validation.predictions[model]) - measured
        panels.append(
            ModelErrors(
                model, (measured[train], error[train]), (measured[validate], error[validate])
            )
        )
    return panels


def draw_errors(ax: Axes, panel: ModelErrors, look: ModelStyle, dots: int = DOTS) -> None:
    """Draw training samples as pale dots under the held-out ones in the model's colour; both
    thinned so that the extremes remain.
    """
    style.zero_line(ax)
    for (measured, error), colour, size in (
        (panel.train, style.LIGHT, 1.6),
        (panel.held_out, look.colour, 2.2),
    ):
        if np.isfinite(error).any():
            rows = style.cloud(measured, error, dots)
            ax.plot(
                measured[rows],
                error[rows],
                linestyle="none",
                marker=look.marker,
                markersize=size,
                markeredgewidth=0,
                color=colour,
            )
    if panel.failed:
        ax.text(0.5, 0.6, "failed", transform=ax.transAxes, ha="center")


def _tell_beyond(ax: Axes, panel: ModelErrors, unit: str) -> None:
    """Write how large the errors are that the panel does not show."""
    largest = np.nanmax(np.abs(np.concatenate([panel.train[1], panel.held_out[1]])))
    words = f"beyond the scale: up to {largest:.3g} {unit}"
    ax.text(0.98, 0.98, words, transform=ax.transAxes, ha="right", va="top", fontsize=style.small())


def draw(inputs: ReportInputs) -> list[Drawing]:
    """One panel a model, all with the same axes."""
    found, styles = (
        model_errors(inputs),
        style.model_styles([*inputs.lines, *inputs.models], inputs.style.palette),
    )
    near = [
        error
        for one in found
        if one.model not in inputs.far_off
        for _, error in (one.train, one.held_out)
    ]
    limits = (style.extent(near),) if inputs.far_off else ()
    most = DOTS if len(found) == 1 else DOTS // 2
    panels = tuple(_panel(inputs, one, styles[one.model], limits, most) for one in found)
    grid = Grid(
        style.columns_for(len(panels)),
        style.width_for(len(panels)),
        1.75,
        common_x=True,
        common_y="all",
    )
    held_out = any(len(one.held_out[0]) for one in found)
    dots = (
        "pale dots are training samples, coloured ones were held out"
        if held_out
        else "all samples are training samples"
    )
    thinned = max(len(measured) for measured, _ in (found[0].train, found[0].held_out)) > most
    what = f"Error (predicted minus measured) over the measured {inputs.target.name}"
    models = ", ".join(title_of(one.model) for one in found)
    caption = (
        f"{what}, all curves pooled; "
        f"{dots}.{style.SOME_DOTS if thinned else ''}{style.beyond_scale(inputs.far_off)}"
    )
    return [Drawing("error", caption, f"{what} for {models}.", panels, grid)]


def _panel(
    inputs: ReportInputs,
    errors: ModelErrors,
    look: ModelStyle,
    limits: tuple[tuple[float, float], ...],
    most: int,
) -> Panel:
    def on(axes: Sequence[Axes]) -> None:
        draw_errors(axes[0], errors, look, most)
        if errors.model in inputs.far_off:
            _tell_beyond(axes[0], errors, inputs.target.unit)

    (x_train, y_train), (x_held, y_held) = errors.train, errors.held_out
    unit = inputs.target.unit
    data: dict[str, Values] = {
        f"measured {inputs.target.name} [{unit}]": np.concatenate([x_train, x_held]),
        f"error [{unit}]": np.concatenate([y_train, y_held]),
        "data": ["train"] * len(x_train) + ["validate"] * len(x_held),
    }
    return Panel(
        errors.model,
        on,
        inputs.axis_label(inputs.target, "measured"),
        (f"Error ({unit})",),
        data,
        errors.model,
        limits,
    )
