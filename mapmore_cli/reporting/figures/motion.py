"""Recordings over time, measured and predicted, as M2's figures 12, 13 and 15; and their paths over
what drives them: hysteresis loops.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.reporting.figures import style
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import ModelStyle
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import title_of

MOST_RECORDINGS, MOST_LOOPS = 4, 3
MOST_WAVEFORMS = 8
"""Recordings that are shown where there are models of motion among the compared."""
MOST_RIVALS, MOST_LOOP_RIVALS = 4, 2
POINTS_A_LINE, POINTS_A_PATH = 2000, 600
MEASURED = 0.9
"""Width of a measured line."""
PLATEAU = "#f0f0f0"
CROSSING: Mapping[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 3.5}
"""Where the input comes into another section."""


def _best_rivals(inputs: ReportInputs, most: int) -> tuple[list[str], str]:
    """Return the run's own model and the competitors with the least pooled error, in the order of
    the table; and a sentence about them.
    """
    errors = inputs.pooled_errors
    best = sorted(
        (model for model in inputs.models[1:] if model in errors), key=lambda model: errors[model]
    )[:most]
    shown = [model for model in inputs.models if model in {inputs.own, *best}]
    left_out = len(shown) < len(inputs.models)
    return (
        shown,
        f" The best {len(shown) - 1} of {len(inputs.models) - 1} competitors are drawn."
        if left_out
        else "",
    )


def motion_figures(inputs: ReportInputs) -> list[Drawing]:
    """Draw recordings with held-out samples, and training recordings in another figure: target
    above, error below, the plateau shaded.
    """
    held = [curve.held_out.any() for curve in inputs.dataset.curves]
    numbers = {
        "fit": np.flatnonzero(held).tolist(),
        "training": np.flatnonzero(np.logical_not(held)).tolist(),
    }
    return [_figure(inputs, name, found) for name, found in numbers.items() if found]


def _figure(inputs: ReportInputs, name: str, numbers: list[int]) -> Drawing:
    curves = inputs.dataset.curves
    shown = style.some_curves(inputs, numbers, MOST_WAVEFORMS if inputs.fits else MOST_RECORDINGS)
    models, others = _best_rivals(inputs, MOST_RIVALS)
    styles = style.model_styles(models, inputs.style.palette)
    resting = any(curve.at_rest is not None and curve.at_rest.any() for curve in curves)
    mixed = any(_mixed(curves[number]) for number in shown)
    what = "held-out" if name == "fit" else "training"
    rest = " The plateau is grey: it is scored, and trains nothing." if resting else ""
    rest += " The measured line is grey where samples train." if mixed else ""
    caption = (
        f"Measured and predicted {inputs.target.name} of the {what} recordings over time, "
        "predicted minus measured below."
        f"{rest}{style.interval_words(inputs)}{others}"
        f"{style.some_of(len(shown), len(numbers), f'{what} recordings')}"
    )
    alt = f"Measured and predicted {inputs.target.name} over time, {what} recordings."
    handles: list[Line2D | Patch] = [
        style.key("held out" if mixed else "measured", color=style.BLACK, linewidth=MEASURED)
    ]
    handles += [style.key("training", color=style.GREY, linewidth=MEASURED)] if mixed else []
    handles += [style.key(model, **look.line) for model, look in styles.items()]
    if any(fit.model.boundaries for fit in inputs.fits.values()):
        handles.append(style.key("section boundary", color=style.BLACK, **CROSSING))
    handles += [] if inputs.left_out is None else [style.interval_key(styles[inputs.own].colour)]
    handles += [Patch(color=PLATEAU, label="plateau")] if resting else []
    panels = tuple(_panel(inputs, number, styles) for number in shown)
    return Drawing(
        name,
        caption,
        alt,
        panels,
        Grid(width=style.DOUBLE, height=2.5, stack=(2.0, 1.0)),
        tuple(handles),
    )


def _panel(inputs: ReportInputs, number: int, styles: dict[str, ModelStyle]) -> Panel:
    curve, unit = inputs.dataset.curves[number], inputs.target.unit
    time = inputs.dataset.quantities.get("time", Quantity("time", "s"))
    data: dict[str, Values] = {
        style.heading(time): curve.columns["time"],
        style.heading(inputs.target): curve.columns[inputs.dataset.target],
        "data": np.where(curve.held_out, "validate", "train"),
        **{f"{model} [{unit}]": inputs.validation.predictions[model][number] for model in styles},
        **{
            f"{inputs.own} {end} [{unit}]": x
            for end, x in zip(("low", "high"), inputs.interval(number) or (), strict=False)
        },
    }
    labels = (inputs.axis_label(inputs.target), f"Error ({unit})")
    title = style.shortened(inputs.curve_label(curve), 60)
    return Panel(
        curve.id,
        lambda axes: _draw(inputs, number, axes, styles),
        inputs.axis_label(time),
        labels,
        data,
        title,
    )


def _draw(
    inputs: ReportInputs, number: int, axes: Sequence[Axes], styles: dict[str, ModelStyle]
) -> None:
    top, bottom = axes
    curve = inputs.dataset.curves[number]
    time, measured = curve.columns["time"], curve.columns[inputs.dataset.target]
    for ax in (top, bottom):
        for start, end in _plateaus(curve):
            ax.axvspan(start, end, color=PLATEAU, zorder=-1, linewidth=0)
    interval = inputs.interval(number)
    for piece in curve.logs:
        rows = piece[style.envelope(measured[piece], POINTS_A_LINE)]
        if interval is not None:
            low, high = (end[rows] for end in interval)
            own, colour = (
                inputs.validation.predictions[inputs.own][number][rows],
                styles[inputs.own].colour,
            )
            style.draw_interval(top, time[rows], (low, high), colour)
            style.draw_interval(bottom, time[rows], (low - own, high - own), colour)
        top.plot(
            time[rows],
            measured[rows],
            color=style.GREY if _mixed(curve) else style.BLACK,
            linewidth=MEASURED,
            zorder=2,
        )
        if _mixed(curve):
            top.plot(
                time[rows],
                np.where(curve.held_out, measured, np.nan)[rows],
                color=style.BLACK,
                linewidth=MEASURED,
                zorder=2,
            )
        for model, look in styles.items():
            predicted = inputs.validation.predictions[model][number]
            rows = piece[style.envelope(predicted[piece], POINTS_A_LINE)]
            top.plot(time[rows], predicted[rows], **look.line)
            bottom.plot(time[rows], (predicted - measured)[rows], **look.line)
        if (crossed := _crossed(inputs, curve, piece)) is not None:
            top.plot(time[crossed], measured[crossed], color=style.BLACK, zorder=4, **CROSSING)
    style.zero_line(bottom)


def _crossed(inputs: ReportInputs, curve: Curve, piece: IntArray) -> IntArray | None:
    """Return samples at which the input of a piecewise model of motion comes into another section;
    None without such a model.
    """
    piecewise = next((fit.model for fit in inputs.fits.values() if fit.model.boundaries), None)
    if piecewise is None or piecewise.input not in curve.columns:
        return None
    places = np.searchsorted(
        np.asarray(piecewise.boundaries), curve.columns[piecewise.input][piece], side="right"
    )
    return piece[np.flatnonzero(np.diff(places)) + 1]


def _mixed(curve: Curve) -> bool:
    """Whether some of its samples train and others are held out."""
    return bool(curve.held_out.any() and not curve.held_out.all())


def _plateaus(curve: Curve) -> list[tuple[float, float]]:
    if curve.at_rest is None:
        return []
    resting = [rows[curve.at_rest[rows]] for rows in curve.logs]
    return [
        (float(curve.columns["time"][rows[0]]), float(curve.columns["time"][rows[-1]]))
        for rows in resting
        if len(rows)
    ]


def loop_figures(inputs: ReportInputs) -> list[Drawing]:
    """Draw a row of panels for each held-out recording: the run's own model over the measured
    loops, and its best competitors.
    """
    numbers = [i for i, curve in enumerate(inputs.dataset.curves) if curve.held_out.any()]
    shown = style.some_curves(inputs, numbers, MOST_LOOPS)
    if not shown:
        return []
    models, best = _best_rivals(inputs, MOST_LOOP_RIVALS)
    styles = style.model_styles(models, inputs.style.palette)
    panels = tuple(
        _loop(inputs, number, model, styles[model]) for number in shown for model in models
    )
    what = f"Measured and predicted {inputs.target.name} over {inputs.in_curve.name}"
    left_out = style.some_of(len(shown), len(numbers), "recordings with held-out samples")
    caption = f"{what} along the held-out samples, in the order of time.{best}{left_out}"
    alt = f"{what}, held-out samples in the order of time."
    legend = [style.key("measured", color=style.BLACK, linewidth=MEASURED)]
    legend += [
        style.key(model, color=look.colour, linewidth=style.OWN_STYLE.width)
        for model, look in styles.items()
    ]
    return [
        Drawing(
            "loops",
            caption,
            alt,
            panels,
            Grid(len(models), style.width_for(len(models)), 2.3, common_y="row"),
            tuple(legend),
        )
    ]


def _loop(inputs: ReportInputs, number: int, model: str, look: ModelStyle) -> Panel:
    curve, along, target = inputs.dataset.curves[number], inputs.in_curve, inputs.target
    x, measured = curve.columns[along.name], curve.columns[inputs.dataset.target]
    predicted = inputs.validation.predictions[model][number]
    pieces = _held_out_pieces(curve)

    def on(axes: Sequence[Axes]) -> None:
        for piece in pieces:
            _path(
                axes[0], x[piece], measured[piece], color=style.BLACK, linewidth=MEASURED, zorder=2
            )
            _path(
                axes[0],
                x[piece],
                predicted[piece],
                color=look.colour,
                linewidth=style.OWN_STYLE.width,
                zorder=3,
            )

    rows = np.concatenate(pieces)
    data: dict[str, Values] = {
        style.heading(along): x[rows],
        style.heading(target): measured[rows],
        f"{model} [{target.unit}]": predicted[rows],
    }
    title = (
        f"{style.shortened(inputs.curve_label(curve), 22)}: {style.shortened(title_of(model), 24)}"
    )
    return Panel(
        f"{curve.id} {model}",
        on,
        inputs.axis_label(along),
        (inputs.axis_label(target),),
        data,
        title,
    )


def _path(ax: Axes, x: Array, y: Array, **look: object) -> None:
    rows = np.union1d(style.envelope(x, POINTS_A_PATH // 2), style.envelope(y, POINTS_A_PATH // 2))
    ax.plot(x[rows], y[rows], **look)  # type: ignore[arg-type]


def _held_out_pieces(curve: Curve) -> list[IntArray]:
    """Row numbers of every run of held-out samples of one recording."""
    pieces: list[IntArray] = []
    for rows in curve.logs:
        held = rows[curve.held_out[rows]]
        pieces += [
            piece for piece in np.split(held, np.flatnonzero(np.diff(held) > 1) + 1) if len(piece)
        ]
    return pieces
