"""Residual tests, as system identification has them: are a model's errors correlated with
themselves, or with the inputs?
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.validation.residuals import (
    Correlation,
    PartMeans,
    autocorrelation,
    cross_correlation,
    means_over,
)
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel, Values
from mapmore_cli.reporting.figures.panels import draw_dots, zero_line
from mapmore_cli.reporting.figures.style import LIGHT, model_styles
from mapmore_cli.reporting.inputs import ReportInputs

FEWEST = 20
"""Samples below which nothing is tested."""

CHANCE = 0.05
"""Share that lies outside of the bounds by chance."""


@dataclass(frozen=True)
class Stretch:
    """Rows of a curve that follow one another: of a recording in order of time, or along the
    in-curve quantity; (n,) each.
    """

    residuals: Array
    inputs: dict[str, Array]


def stretches(inputs: ReportInputs) -> list[Stretch]:
    """Return the held-out samples, or the training samples where nothing is held out."""
    curves, made = inputs.dataset.curves, []
    for curve, predicted in zip(curves, inputs.validation.predictions[inputs.own], strict=True):
        wanted = curve.held_out if inputs.holds_out else curve.training
        errors = predicted - curve.columns[inputs.dataset.target]
        logs: Sequence[IntArray] = curve.logs
        if not inputs.timed:
            logs = [np.argsort(curve.columns[inputs.in_curve.name], kind="stable")]
        for rows in (order[wanted[order]] for order in logs):
            names = [q.name for q in inputs.model.inputs if q.name in curve.columns]
            if np.isfinite(errors[rows]).any():
                columns = {name: curve.columns[name][rows] for name in names}
                made.append(Stretch(errors[rows], columns))
    return made


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return a panel for the autocorrelation and one for each input; none where samples are few, or
    errors are all alike.
    """
    parts = stretches(inputs)
    residuals = [part.residuals for part in parts]
    if max(map(len, residuals), default=0) < FEWEST:
        return []
    every = np.concatenate(residuals)
    if np.isfinite(every).sum() < FEWEST or not np.nanstd(every) > 0:
        return []
    colour = model_styles([inputs.own], inputs.style.palette)[inputs.own].colour
    own = autocorrelation(residuals)
    lag = "Lag (samples)" if inputs.timed else f"Lag along {inputs.in_curve.name} (samples)"
    title = "of the residuals"
    panels = [_panel("autocorrelation", own, colour, lag, "Autocorrelation (–)", title)]
    words = []
    for quantity in inputs.model.inputs:
        test = _with_input(inputs, parts, quantity)
        if test is None:
            continue
        labels = (inputs.axis_label(quantity), f"Mean error ({inputs.target.unit})", "over")
        if inputs.timed:
            labels = ("Lag behind the input (samples)", "Correlation (–)", "with")
        name = quantity.name
        panels.append(_panel(name, test, colour, *labels[:2], f"{labels[2]} {name}"))
        words.append(f"{name} {test.beyond} of {test.tested} outside")
    rows = "held-out" if inputs.holds_out else "training"
    caption = (
        f"Residual tests of {inputs.own} on the {rows} samples. Grey: where 95 % lie if the "
        f"errors are noise. {_sentence(inputs, own)} {_inputs_sentence(inputs, words)}"
    )
    alt = f"Residual tests: {'; '.join([_sentence(inputs, own), *words])}."
    return [Drawing("residuals", caption, alt, tuple(panels), Layout(1.9))]


def _with_input(
    inputs: ReportInputs, parts: Sequence[Stretch], quantity: Quantity
) -> Correlation | PartMeans | None:
    """Return the test with an input; None where it does not vary, or was not measured."""
    if any(quantity.name not in part.inputs for part in parts):
        return None
    columns = [part.inputs[quantity.name] for part in parts]
    every = np.concatenate(columns)
    if not np.nanstd(every) > 1e-9 * np.nanmax(np.abs(every)):
        return None
    residuals = [part.residuals for part in parts]
    if inputs.timed:
        return cross_correlation(residuals, columns)
    return means_over(np.concatenate(residuals), every)


def _sentence(inputs: ReportInputs, own: Correlation) -> str:
    """Return what the autocorrelation says, in plain words."""
    along = "in time" if inputs.timed else f"along {inputs.in_curve.name}"
    count = f"{own.beyond} of {own.tested} lags lie outside"
    if own.beyond <= max(1.0, 2 * CHANCE * own.tested):
        return (
            f"Autocorrelation: {count}, about as many as by chance: neighbouring errors "
            f"{along} tell nothing of each other."
        )
    cause = "dynamics" if inputs.timed else "shape"
    return (
        f"Autocorrelation: {count}: neighbouring errors {along} are alike, so there is "
        f"{cause} (or drift) that the model misses."
    )


def _inputs_sentence(inputs: ReportInputs, words: Sequence[str]) -> str:
    if not words:
        return "No input varies."
    meaning = (
        "At a lag outside, the input acts in a way that the model lacks; at a negative one "
        "the output acts back on it."
        if inputs.timed
        else "In a part outside, the model is too high or too low on the whole."
    )
    return f"Inputs: {', '.join(words)}. {meaning}"


def _panel(
    key: str, test: Correlation | PartMeans, colour: str, x_label: str, y_label: str, title: str
) -> Panel:
    if isinstance(test, Correlation):
        x, bounds = test.lags, np.full(len(test.lags), test.bound)
    else:
        x, bounds = test.places, test.bounds
    data: dict[str, Values] = {x_label: x, y_label: test.values, "95 % bound": bounds}
    on = partial(draw_test, x=x, values=test.values, bounds=bounds, colour=colour)
    return Panel(key, on, x_label, (y_label,), data, title)


def draw_test(ax: Axes, x: Array, values: Array, bounds: Array, colour: str) -> None:
    """Draw values as stems over the range in which those of noise lie."""
    ax.fill_between(x, -bounds, bounds, color=LIGHT, alpha=0.5, linewidth=0)
    zero_line(ax)
    ax.vlines(x, 0.0, values, color=colour, linewidth=0.8)
    draw_dots(ax, x, values, color=colour, markersize=2.5)
