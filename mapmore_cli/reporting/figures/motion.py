"""Recordings of motion over time, measured and predicted, as M2's figures 12, 13 and 15."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from mapmore_cli.domain.arrays import IntArray
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import (
    BLACK,
    DOUBLE,
    GREY,
    ModelStyle,
    draw_interval,
    interval_key,
    interval_words,
    model_styles,
    places,
    shortened,
    some_of,
    zero_line,
)
from mapmore_cli.reporting.figures.thinning import envelope
from mapmore_cli.reporting.inputs import ReportInputs

MOST_RECORDINGS = 4
MOST_WAVEFORMS = 8
"""Recordings that are shown where there are models of motion among the compared."""
MOST_RIVALS = 4
POINTS_A_LINE = 2000
MEASURED = 0.9
"""Width of a measured line."""
PLATEAU = "#f0f0f0"
CROSSING: Mapping[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 3.5}
"""Where the input comes into another section."""


def motion_figures(inputs: ReportInputs) -> list[Drawing]:
    """Draw recordings with held-out samples, and training recordings in another figure: target above, error below, the plateau shaded."""
    numbers = {
        "fit": [i for i, curve in enumerate(inputs.dataset.curves) if curve.held_out.any()],
        "training": [i for i, curve in enumerate(inputs.dataset.curves) if not curve.held_out.any()],
    }
    return [_figure(inputs, name, found) for name, found in numbers.items() if found]


def _figure(inputs: ReportInputs, name: str, numbers: list[int]) -> Drawing:
    most = MOST_WAVEFORMS if inputs.motions else MOST_RECORDINGS
    shown = [numbers[i] for i in places(inputs, [inputs.dataset.curves[i].id for i in numbers], most)]
    models = shown_models(inputs, MOST_RIVALS)
    styles = model_styles(models, inputs.style.palette)
    resting = any(curve.at_rest is not None and curve.at_rest.any() for curve in inputs.dataset.curves)
    mixed = any(_mixed(inputs.dataset.curves[number]) for number in shown)
    sections = any(fit.model.boundaries for fit in inputs.motions.values())
    what = "held-out" if name == "fit" else "training"
    rivals = len(inputs.models) - len(models)
    others = f" The best {len(models) - 1} of {len(inputs.models) - 1} competitors are drawn." if rivals else ""
    rest = " The plateau is grey: it is scored, and trains nothing." if resting else ""
    rest += " The measured line is grey where samples train." if mixed else ""
    rest += interval_words(inputs)
    caption = (
        f"Measured and predicted {inputs.target.name} of the {what} recordings over time, predicted minus measured below.{rest}{others}"
        f"{some_of(len(shown), len(numbers), f'{what} recordings')}"
    )
    alt = f"Measured and predicted {inputs.target.name} over time, {what} recordings."
    panels = tuple(_panel(inputs, number, styles) for number in shown)
    grid = Grid(width=DOUBLE, height=2.5, stack=(2.0, 1.0))
    interval = None if inputs.left_out is None else interval_key(styles[inputs.own].colour)
    return Drawing(name, caption, alt, panels, grid, tuple(_legend(styles, resting, mixed, sections, interval)))


def _panel(inputs: ReportInputs, number: int, styles: dict[str, ModelStyle]) -> Panel:
    curve = inputs.dataset.curves[number]
    time, unit = inputs.dataset.quantities.get("time", Quantity("time", "s")), inputs.target.unit
    ends = inputs.interval(number) or ()
    data: dict[str, Values] = {
        f"time [{time.unit}]": curve.columns["time"],
        f"{inputs.target.name} [{unit}]": curve.columns[inputs.dataset.target],
        "data": np.where(curve.held_out, "validate", "train"),
        **{f"{model} [{unit}]": inputs.validation.predictions[model][number] for model in styles},
        **{f"{inputs.own} {end} [{unit}]": values for end, values in zip(("low", "high"), ends, strict=False)},
    }
    labels = (inputs.axis_label(inputs.target), f"Error ({unit})")
    title = shortened(inputs.curve_label(curve), 60)
    return Panel(curve.id, lambda axes: _draw(inputs, number, axes, styles), inputs.axis_label(time), labels, data, title)


def shown_models(inputs: ReportInputs, most_rivals: int) -> list[str]:
    """Return the run's own model and the competitors with the least pooled error, in the order of the table."""
    errors = inputs.pooled_errors
    best = sorted((model for model in inputs.models[1:] if model in errors), key=lambda model: errors[model])[:most_rivals]
    return [model for model in inputs.models if model in {inputs.own, *best}]


def _draw(inputs: ReportInputs, number: int, axes: Sequence[Axes], styles: dict[str, ModelStyle]) -> None:
    top, bottom = axes
    curve = inputs.dataset.curves[number]
    time, measured = curve.columns["time"], curve.columns[inputs.dataset.target]
    for ax in (top, bottom):
        for start, end in _plateaus(curve):
            ax.axvspan(start, end, color=PLATEAU, zorder=-1, linewidth=0)
    interval = inputs.interval(number)
    for piece in curve.logs:
        rows = piece[envelope(measured[piece], POINTS_A_LINE)]
        if interval is not None:
            low, high = (end[rows] for end in interval)
            own, colour = inputs.validation.predictions[inputs.own][number][rows], styles[inputs.own].colour
            draw_interval(top, time[rows], (low, high), colour)
            draw_interval(bottom, time[rows], (low - own, high - own), colour)
        top.plot(time[rows], measured[rows], color=GREY if _mixed(curve) else BLACK, linewidth=MEASURED, zorder=2)
        if _mixed(curve):
            top.plot(time[rows], np.where(curve.held_out, measured, np.nan)[rows], color=BLACK, linewidth=MEASURED, zorder=2)
        for model, style in styles.items():
            predicted = inputs.validation.predictions[model][number]
            rows = piece[envelope(predicted[piece], POINTS_A_LINE)]
            look = {"color": style.colour, "linestyle": style.dashes, "linewidth": style.width, "zorder": style.zorder}
            top.plot(time[rows], predicted[rows], **look)
            bottom.plot(time[rows], (predicted - measured)[rows], **look)
        if (crossed := _crossed(inputs, curve, piece)) is not None:
            top.plot(time[crossed], measured[crossed], color=BLACK, zorder=4, **CROSSING)
    zero_line(bottom)


def _crossed(inputs: ReportInputs, curve: Curve, piece: IntArray) -> IntArray | None:
    """Return samples at which the input of a piecewise model of motion comes into another section; None without such a model."""
    piecewise = next((fit.model for fit in inputs.motions.values() if fit.model.boundaries), None)
    if piecewise is None or piecewise.input not in curve.columns:
        return None
    places = np.searchsorted(np.asarray(piecewise.boundaries), curve.columns[piecewise.input][piece], side="right")
    return piece[np.flatnonzero(np.diff(places)) + 1]


def _mixed(curve: Curve) -> bool:
    """Whether some of its samples train and others are held out."""
    return bool(curve.held_out.any() and not curve.held_out.all())


def _plateaus(curve: Curve) -> list[tuple[float, float]]:
    if curve.at_rest is None:
        return []
    resting = [rows[curve.at_rest[rows]] for rows in curve.logs]
    return [(float(curve.columns["time"][rows[0]]), float(curve.columns["time"][rows[-1]])) for rows in resting if len(rows)]


def _legend(styles: dict[str, ModelStyle], resting: bool, mixed: bool, sections: bool, interval: Patch | None) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [Line2D([], [], color=BLACK, linewidth=MEASURED, label="held out" if mixed else "measured")]
    if mixed:
        handles.append(Line2D([], [], color=GREY, linewidth=MEASURED, label="training"))
    for model, style in styles.items():
        handles.append(Line2D([], [], color=style.colour, linestyle=style.dashes, linewidth=style.width, label=model))
    if sections:
        handles.append(Line2D([], [], color=BLACK, label="section boundary", **CROSSING))
    handles += [] if interval is None else [interval]
    return [*handles, Patch(color=PLATEAU, label="plateau")] if resting else handles
