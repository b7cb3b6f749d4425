"""Residual tests, as system identification has them: are a model's errors correlated with
themselves, or with the inputs?
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from matplotlib.axes import Axes

from mapmore_cli.domain.results import ResidualTest
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel, Values
from mapmore_cli.reporting.figures.panels import draw_dots, zero_line
from mapmore_cli.reporting.figures.style import LIGHT, model_styles
from mapmore_cli.reporting.inputs import ReportInputs

CHANCE = 0.05
"""Share that lies outside of the bounds by chance."""


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return a panel for the autocorrelation and one for each input; none where nothing was
    tested.
    """
    if not inputs.validation.residual_tests:
        return []
    own, *others = inputs.validation.residual_tests
    colour = model_styles([inputs.own], inputs.style.palette)[inputs.own].colour
    lag = "Lag (samples)" if inputs.timed else f"Lag along {inputs.in_curve.name} (samples)"
    panels = [_panel(own, colour, lag, "Autocorrelation (–)", "of the residuals")]
    words = []
    known = {quantity.name: quantity for quantity in inputs.model.inputs}
    for test in others:
        name = test.name
        labels = (inputs.axis_label(known[name]), f"Mean error ({inputs.target.unit})", "over")
        if inputs.timed:
            labels = ("Lag behind the input (samples)", "Correlation (–)", "with")
        panels.append(_panel(test, colour, *labels[:2], f"{labels[2]} {name}"))
        words.append(f"{name} {test.beyond} of {test.tested} outside")
    rows = "held-out" if inputs.holds_out else "training"
    caption = (
        f"Residual tests of {inputs.own} on the {rows} samples. Grey: where 95 % lie if the "
        f"errors are noise. {_sentence(inputs, own)} {_inputs_sentence(inputs, words)}"
    )
    return [Drawing("residuals", caption, tuple(panels), Layout(1.9))]


def _sentence(inputs: ReportInputs, own: ResidualTest) -> str:
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


def _panel(test: ResidualTest, colour: str, x_label: str, y_label: str, title: str) -> Panel:
    data: dict[str, Values] = {x_label: test.x, y_label: test.values, "95 % bound": test.bounds}
    on = partial(draw_test, test=test, colour=colour)
    return Panel(test.name, on, x_label, (y_label,), data, title)


def draw_test(ax: Axes, test: ResidualTest, colour: str) -> None:
    """Draw values as stems over the range in which those of noise lie."""
    ax.fill_between(test.x, -test.bounds, test.bounds, color=LIGHT, alpha=0.5, linewidth=0)
    zero_line(ax)
    ax.vlines(test.x, 0.0, test.values, color=colour, linewidth=0.8)
    draw_dots(ax, test.x, test.values, color=colour, markersize=2.5)
