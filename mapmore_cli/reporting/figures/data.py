"""Every quantity of every recording in time: the data as read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.recording import Quantity, Recording
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import (
    BLUE,
    envelope,
    places,
    some_of,
    two_lines,
    width_for,
)
from mapmore_cli.reporting.inputs import FigureStyle, ReportInputs

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


def traces(
    recording: Recording, quantities: Mapping[str, Quantity], style: FigureStyle
) -> list[Trace]:
    """Return the recording's quantities in the order of its columns, time itself left out."""
    time = recording.columns.get(TIME.name)
    x = np.arange(recording.rows_kept, dtype=float) if time is None else time
    x_label = "Sample (–)" if time is None else style.axis_label(quantities.get(TIME.name, TIME))
    return [
        Trace(x, y, x_label, style.axis_label(quantities.get(name, Quantity(name, ""))))
        for name, y in recording.columns.items()
        if name != TIME.name
    ]


def draw_trace(ax: Axes, trace: Trace) -> None:
    """Draw the trace as one line, its peaks kept."""
    rows = envelope(trace.y, POINTS_A_TRACE)
    ax.plot(trace.x[rows], trace.y[rows], color=BLUE, linewidth=0.7)


def draw(inputs: ReportInputs) -> list[Drawing]:
    """One panel a recording, an axis for each quantity."""
    recordings = [recording for recording in inputs.dataset.recordings if recording.rows_kept]
    shown = [recordings[i] for i in places(inputs, [one.id for one in recordings], MOST_RECORDINGS)]
    found = [traces(recording, inputs.dataset.quantities, inputs.style) for recording in shown]
    height = max((len(of_one) for of_one in found), default=0)
    if height == 0:
        return []
    length = 18 if len(shown) > 2 else 40
    panels = tuple(
        _panel(recording, of_one, height, length)
        for recording, of_one in zip(shown, found, strict=True)
    )
    grid = Grid(
        len(shown), width_for(len(shown)), 0.3 + 0.95 * height, (1.0,) * height, common_y="row"
    )
    names = ", ".join(trace.y_label for trace in found[0])
    left_out = some_of(len(shown), len(recordings), "recordings")
    thinned = (
        " Long records are thinned for drawing to the lowest and highest sample of each short run."
    )
    caption = f"The kept samples of every quantity.{left_out}{thinned}"
    alt = f"Traces of {names} for {len(shown)} of {len(recordings)} recordings."
    return [Drawing("data", caption, alt, panels, grid)]


def _panel(recording: Recording, found: Sequence[Trace], height: int, length: int) -> Panel:
    def on(axes: Sequence[Axes]) -> None:
        for ax, trace in zip(axes, found, strict=False):
            draw_trace(ax, trace)
            ax.xaxis.set_major_locator(MaxNLocator(4))
            ax.yaxis.set_major_locator(MaxNLocator(4))

    below = [
        "\n".join(trace.y_label.rsplit(" ", 1)) for trace in found
    ]  # the axes are low: the unit goes below
    labels = (*below, *[""] * (height - len(found)))
    x_label = found[-1].x_label if found else ""
    data: dict[str, Values] = (
        {x_label: found[0].x, **{trace.y_label: trace.y for trace in found}} if found else {}
    )
    return Panel(recording.id, on, x_label, labels, data, two_lines(recording.id, length))
