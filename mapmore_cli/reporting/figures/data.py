"""Draw every quantity of every recording over time, as it was read."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.reporting.figures.panels import draw_trace, places, some_of
from mapmore_cli.reporting.figures.sketch import is_sketch
from mapmore_cli.reporting.figures.style import BLUE
from mapmore_cli.reporting.inputs import ReportInputs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_RECORDINGS, MOST_QUANTITIES = 5, 12
"""Largest number of recordings (side by side) and of quantities (below each other). The time for
drawing grows with the square of the number of axes.
"""


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return a figure with one panel for each recording. A panel has separate axes for each
    quantity. The quantity is drawn over time, or over the number of the sample if the time is
    unknown.
    """
    recordings = [recording for recording in inputs.dataset.recordings if recording.rows_kept]
    shown = [
        recordings[i]
        for i in places(inputs, [recording.id for recording in recordings], MOST_RECORDINGS)
    ]
    target = inputs.dataset.target
    names = dict.fromkeys(
        name for recording in shown for name in (target, *recording.columns) if name != "time"
    )
    drawn = {"time", *list(names)[:MOST_QUANTITIES]}
    height = max(
        (len(recording.columns.keys() & drawn - {"time"}) for recording in shown), default=0
    )
    if height == 0:
        return []
    quantities = {"time": Quantity("time", "s"), **inputs.dataset.quantities}
    panels = []
    for recording in shown:
        columns = {
            inputs.axis_label(quantities.get(name, Quantity(name, ""))): values
            for name, values in sorted(
                recording.columns.items(), key=lambda column: column[0] != "time"
            )
            if name in drawn
        }
        if "time" not in recording.columns:
            columns = {"Sample (–)": np.arange(recording.rows_kept, dtype=float), **columns}
        x_label, *others = columns
        # the axes are too low for the whole label, so the unit stands on a second line
        labels = ["\n".join(label.rsplit(" ", 1)) for label in others]
        labels += [""] * (height - len(others))
        on = partial(draw_columns, columns=columns)
        panels.append(Panel(recording.id, on, x_label, tuple(labels), columns, recording.id))
    caption = (
        f"The kept samples of {_which(len(names))}."
        f"{some_of(len(shown), len(recordings), 'recordings')}"
        " Long records are thinned for drawing to the lowest and highest sample of each short run."
    )
    grid = Layout(0.3 + 0.95 * height, (1.0,) * height, len(shown), common_y="row")
    return [Drawing("data", caption, tuple(panels), grid)]


def _which(count: int) -> str:
    """Return the words of the caption that say which of the `count` quantities are drawn."""
    if count <= MOST_QUANTITIES:
        return "every quantity"
    return f"the target and {MOST_QUANTITIES - 1} of {count - 1} other quantities"


def draw_columns(*axes: Axes, columns: Mapping[str, Array]) -> None:
    """Draw each column over the first column, in separate axes. Long columns are thinned so that
    their peaks remain.
    """
    x, *others = columns.values()
    for ax, values in zip(axes, others, strict=False):
        draw_trace(ax, x, values, color=BLUE, linewidth=0.7)
        if not is_sketch(ax):
            ax.locator_params(nbins=4)
