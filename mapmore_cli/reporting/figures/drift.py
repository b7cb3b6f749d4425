"""The output of one muscle at reference points over campaigns."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.comparison import ReferencePoint
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import level_colours, shortened
from mapmore_cli.reporting.inputs import FigureStyle


def drift_drawing(names: Sequence[str], points: Sequence[ReferencePoint], output: Quantity) -> Drawing:
    """A line for each reference point, a dot for each campaign, in per cent of the first."""
    colours = level_colours(len(points))
    labels = [_label(point) for point in points]
    data: dict[str, Values] = {"campaign": list(names)}
    data |= {f"{label} [{output.unit}]": point.outputs for label, point in zip(labels, points, strict=True)}

    def on(axes: Sequence[Axes]) -> None:
        for point, colour in zip(points, colours, strict=True):
            relative = [100 * value / point.outputs[0] for value in point.outputs]
            axes[0].plot(range(len(names)), relative, color=colour, marker="o", markersize=3, linewidth=1.1)
        axes[0].set_xticks(range(len(names)), [shortened(name, 22) for name in names])

    handles = zip(labels, colours, strict=True)
    legend = tuple(Line2D([], [], color=colour, marker="o", markersize=3, label=label) for label, colour in handles)
    what = FigureStyle().axis_label(Quantity(output.name, "% of the first"))
    caption = f"{output.name} at reference points over campaigns, in per cent of the first."
    return Drawing("drift", caption, caption, (Panel("", on, "Campaign", (what,), data),), Grid(height=2.6), legend)


def _label(point: ReferencePoint) -> str:
    return ", ".join(f"{name} {value:.3g}" for name, value in point.inputs.items())
