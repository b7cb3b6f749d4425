"""Segments with the weights that join them, as M2's figures 5 and 6."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.recording import DIRECTION
from mapmore_cli.modelling.pieces.segmentation import training_curves
from mapmore_cli.modelling.pieces.weights import cell_weights, zones
from mapmore_cli.reporting.figures.drawing import Drawing
from mapmore_cli.reporting.figures.levels import level_figures
from mapmore_cli.reporting.figures.panels import columns_for, label_pair, pairs, width_for
from mapmore_cli.reporting.figures.style import (
    GREY,
    SEGMENT_COLOURS,
    SEGMENT_MARKERS,
    axis_label,
    shortened,
    some_of,
)
from mapmore_cli.reporting.figures.thinning import cloud, spread
from mapmore_cli.reporting.inputs import ReportInputs

MOST_CURVES = 6
DOTS_A_SEGMENT = 30
GRID = 401


@dataclass(frozen=True)
class SegmentPanel:
    """One training curve along one segmented variable.

    `x`, `y` and `cell` (1-based place of the sample's segment) are `(n,)`; `boundaries` is `(count + 1,)`, both ends included.
    """

    title: str
    x: Array
    y: Array
    cell: IntArray
    boundaries: Array


def segment_panels(inputs: ReportInputs, variable: int) -> list[SegmentPanel]:
    """The segmented curves along variable number `variable`; held-out samples are left out."""
    curves = {curve.id: curve for curve in training_curves(inputs.dataset.curves, by_level=inputs.model.level is not None)}
    panels = []
    for segmented in inputs.segmentation:
        curve = curves[segmented.curve]
        train = ~curve.held_out
        cell = np.zeros(curve.size, dtype=np.int64)
        for segment in segmented.segments:
            cell[segment.rows] = segment.cell[variable]
        x, y = curve.columns[segmented.variables[variable]], curve.columns[inputs.dataset.target]
        panels.append(SegmentPanel(inputs.curve_label(curve), x[train], y[train], cell[train], segmented.boundaries[variable]))
    return panels


def draw_segments(ax: Axes, panel: SegmentPanel) -> None:
    """The samples, coloured and marked by segment."""
    for place in range(1, len(panel.boundaries)):
        rows = np.flatnonzero(panel.cell == place)
        rows = rows[cloud(panel.x[rows], panel.y[rows], DOTS_A_SEGMENT)]
        ax.plot(panel.x[rows], panel.y[rows], linestyle="none", markersize=2.8, markeredgewidth=0, **_look(place, "marker"))


def draw_weights(ax: Axes, panel: SegmentPanel, transition: str, z_s: float) -> None:
    """Weight of every segment along the variable, where it has any."""
    x = np.union1d(np.linspace(panel.boundaries[0], panel.boundaries[-1], GRID), np.concatenate(zones(panel.boundaries, z_s)))
    for place, weight in enumerate(cell_weights(x, panel.boundaries, transition, z_s).T, start=1):
        ax.plot(x, np.where(weight > 0, weight, np.nan), linewidth=1.2, **_look(place, "linestyle"))
    ax.set_yticks([0, 0.5, 1])


def draw_zones(ax: Axes, boundaries: Array, z_s: float) -> None:
    """Boundaries as vertical lines, transition zones shaded (M2 eq 10 and 11)."""
    for start, end in zip(*zones(boundaries, z_s), strict=True):
        ax.axvspan(start, end, color="#ececec", linewidth=0, zorder=-1)
    for boundary in boundaries:
        ax.axvline(boundary, color=GREY, linewidth=0.5, zorder=0)


def _look(place: int, what: str) -> dict[str, Any]:
    i = (place - 1) % len(SEGMENT_COLOURS)
    marks = {"marker": SEGMENT_MARKERS[i], "linestyle": ("-", "--", "-.", ":")[i]}
    return {"color": SEGMENT_COLOURS[i], what: marks[what]}


def segment_figures(inputs: ReportInputs) -> list[Drawing]:
    """One figure a segmented variable, and one of the way between the levels."""
    if not inputs.has_pieces:
        return []
    cut = [_variable_figure(inputs, j, name) for j, name in enumerate(inputs.model.variables) if name != DIRECTION]
    return [*cut, *level_figures(inputs)]


def _variable_figure(inputs: ReportInputs, variable: int, name: str) -> Drawing:
    every = segment_panels(inputs, variable)
    panels = [every[i] for i in spread(len(every), MOST_CURVES)]
    fusion, quantity = inputs.model.fusion, inputs.dataset.quantities[name]
    rows = math.ceil(len(panels) / columns_for(len(panels)))
    figure = Figure(figsize=(width_for(len(panels)), 0.2 + 2.2 * rows), layout="constrained")
    for pair, panel in zip(pairs(figure, len(panels), (2.0, 0.8), common_x=False), panels, strict=True):
        draw_segments(pair.top, panel)
        draw_weights(pair.bottom, panel, fusion.transition, fusion.z_s)
        for ax in (pair.top, pair.bottom):
            draw_zones(ax, panel.boundaries, fusion.z_s)
        pair.top.set_title(shortened(panel.title, 34))
        label_pair(pair, axis_label(quantity), axis_label(inputs.target), "Weight (–)")
    figure.align_ylabels()
    joined = f"{fusion.transition} transitions, z_s = {fusion.z_s:g}"
    caption = (
        f"Training samples by segment of {name}, and the segments' weights below: boundaries as lines, transition zones shaded ({joined})."
        f"{some_of(len(panels), len(every), 'curves')}"
    )
    alt = "; ".join(f"{panel.title}: boundaries at {', '.join(f'{b:.3g}' for b in panel.boundaries)}" for panel in panels)
    stem = "segments" if variable == 0 else f"segments_{name}"
    return Drawing(stem, caption, f"Segments of {name}. {alt}.", figure)
