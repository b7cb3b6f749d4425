"""Segments with the weights that join them, as M2's figures 5 and 6."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.declared import Transition
from mapmore_cli.domain.models import Fusion
from mapmore_cli.domain.recording import DIRECTION, Quantity
from mapmore_cli.modelling.pieces.definition import cell_weights, zones
from mapmore_cli.modelling.pieces.segmentation import training_curves
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.levels import level_figures
from mapmore_cli.reporting.figures.style import (
    GREY,
    SEGMENT_COLOURS,
    SEGMENT_MARKERS,
    columns_for,
    places,
    shortened,
    some_of,
    width_for,
)
from mapmore_cli.reporting.figures.thinning import cloud
from mapmore_cli.reporting.inputs import ReportInputs

MOST_CURVES = 6
DOTS_A_SEGMENT = 30
GRID = 401


@dataclass(frozen=True)
class SegmentCurve:
    """One training curve along one segmented variable.

    `x`, `y` and `cell` (1-based place of the sample's segment) are `(n,)`; `boundaries` is `(count + 1,)`, both ends included.
    """

    id: str
    title: str
    x: Array
    y: Array
    cell: IntArray
    boundaries: Array


def segment_curves(inputs: ReportInputs, variable: int) -> list[SegmentCurve]:
    """Return the segmented curves along variable number `variable`; held-out samples are left out."""
    curves = {curve.id: curve for curve in training_curves(inputs.dataset.curves, by_level=inputs.model.level is not None)}
    panels = []
    for segmented in inputs.segmentation:
        curve = curves[segmented.curve]
        train = ~curve.held_out
        cell = np.zeros(curve.size, dtype=np.int64)
        for segment in segmented.segments:
            cell[segment.rows] = segment.cell[variable]
        x, y = curve.columns[segmented.variables[variable]][train], curve.columns[inputs.fitted][train]
        title = inputs.curve_label(curve)
        panels.append(SegmentCurve(segmented.curve, title, x, y, cell[train], segmented.boundaries[variable]))
    return panels


def draw_segments(ax: Axes, curve: SegmentCurve) -> None:
    """Draw the samples, coloured and marked by segment."""
    for place in range(1, len(curve.boundaries)):
        rows = np.flatnonzero(curve.cell == place)
        rows = rows[cloud(curve.x[rows], curve.y[rows], DOTS_A_SEGMENT)]
        ax.plot(curve.x[rows], curve.y[rows], linestyle="none", markersize=2.8, markeredgewidth=0, **_look(place, "marker"))


def draw_weights(ax: Axes, curve: SegmentCurve, transition: Transition, z_s: float) -> None:
    """Draw the weight of every segment along the variable, where it has any."""
    x = np.union1d(np.linspace(curve.boundaries[0], curve.boundaries[-1], GRID), np.concatenate(zones(curve.boundaries, z_s)))
    for place, weight in enumerate(cell_weights(x, curve.boundaries, transition, z_s).T, start=1):
        ax.plot(x, np.where(weight > 0, weight, np.nan), linewidth=1.2, **_look(place, "linestyle"))
    ax.set_yticks([0, 0.5, 1])


def draw_zones(ax: Axes, boundaries: Array, z_s: float) -> None:
    """Draw boundaries as vertical lines, transition zones shaded (M2 eq 10 and 11)."""
    for start, end in zip(*zones(boundaries, z_s), strict=True):
        ax.axvspan(start, end, color="#ececec", linewidth=0, zorder=-1)
    for boundary in boundaries:
        ax.axvline(boundary, color=GREY, linewidth=0.5, zorder=0)


def _look(place: int, what: str) -> dict[str, Any]:
    i = (place - 1) % len(SEGMENT_COLOURS)
    marks = {"marker": SEGMENT_MARKERS[i], "linestyle": ("-", "--", "-.", ":")[i]}
    return {"color": SEGMENT_COLOURS[i], what: marks[what]}


def draw(inputs: ReportInputs) -> list[Drawing]:
    """One figure a segmented variable, and one of the way between the levels."""
    pieces = inputs.model.pieces
    if pieces is None or not pieces.segments:
        return []
    cut = [_variable_figure(inputs, pieces.fusion, j, name) for j, name in enumerate(pieces.variables) if name != DIRECTION]
    return [*cut, *level_figures(inputs)]


def _variable_figure(inputs: ReportInputs, fusion: Fusion, variable: int, name: str) -> Drawing:
    every = segment_curves(inputs, variable)
    shown = [every[i] for i in places(inputs, [curve.id for curve in every], MOST_CURVES)]
    panels = tuple(_panel(inputs, fusion, curve, inputs.dataset.quantities[name]) for curve in shown)
    grid = Grid(columns_for(len(panels)), width_for(len(panels)), 2.2, (2.0, 0.8), common_y="row")
    joined = f"{fusion.transition} transitions, z_s = {fusion.z_s:g}"
    caption = (
        f"Training samples by segment of {name}, and the segments' weights within their curve below: boundaries as lines, transition zones "
        f"shaded ({joined})."
        f"{some_of(len(shown), len(every), 'curves')}"
    )
    spoken = "; ".join(f"{curve.title}: boundaries at {', '.join(f'{b:.3g}' for b in curve.boundaries)}" for curve in shown)
    stem = "segments" if variable == 0 else f"segments_{name}"
    return Drawing(stem, caption, f"Segments of {name}. {spoken}.", panels, grid)


def _panel(inputs: ReportInputs, fusion: Fusion, curve: SegmentCurve, along: Quantity) -> Panel:
    def on(axes: Sequence[Axes]) -> None:
        draw_segments(axes[0], curve)
        draw_weights(axes[1], curve, fusion.transition, fusion.z_s)
        for ax in axes:
            draw_zones(ax, curve.boundaries, fusion.z_s)

    target = inputs.dataset.quantities[inputs.fitted]
    weights = cell_weights(curve.x, curve.boundaries, fusion.transition, fusion.z_s).T
    data: dict[str, Values] = {
        f"{along.name} [{along.unit}]": curve.x,
        f"{target.name} [{target.unit}]": curve.y,
        "segment": curve.cell,
        **{f"weight of segment {place}": weight for place, weight in enumerate(weights, start=1)},
    }
    return Panel(curve.id, on, inputs.axis_label(along), (inputs.axis_label(target), "Weight (–)"), data, shortened(curve.title, 34))
