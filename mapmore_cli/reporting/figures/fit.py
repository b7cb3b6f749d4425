"""Measured and predicted: over time for recordings of motion and models with memory, with loops for
these, else over the in-curve quantity.

Curves stand as in M2's figures 9, 10, 12, 13 and 15: what the models predict above and their errors
below. Training curves of a static model share one panel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.models import Formula, Pieces
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.domain.scores import OWN
from mapmore_cli.modelling.signals.sampling import envelope
from mapmore_cli.reporting.figures import panels, style
from mapmore_cli.reporting.figures.drawing import DOUBLE, Drawing, Layout, Panel, Values
from mapmore_cli.reporting.figures.style import ModelStyle
from mapmore_cli.reporting.inputs import MOST_LINES, ReportInputs
from mapmore_cli.reporting.table import title_of

MOST_TIMED, MOST_LOOPS, MOST_SPANS, MOST_CURVES = 5, 3, 6, 10
"""Models over time; recordings and models of loops; grey regions of a curve; training curves."""


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return the figures of the fit that suit the study."""
    curves = inputs.dataset.curves
    held_out = [
        i for i, curve in enumerate(curves) if curve.held_out.any() or curve.id in inputs.asked
    ]
    if not inputs.timed:
        return [*curve_figures(inputs, "fit", held_out), *training_figures(inputs)]
    others = [i for i in range(len(curves)) if i not in held_out]
    return [
        *(loop_figures(inputs) if inputs.has_memory else []),
        *curve_figures(inputs, "fit", held_out),
        *curve_figures(inputs, "training", others),
    ]


@dataclass(frozen=True)
class CurveFit:
    """Samples of one curve in the order in which they are drawn, each `(n,)`: measured `y` over
    `x`, and every model's prediction.

    - `interval`: the ends of the intervals of the run's own model, the first, where it has some.
    - `pieces`: the rows of its recordings, where it is drawn over time; else empty.
    - `shaded`: the ranges of `x` that are grey: plateaus, or what was held out of a training curve.
    """

    title: str
    x: Array
    y: Array
    held_out: BoolArray
    predictions: Mapping[str, Array]
    interval: tuple[Array, Array] | None
    pieces: Sequence[IntArray]
    shaded: Sequence[tuple[float, float]]

    def predicted(self, model: str) -> bool:
        """Return False where the model gave no prediction, because its fit failed."""
        return bool(np.isfinite(self.predictions[model]).any())


def curve_fit(inputs: ReportInputs, number: int, training: bool = False) -> CurveFit:
    """Curve `number` of the dataset with the models that lines are drawn of, or only its training
    samples with the run's own.
    """
    curve = inputs.dataset.curves[number]
    x = curve.columns[_axis(inputs).name]
    rows = np.arange(curve.size) if inputs.timed else np.argsort(x, kind="stable")
    models = inputs.best(MOST_TIMED if inputs.timed else MOST_LINES)
    if training:
        rows, models = rows[~curve.held_out[rows]], models[:1]
    ends = inputs.interval(number)
    return CurveFit(
        inputs.curve_label(curve),
        x[rows],
        curve.columns[inputs.dataset.target][rows],
        curve.held_out[rows],
        {model: inputs.validation.predictions[model][number][rows] for model in models},
        None if ends is None else (ends[0][rows], ends[1][rows]),
        curve.logs if inputs.timed else (),
        _plateaus(curve) if inputs.timed else held_out_spans(x[rows], curve.held_out[rows]),
    )


def _axis(inputs: ReportInputs) -> Quantity:
    """Return what curves are drawn over."""
    time = inputs.dataset.quantities.get("time", Quantity("time", "s"))
    return time if inputs.timed else inputs.in_curve


def held_out_spans(x: Array, held_out: BoolArray) -> list[tuple[float, float]]:
    """Return runs of held-out samples along sorted `x` as (start, end), each reaching halfway to
    the neighbouring training samples; none of scattered samples, or where none trains.
    """
    edges = np.flatnonzero(np.diff(held_out, prepend=False, append=False)).reshape(-1, 2)
    if held_out.all() or len(edges) > MOST_SPANS:
        return []
    middle = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2, x[-1:]])
    return [(float(middle[start]), float(middle[end])) for start, end in edges]


def _plateaus(curve: Curve) -> list[tuple[float, float]]:
    at_rest = np.zeros(curve.size, dtype=bool) if curve.at_rest is None else curve.at_rest
    times = [curve.columns["time"][rows[at_rest[rows]]] for rows in curve.logs]
    return [(float(resting[0]), float(resting[-1])) for resting in times if len(resting)]


def draw_fit(
    top: Axes,
    bottom: Axes,
    curve: CurveFit,
    styles: Mapping[str, ModelStyle],
    far_off: Sequence[str] = (),
) -> None:
    """Draw measured samples and every model as a line above, predicted minus measured below.

    Over time, measured samples are a line; else dots, filled where held out. A model without
    prediction draws nothing, and the axes do not grow for one that is far off.
    """
    panels.zero_line(bottom)
    for start, end in curve.shaded:
        for ax in (top, bottom):
            ax.axvspan(start, end, color=style.SHADE, zorder=-1, linewidth=0)
    _draw_measured(top, curve)
    draw_line = panels.draw_trace if curve.pieces else panels.draw_band
    for rows in curve.pieces or [np.arange(len(curve.x))]:
        x, y = curve.x[rows], curve.y[rows]
        for model, values in curve.predictions.items():
            if curve.predicted(model):
                look: dict[str, Any] = {**styles[model].line, "sets_scale": model not in far_off}
                draw_line(top, x, values[rows], label=model, **look)
                draw_line(bottom, x, values[rows] - y, label=model, **look)
        if curve.interval is not None:
            own, values = next(iter(curve.predictions.items()))
            low, high = (end[rows] for end in curve.interval)
            panels.shade_between(top, x, (low, high), styles[own].colour)
            below, above = low - values[rows], high - values[rows]
            panels.shade_between(bottom, x, (below, above), styles[own].colour)


def _draw_measured(ax: Axes, curve: CurveFit) -> None:
    for rows, colour, face in (
        (~curve.held_out, style.GREY, "none"),
        (curve.held_out, style.BLACK, style.BLACK),
    ):
        look: dict[str, Any] = {"color": colour, "zorder": 2}
        if rows.any() and not curve.pieces:
            look |= {"markersize": 2.2, "markeredgewidth": 0.5, "markerfacecolor": face}
            panels.draw_dots(ax, curve.x[rows], curve.y[rows], **look)
        for piece in curve.pieces if rows.any() else ():
            measured = np.where(rows, curve.y, np.nan)[piece]
            panels.draw_trace(ax, curve.x[piece], measured, linewidth=0.9, **look)


def curve_figures(inputs: ReportInputs, name: str, numbers: Sequence[int]) -> list[Drawing]:
    """One pair of axes a curve of these numbers: what is predicted above, the errors below; no
    figure where there is none.
    """
    shown = panels.some_curves(inputs, numbers)
    if not shown:
        return []
    curves = [curve_fit(inputs, number) for number in shown]
    styles = style.model_styles([*curves[0].predictions], inputs.style.palette)
    far_off = [model for model in inputs.far_off if model in styles]
    unit = inputs.target.unit
    labels = (inputs.axis_label(inputs.target), f"Error ({unit})")
    figure = tuple(
        Panel(
            inputs.dataset.curves[i].id,
            partial(draw_fit, curve=curve, styles=styles, far_off=far_off),
            inputs.axis_label(_axis(inputs)),
            labels,
            curve_data(inputs, curve),
            curve.title,
        )
        for i, curve in zip(shown, curves, strict=True)
    )
    grid = Layout(2.65, (2.0, 1.0), common_x=True, common_y="row")
    if inputs.timed:
        grid = Layout(2.5, (2.0, 1.0), columns=1, width=DOUBLE)
    what = f"Measured and predicted {inputs.target.name}"
    which = "training" if name == "training" else "held-out"
    things = "recordings" if inputs.timed else "curves"
    caption = (
        f"{what} of the {which} {things}{' over time' if inputs.timed else ''}, predicted minus "
        f"measured below.{_marks(inputs, curves)}{panels.interval_words(inputs)}"
        f"{'' if inputs.timed else panels.thinned([len(curve.x) for curve in curves])}"
        f"{panels.some_of(len(shown), len(numbers), f'{which} {things}')}"
        f"{panels.best_of(len(styles), len(inputs.models))}{panels.beyond_scale(far_off)}"
        f"{own_words(inputs)}"
    )
    return [Drawing(name, caption, figure, grid, _legend(inputs, curves, styles))]


def own_words(inputs: ReportInputs) -> str:
    """Return what a caption says of `mapmore` where no pieces stand behind the name: a formula that
    was fitted to this data, or models of other runs.
    """
    if inputs.own != OWN or isinstance(inputs.model.body, Pieces):
        return ""
    if isinstance(inputs.model.body, Formula):
        return f" {OWN} is {inputs.model.body.backbone.name}, fitted to the training samples here."
    others = ", ".join(one.name for one in inputs.model.body.models)
    return f" {OWN} is made of {others}." if others else ""


def _marks(inputs: ReportInputs, curves: Sequence[CurveFit]) -> str:
    """Return what a caption says of filled dots, grey lines and grey backgrounds."""
    mixed = any(curve.held_out.any() and not curve.held_out.all() for curve in curves)
    if not inputs.timed:
        words = " Filled dots and grey bands mark held-out samples, open dots training samples."
        return words if mixed else ""
    plateau = " The plateau is grey: it is scored, and trains nothing."
    return (plateau if inputs.over_time else "") + (
        " The measured line is grey where samples train." if mixed else ""
    )


def _legend(
    inputs: ReportInputs, curves: Sequence[CurveFit], styles: Mapping[str, ModelStyle]
) -> list[Any]:
    held_out = any(curve.held_out.any() for curve in curves)
    training = not all(curve.held_out.all() for curve in curves)
    shape = {"linewidth": 0.9} if inputs.timed else panels.DOT
    face = {} if inputs.timed else {"markerfacecolor": "none"}
    handles: list[Any] = []
    if held_out:
        label = "held out" if training else "measured"
        handles.append(panels.key(label, color=style.BLACK, **shape))
    if training:
        label = "training" if inputs.holds_out else "measured"
        handles.append(panels.key(label, color=style.GREY, **shape, **face))
    for model, look in styles.items():
        if any(curve.predicted(model) for curve in curves):
            handles.append(panels.key(model, **look.line))
        else:
            cross = look.line | {"linestyle": "none", "marker": "x"}
            handles.append(panels.key(f"{title_of(model)} (failed)", **cross))
    if curves[0].interval is not None:
        handles.append(panels.interval_key(next(iter(styles.values())).colour))
    if inputs.over_time:
        handles.append(Patch(color=style.SHADE, label="plateau"))
    return handles


def curve_data(inputs: ReportInputs, curve: CurveFit) -> dict[str, Values]:
    """Return what is drawn of a curve, by heading: measured, whether held out, and what every model
    predicts.
    """
    unit = inputs.target.unit
    low, high = curve.interval or ((), ())
    ends = {f"{inputs.own} low [{unit}]": low, f"{inputs.own} high [{unit}]": high}
    return {
        panels.heading(_axis(inputs)): curve.x,
        panels.heading(inputs.target): curve.y,
        "data": np.where(curve.held_out, "validate", "train"),
        **{f"{model} [{unit}]": values for model, values in curve.predictions.items()},
        **(ends if curve.interval else {}),
    }


# Training curves of a static model
# --------------------------------------------------------------------------------------------------


def training_figures(inputs: ReportInputs) -> list[Drawing]:
    """One figure for the training curves, or for some of them where they are many."""
    numbers = [i for i, curve in enumerate(inputs.dataset.curves) if not curve.held_out.all()]
    shown = [numbers[i] for i in panels.evenly(len(numbers), MOST_CURVES)]
    if not shown:
        return []
    curves = [curve_fit(inputs, number, training=True) for number in shown]
    own, unit = (
        style.model_styles([inputs.own], inputs.style.palette)[inputs.own],
        inputs.target.unit,
    )
    columns = [curve_data(inputs, curve) for curve in curves]
    data: dict[str, Values] = {"curve": [curve.title for curve in curves for _ in curve.x]}
    for name in columns[0]:
        data[name] = np.concatenate([column[name] for column in columns])
    panel = Panel(
        "",
        partial(draw_training_curves, curves=curves, own_colour=own.colour),
        inputs.axis_label(inputs.in_curve),
        (inputs.axis_label(inputs.target), f"Error ({unit})"),
        data,
    )
    legend = [panels.key(inputs.own, color=own.colour, linewidth=own.width)]
    names = panels.told_apart([curve.title for curve in curves], 24)
    for name, colour in zip(names, style.level_colours(len(curves)), strict=True):
        legend.append(panels.key(name, color=colour, **panels.DOT))
    caption = (
        f"The training curves with {inputs.own} above, its error (predicted minus measured) below."
        f"{panels.thinned([len(curve.x) for curve in curves])}"
        f"{panels.some_of(len(curves), len(numbers), 'training curves')}{own_words(inputs)}"
    )
    return [Drawing("fit_training", caption, (panel,), Layout(2.95, (2.2, 1.0)), legend)]


def draw_training_curves(
    top: Axes, bottom: Axes, curves: Sequence[CurveFit], own_colour: str
) -> None:
    """Draw measured samples coloured by curve with the model's lines over them, and the errors in
    the same colours.
    """
    panels.zero_line(bottom)
    for curve, colour in zip(curves, style.level_colours(len(curves)), strict=True):
        panels.draw_dots(top, curve.x, curve.y, color=colour, markersize=2.0)
        for model, predicted in curve.predictions.items():
            if curve.predicted(model):
                panels.draw_band(top, curve.x, predicted, color=own_colour, zorder=3)
                panels.draw_band(bottom, curve.x, predicted - curve.y, color=colour, linewidth=0.8)


# Loops of a model with memory
# --------------------------------------------------------------------------------------------------


def loop_figures(inputs: ReportInputs) -> list[Drawing]:
    """Draw a row of panels for each held-out recording: the run's own model over the measured
    loops, and its best competitors.
    """
    numbers = [i for i, curve in enumerate(inputs.dataset.curves) if curve.held_out.any()]
    shown = panels.some_curves(inputs, numbers, MOST_LOOPS)
    if not shown:
        return []
    models = inputs.best(MOST_LOOPS)
    styles = style.model_styles(models, inputs.style.palette)
    loops = tuple(_loop(inputs, i, model, styles[model].colour) for i in shown for model in models)
    what = f"Measured and predicted {inputs.target.name} over {inputs.in_curve.name}"
    caption = (
        f"{what} along the held-out samples, in the order of time."
        f"{panels.best_of(len(models), len(inputs.models))}"
        f"{panels.some_of(len(shown), len(numbers), 'recordings with held-out samples')}"
    )
    legend = [
        panels.key("measured", color=style.BLACK),
        *(panels.key(model, color=look.colour) for model, look in styles.items()),
    ]
    grid = Layout(2.3, columns=len(models), common_y="row")
    return [Drawing("loops", caption, loops, grid, legend)]


def _loop(inputs: ReportInputs, number: int, model: str, colour: str) -> Panel:
    curve, along, target = inputs.dataset.curves[number], inputs.in_curve, inputs.target
    x, measured = curve.columns[along.name], curve.columns[inputs.dataset.target]
    predicted = inputs.validation.predictions[model][number]
    pieces: list[IntArray] = []
    for rows in curve.logs:  # each run of held-out samples is a path of its own
        held = rows[curve.held_out[rows]]
        pieces += np.split(held, np.flatnonzero(np.diff(held) > 1) + 1)

    def on(ax: Axes) -> None:
        for piece in pieces:
            for y, ink, width in ((measured, style.BLACK, 0.9), (predicted, colour, 1.6)):
                bends = [envelope(values[piece], 2 * panels.DOTS) for values in (x, y)]
                path = piece[np.union1d(*bends)]
                ax.plot(x[path], y[path], color=ink, linewidth=width)

    rows = np.concatenate(pieces)
    data: dict[str, Values] = {
        panels.heading(along): x[rows],
        panels.heading(target): measured[rows],
        f"{model} [{target.unit}]": predicted[rows],
    }
    labels = (inputs.axis_label(along), (inputs.axis_label(target),))
    title = f"{inputs.curve_label(curve)}: {title_of(model)}"
    return Panel(f"{curve.id} {model}", on, *labels, data, title)
