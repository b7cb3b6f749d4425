"""Draw the residual tests of system identification, which show whether the errors of a model are
correlated with each other or with the inputs.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from mapmore_cli.domain.results import ResidualTest
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.panels import draw_dots, looks_of, zero_line
from mapmore_cli.reporting.figures.style import LIGHT
from mapmore_cli.reporting.inputs import ReportInputs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_INPUTS = 11
"""Largest number of inputs that have a panel. The time for drawing grows with the square of the
number of panels.
"""


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return a figure with a panel for the autocorrelation of the residuals, and a panel for each
    input. If there are more than `MOST_INPUTS` inputs, only the inputs with the worst results get a
    panel. If no tests were made, return an empty list.
    """
    if not inputs.validation.residual_tests:
        return []
    test_of_model, *others = inputs.validation.residual_tests
    colour = looks_of(inputs)[inputs.own].colour
    known = {quantity.name: quantity for quantity in inputs.model.inputs}

    def on(ax: Axes, test: ResidualTest) -> None:
        """Draw the values of a test as vertical lines. A grey band shows the range in which 95 % of
        them lie if the errors are noise.
        """
        ax.fill_between(test.x, -test.bounds, test.bounds, color=LIGHT, alpha=0.5, linewidth=0)
        zero_line(ax)
        ax.vlines(test.x, 0.0, test.values, color=colour, linewidth=0.8)
        draw_dots(ax, test.x, test.values, color=colour, markersize=2.5)

    along, mean = inputs.in_curve.name, f"Mean error ({inputs.target.unit})"
    panels = []
    worst = sorted(others, key=lambda test: -test.beyond / max(test.tested, 1))[:MOST_INPUTS]
    names = {test.name for test in worst}
    for test in (test_of_model, *(test for test in others if test.name in names)):
        if test is test_of_model:
            x_label = "Lag (samples)" if inputs.timed else f"Lag along {along} (samples)"
            y_label, title = "Autocorrelation (–)", "of the residuals"
        elif inputs.timed:
            x_label, y_label = "Lag behind the input (samples)", "Correlation (–)"
            title = f"with {test.name}"
        else:
            x_label, y_label, title = inputs.axis_label(known[test.name]), mean, f"over {test.name}"
        data = {x_label: test.x, y_label: test.values, "95 % bound": test.bounds}
        panels.append(Panel(test.name, partial(on, test=test), x_label, (y_label,), data, title))
    rows = "held-out" if inputs.holds_out else "training"
    caption = (
        f"Residual tests of {inputs.own} on the {rows} samples. Grey: the range of 95 % of the "
        f"values if the errors are noise. {_autocorrelation(inputs, test_of_model)} "
        f"{_of_inputs(inputs, others)}"
        f"{'' if len(worst) == len(others) else f' The {MOST_INPUTS} worst inputs are drawn.'}"
    )
    return [Drawing("residuals", caption, tuple(panels), Layout(1.9))]


def _autocorrelation(inputs: ReportInputs, test: ResidualTest) -> str:
    """Return a sentence that says in plain words what the autocorrelation of the residuals
    shows.
    """
    along, cause = (
        ("in time", "dynamics") if inputs.timed else (f"along {inputs.in_curve.name}", "shape")
    )
    meaning = f"are alike, so there is {cause} (or drift) that the model misses."
    by_chance = ""
    if not test.fails:
        by_chance, meaning = ", about as many as by chance", "do not depend on each other."
    count = f"{test.beyond} of {test.tested} lags lie outside{by_chance}"
    return f"Autocorrelation: {count}: neighbouring errors {along} {meaning}"


def _of_inputs(inputs: ReportInputs, tests: list[ResidualTest]) -> str:
    if not tests:
        return "No input varies."
    counts = ", ".join(f"{test.name} {test.beyond} of {test.tested} outside" for test in tests)
    meaning = (
        "A lag outside means that the input acts in a way that the model lacks; a negative lag "
        "outside means that the output acts back on the input."
        if inputs.timed
        else "In a part outside, the mean of the model is too high or too low."
    )
    return f"Inputs: {counts}. {meaning}"
