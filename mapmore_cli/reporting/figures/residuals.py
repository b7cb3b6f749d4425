"""Residual tests, as system identification has them: are a model's errors correlated with
themselves, or with the inputs?
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.validation.residuals import (
    Correlation,
    PartMeans,
    autocorrelation,
    cross_correlation,
    means_over,
)
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import (
    LIGHT,
    columns_for,
    model_styles,
    width_for,
    zero_line,
)
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
    curves = inputs.dataset.curves
    held_out = any(curve.held_out.any() for curve in curves)
    found = []
    for curve, predicted in zip(curves, inputs.validation.predictions[inputs.own], strict=True):
        wanted = curve.held_out if held_out else curve.training
        ordered = (
            curve.logs
            if _timed(inputs)
            else [np.argsort(curve.columns[inputs.in_curve.name], kind="stable")]
        )
        errors = predicted - curve.columns[inputs.dataset.target]
        for rows in (order[wanted[order]] for order in ordered):
            columns = {
                q.name: curve.columns[q.name][rows]
                for q in inputs.model.inputs
                if q.name in curve.columns
            }
            found.append(Stretch(errors[rows], columns))
    return [stretch for stretch in found if np.isfinite(stretch.residuals).any()]


def _timed(inputs: ReportInputs) -> bool:
    return inputs.has_memory or inputs.over_time


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return a panel for the autocorrelation and one for each input; none where samples are few, or
    errors are all alike.
    """
    found = stretches(inputs)
    every = np.concatenate([one.residuals for one in found]) if found else np.empty(0)
    known = every[np.isfinite(every)]
    if (
        len(known) < FEWEST
        or not known.std() > 0
        or max(len(one.residuals) for one in found) < FEWEST
    ):
        return []
    colour = model_styles([inputs.own], inputs.style.palette)[inputs.own].colour
    own = autocorrelation([one.residuals for one in found])
    lag = "Lag (samples)" if _timed(inputs) else f"Lag along {inputs.in_curve.name} (samples)"
    panels = [
        _panel("autocorrelation", own, colour, lag, "Autocorrelation (–)", "of the residuals")
    ]
    told = [_sentence(inputs, own)]
    for quantity, test in _with_inputs(inputs, found):
        if isinstance(test, Correlation):
            panels.append(
                _panel(
                    quantity.name,
                    test,
                    colour,
                    "Lag behind the input (samples)",
                    "Correlation (–)",
                    f"with {quantity.name}",
                )
            )
        else:
            label = f"Mean error ({inputs.target.unit})"
            panels.append(
                _panel(
                    quantity.name,
                    test,
                    colour,
                    inputs.axis_label(quantity),
                    label,
                    f"over {quantity.name}",
                )
            )
        told.append(f"{quantity.name} {test.beyond} of {test.tested} outside")
    rows = (
        "held-out" if any(curve.held_out.any() for curve in inputs.dataset.curves) else "training"
    )
    caption = (
        f"Residual tests of {inputs.own} on the {rows} samples. Grey: where 95 % lie if the "
        f"errors are noise. {told[0]} "
        f"{_inputs_sentence(inputs, told[1:])}"
    )
    grid = Grid(columns_for(len(panels)), width_for(len(panels)), 1.9)
    return [
        Drawing("residuals", caption, f"Residual tests: {'; '.join(told)}.", tuple(panels), grid)
    ]


def _with_inputs(
    inputs: ReportInputs, found: Sequence[Stretch]
) -> Iterator[tuple[Quantity, Correlation | PartMeans]]:
    """Yield the test with every input that varies."""
    for quantity in inputs.model.inputs:
        if any(quantity.name not in one.inputs for one in found):
            continue
        pieces = [one.inputs[quantity.name] for one in found]
        every = np.concatenate(pieces)
        if not np.nanstd(every) > 1e-9 * np.nanmax(np.abs(every)):
            continue
        residuals = [one.residuals for one in found]
        yield (
            quantity,
            cross_correlation(residuals, pieces)
            if _timed(inputs)
            else means_over(np.concatenate(residuals), every),
        )


def _sentence(inputs: ReportInputs, own: Correlation) -> str:
    """Return what the autocorrelation says, in plain words."""
    along = "in time" if _timed(inputs) else f"along {inputs.in_curve.name}"
    count = f"{own.beyond} of {own.tested} lags lie outside"
    if own.beyond <= max(1.0, 2 * CHANCE * own.tested):
        return (
            f"Autocorrelation: {count}, about as many as by chance: neighbouring errors "
            f"{along} tell nothing of each other."
        )
    cause = "dynamics" if _timed(inputs) else "shape"
    return (
        f"Autocorrelation: {count}: neighbouring errors {along} are alike, so there is "
        f"{cause} (or drift) that the model misses."
    )


def _inputs_sentence(inputs: ReportInputs, told: Sequence[str]) -> str:
    if not told:
        return "No input varies."
    meaning = (
        "At a lag outside, the input acts in a way that the model lacks; at a negative one "
        "the output acts back on it."
        if _timed(inputs)
        else "In a part outside, the model is too high or too low on the whole."
    )
    return f"Inputs: {', '.join(told)}. {meaning}"


def _panel(
    key: str, test: Correlation | PartMeans, colour: str, x_label: str, y_label: str, title: str
) -> Panel:
    x, bounds = (
        (test.lags, np.full(len(test.lags), test.bound))
        if isinstance(test, Correlation)
        else (test.places, test.bounds)
    )
    data: dict[str, Values] = {x_label: x, y_label: test.values, "95 % bound": bounds}
    return Panel(
        key,
        partial(_draw_test, x=x, values=test.values, bounds=bounds, colour=colour),
        x_label,
        (y_label,),
        data,
        title,
    )


def _draw_test(axes: Sequence[Axes], x: Array, values: Array, bounds: Array, colour: str) -> None:
    (ax,) = axes
    ax.fill_between(x, -bounds, bounds, color=LIGHT, alpha=0.5, linewidth=0)
    zero_line(ax)
    ax.vlines(x, 0.0, values, color=colour, linewidth=0.8)
    ax.plot(
        x, values, linestyle="none", marker="o", markersize=2.5, markeredgewidth=0, color=colour
    )
