"""Every quantity of every recording in time: the data as read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.recording import Quantity, Recording
from mapmore_cli.reporting.figures.drawing import Drawing
from mapmore_cli.reporting.figures.panels import width_for
from mapmore_cli.reporting.figures.style import BLUE, axis_label, some_of, two_lines
from mapmore_cli.reporting.figures.thinning import envelope, spread
from mapmore_cli.reporting.inputs import ReportInputs

MOST_RECORDINGS = 5
POINTS_A_TRACE = 1500
TIME = Quantity("time", "s")


@dataclass(frozen=True)
class Trace:
    """One quantity over time, or over the sample number where no time was recorded."""

    x: Array
    y: Array
    x_label: str
    y_label: str


def traces(recording: Recording, quantities: Mapping[str, Quantity]) -> list[Trace]:
    """The recording's quantities in the order of its columns, time itself left out."""
    time = recording.columns.get(TIME.name)
    x = np.arange(recording.rows_kept, dtype=float) if time is None else time
    x_label = "Sample (–)" if time is None else axis_label(quantities.get(TIME.name, TIME))
    return [
        Trace(x, y, x_label, axis_label(quantities.get(name, Quantity(name, ""))))
        for name, y in recording.columns.items()
        if name != TIME.name
    ]


def draw_trace(ax: Axes, trace: Trace) -> None:
    """The trace as one line, its peaks kept."""
    rows = envelope(trace.y, POINTS_A_TRACE)
    ax.plot(trace.x[rows], trace.y[rows], color=BLUE, linewidth=0.7)


def data_figures(inputs: ReportInputs) -> list[Drawing]:
    """One column of panels a recording, one row a quantity."""
    recordings = [recording for recording in inputs.dataset.recordings if recording.rows_kept]
    shown = [recordings[i] for i in spread(len(recordings), MOST_RECORDINGS)]
    table = [traces(recording, inputs.dataset.quantities) for recording in shown]
    height = max((len(column) for column in table), default=0)
    if height == 0:
        return []
    figure = Figure(figsize=(width_for(len(shown)), 0.5 + 0.95 * height), layout="constrained")
    axes = figure.subplots(height, len(shown), sharex="col", sharey="row", squeeze=False)
    for j, (recording, column) in enumerate(zip(shown, table, strict=True)):
        axes[0, j].set_title(two_lines(recording.id, 18 if len(shown) > 2 else 40), fontsize=7)
        _draw_column(list(axes[:, j]), column, labelled=j == 0)
    figure.align_ylabels()
    names = ", ".join(trace.y_label for trace in table[0])
    left_out = some_of(len(shown), len(recordings), "recordings")
    thinned = " Long records are thinned for drawing to the lowest and highest sample of each short run."
    caption = f"The kept samples of every quantity.{left_out}{thinned}"
    return [Drawing("data", caption, f"Traces of {names} for {len(shown)} of {len(recordings)} recordings.", figure)]


def _draw_column(axes: Sequence[Axes], column: Sequence[Trace], labelled: bool) -> None:
    for ax, trace in zip(axes, column, strict=False):
        draw_trace(ax, trace)
        ax.xaxis.set_major_locator(MaxNLocator(4))
        ax.yaxis.set_major_locator(MaxNLocator(4))
        if labelled:
            ax.set_ylabel("\n".join(trace.y_label.rsplit(" ", 1)))  # the panels are low: the unit goes below
    if column:
        axes[-1].set_xlabel(column[-1].x_label)
